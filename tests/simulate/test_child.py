"""A run whose law is in a child process."""

import signal
import subprocess
import sys
import time
from pathlib import Path

from cranectl.log import read_log


def test_an_interrupt_ends_a_run_with_a_law_in_order(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(
        "import time\n"
        "def slow(parameters, measured, reference, memory, command):\n"
        "    memory[0] += 1.0\n"
        "    if memory[0] == 1500.0:\n"
        "        open('under_way', 'w').close()\n"
        "    if memory[0] >= 1500.0:\n"
        "        time.sleep(0.001)\n"
        "    return 0\n"
    )
    run = [
        "run",
        "fixed-position",
        "--controller",
        "law.py:slow",
        "--plants",
        "analytic",
        "--out",
        "run.mcap",
    ]
    process = subprocess.Popen(
        [sys.executable, "-m", "cranectl", *run],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while not (tmp_path / "under_way").exists() and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=60)
    assert process.returncode == 130, error
    assert "interrupted" in out
    (found,) = read_log(tmp_path / "run.mcap").values()
    assert found.status.label == "interrupted"
    assert len(found.time_ns) == 251  # of the first block every fourth, and the last

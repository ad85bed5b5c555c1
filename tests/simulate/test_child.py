"""A run whose controller is in a child process."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from cranectl.cli.controller_options import ControllerName
from cranectl.log.reader import read_log
from cranectl.simulate.child import BLOCK_TIMEOUT, blocks_in_child
from cranectl.support.children import Child
from cranectl.support.compiled_step import CompiledStep
from cranectl.support.parent import Parent
from tests.pace import HANG
from tests.shadowing_modules import write_shadowing_modules


@pytest.mark.slow
def test_an_interrupt_ends_a_run_with_a_controller_in_a_child_in_order(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(
        "import time\n"
        "def slow(parameters, measured, reference, memory, command):\n"
        "    memory[0] += 1.0\n"
        "    if memory[0] == 1900.0:\n"
        "        open('under_way', 'w').close()\n"
        "    if memory[0] >= 1000.0:\n"  # from the end of the first block on, for the parent to take it
        "        time.sleep(0.001)\n"
        "    return 0\n"
    )
    run = "run fixed-position --controller law.py:slow --plants analytic --out run.mcap"
    process = subprocess.Popen(
        [sys.executable, "-m", "cranectl", *run.split()],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while not (tmp_path / "under_way").exists() and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=HANG)
    assert process.returncode == 130, error
    assert "interrupted" in out
    (recorded,) = read_log(tmp_path / "run.mcap").values()
    assert recorded.status.label == "interrupted"
    assert len(recorded.time_ns) == 251  # of the first block every fourth, and the last


def tell_path(parent: Parent) -> None:
    parent.send((os.environ.get("PYTHONSAFEPATH"), sys.path))


def test_a_module_of_the_working_directory_is_not_run_in_a_new_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It finds the same modules as this process; a script that it starts finds the modules beside itself."""
    imported = write_shadowing_modules(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    child = Child.spawn(tell_path)
    safe, path = child.receive(HANG)
    child.end()
    assert imported.read_text() == ""
    assert (safe, path) == (None, sys.path)
    assert "PYTHONSAFEPATH" not in os.environ


def test_what_a_controller_raises_cannot_act_on_a_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    def advance(_: int) -> tuple[int, int, int]:
        raise ValueError("a\x1b[2Jb\nc")

    list(blocks_in_child(advance, 1, "law\x07", 60.0))
    CompiledStep.report("law\x07", ValueError("a\x1b[2Jb\nc"))
    message = capfd.readouterr().err
    assert message.count("ValueError: a\\x1b[2Jb\\nc") == 2
    assert message.isascii()
    assert all(line.isprintable() for line in message.splitlines())


def test_the_command_line_waits_as_long_as_the_library() -> None:
    command = click.command()(ControllerName.timeout_option(lambda timeout: timeout))
    (option,) = (option for option in command.params if option.name == "timeout")
    assert option.default == BLOCK_TIMEOUT
    result = CliRunner().invoke(command, ["--timeout", "6"], standalone_mode=False)
    assert result.return_value == 6.0

"""The test suite sets the signal handlers that tests assume, whatever process starts it."""

import signal
import subprocess
import sys
from pathlib import Path

from cranectl.support.interrupts import SIGNALS


def test_processes_of_tests_handle_signals() -> None:
    script = (
        "import signal, sys; sys.exit(any(signal.getsignal(int(n)) is signal.SIG_IGN for n in sys.argv[1:]))"
    )
    for numbers in ([], *([f"{number:d}"] for number in SIGNALS)):
        assert subprocess.run([sys.executable, "-c", script, *numbers], check=False).returncode == 0
    assert signal.SIG_IGN not in map(signal.getsignal, SIGNALS)


def test_processes_of_tests_handle_signals_in_a_background_script() -> None:
    command = f"{__file__}::{test_processes_of_tests_handle_signals.__name__}"
    script = 'trap \'\' INT TERM HUP; exec "$0" -m pytest -n 0 -p no:cacheprovider "$1"'
    result = subprocess.run(
        ["sh", "-c", script, sys.executable, command],
        cwd=Path(__file__).parent.parent, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout

"""Tests set the handlers of signals that they assume, independently of the process that starts them."""

import signal
import subprocess
import sys
from pathlib import Path

from cranectl.support.interrupts import SIGNALS


def test_what_tests_start_takes_signals() -> None:
    script = (
        "import signal, sys; sys.exit(any(signal.getsignal(int(n)) is signal.SIG_IGN for n in sys.argv[1:]))"
    )
    for numbers in ([], *([f"{number:d}"] for number in SIGNALS)):
        assert subprocess.run([sys.executable, "-c", script, *numbers], check=False).returncode == 0
    assert signal.SIG_IGN not in map(signal.getsignal, SIGNALS)


def test_also_in_the_background_of_a_script() -> None:
    command = f"{__file__}::{test_what_tests_start_takes_signals.__name__}"
    started = 'trap \'\' INT TERM HUP; exec "$0" -m pytest -n 0 -p no:cacheprovider "$1"'
    done = subprocess.run(
        ["sh", "-c", started, sys.executable, command],
        cwd=Path(__file__).parent.parent, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout

"""Every numeric option of every command accepts an odd number or explains the error, and never exits with 70.

The options are read from the commands, so that new ones are tested too. `make test` runs a fixed selection
of the cases; RANGE_CASES=all runs all of them.
"""

import re
from collections.abc import Iterator

import click
import pytest

from cranectl.cli.main import main
from tests.cli.command_lines import LINES, commands
from tests.cli.conftest import Command
from tests.ranges import share_of

NUMBERS = ("0", "1", "-1", "1e-300", "1e300", "nan", "inf", str(10**12), str(2**63))
# What follows a command, or a command and an option, instead of `LINES`.
QUICK_LINES = {
    "render": "one.mcap one.gif --size 160x120",
    "render --time": "one.mcap one.png --size 160x120",
    "new": "experiment lab-rig",
}
# Valid values with which a command runs for a long time.
LONG_VALUES = {
    "live --speed": ("1",),
    "live --port": ("0", "1"),
    "tune": ("1", "1e-300"),
    "benchmark run": ("1", "1e-300"),
    "certify": ("1",),  # a rope length, a delay or a lag of 1 takes half a minute
}
NAMES_OF_RUNS = ("--run",)  # chosen from what a result has
# Cases that once failed; they are always tested.
ALWAYS_TESTED = (f"campaign replay --every {2**63}", "certify --tilt nan")
ALWAYS_TESTED += tuple(f"certify --hoisting-speed {value}" for value in ("1e300", "nan", "inf"))


def numeric_options() -> Iterator[tuple[str, str, int]]:
    """Yield each numeric option: command, option, and how many numbers it takes."""
    for name, command in commands():
        for option in command.params:
            kind = option.type.types[0] if isinstance(option.type, click.Tuple) else option.type
            numbers = (click.types.IntParamType, click.types.FloatParamType)
            if isinstance(option, click.Option) and isinstance(kind, numbers):
                yield name, option.opts[0], option.nargs


def line_of(command: str, option: str, *values: str) -> list[str]:
    """Return a quick command line that ends with values of an option."""
    words = QUICK_LINES.get(f"{command} {option}") or QUICK_LINES.get(command) or LINES[command]
    line = f"{command} {words}".partition(f" {option} ")[0]
    return [*line.split(), option, *values]


OPTIONS = list(numeric_options())
CASES = [
    (f"{command} {option} {value}", command, option, nargs, value)
    for command, option, nargs in OPTIONS
    for value in NUMBERS
    if value not in (*LONG_VALUES.get(command, ()), *LONG_VALUES.get(f"{command} {option}", ()))
]


@pytest.mark.usefixtures("in_copy_of_files")
@pytest.mark.parametrize(
    ("command", "option", "nargs", "value"), [case[1:] for case in share_of(CASES, 40, ALWAYS_TESTED)]
)
def test_an_odd_number_gives_a_result_or_an_explained_error(
    command: str, option: str, nargs: int, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    code = main(line_of(command, option, *[value] * nargs))
    error = capsys.readouterr().err
    assert code in (0, 1, 2, 3), error
    assert "Traceback" not in error
    if code == 2:
        assert "Invalid value" in error or ("found:" in error and "remedy:" in error), error


@pytest.mark.usefixtures("in_copy_of_files")
@pytest.mark.parametrize(("command", "option", "nargs"), OPTIONS, ids=[" ".join(o[:2]) for o in OPTIONS])
def test_every_numeric_option_has_a_bound_that_the_error_tells(
    command: str, option: str, nargs: int, refusal: Command
) -> None:
    """A new option without a bound would be accepted here, and run for ever or take all memory."""
    error = refusal(*line_of(command, option, *[str(10**20)] * nargs))
    allowed = error.partition("allowed:")[2] or error.partition("is not in the range")[2]
    assert re.search(r"\d", allowed) or option in NAMES_OF_RUNS, error


def test_numeric_options_are_found() -> None:
    """`test_odd_names.py` checks that there is a line for every command."""
    assert len(OPTIONS) > 25

"""Every numeric option of every command accepts an odd number or explains the error, and never exits with 70.

The options are read from the commands, so that new ones are tested too. `make test` runs a fixed selection
of the cases; RANGE_CASES=all runs all of them.
"""

import re
from collections.abc import Iterator

import click
import pytest

from cranectl.cli.main import cli, main
from tests.cli.option_cases import MANY, SHORT
from tests.ranges import share_of
from tests.remedies import prepared

NUMBERS = ("0", "1", "-1", "1e-300", "1e300", "nan", "inf", str(10**12), str(2**63))
# A command line that is quick, by command, or by command and option.
QUICK_LINES = {
    "run": "run short.toml --plants analytic --out own.mcap",
    "validate": "validate short.toml --plants analytic --jobs 1",
    "campaign run": "campaign run many.toml --out other",
    "campaign show": "campaign show many.toml",
    "campaign replay": "campaign replay result",
    "certify": "certify lqr",
    "render": "render one.mcap one.gif --size 160x120",
    "render --time": "render one.mcap one.png --size 160x120",
    "live": "live short.toml --plants analytic",
    "tune": "tune lqr-integral",
    "benchmark run": "benchmark run --controller lqr-integral",
    "new": "new experiment lab-rig",
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


def numeric_options(command: click.Command, path: tuple[str, ...] = ()) -> Iterator[tuple[str, str, int]]:
    """Yield each numeric option: command, option, and how many numbers it takes."""
    if isinstance(command, click.Group):
        for name, subcommand in command.commands.items():
            yield from numeric_options(subcommand, (*path, name))
        return
    for option in command.params:
        kind = option.type.types[0] if isinstance(option.type, click.Tuple) else option.type
        numbers = (click.types.IntParamType, click.types.FloatParamType)
        if isinstance(option, click.Option) and isinstance(kind, numbers):
            yield " ".join(path), option.opts[0], option.nargs


OPTIONS = list(numeric_options(cli))
CASES = [
    (f"{command} {option} {value}", command, option, nargs, value)
    for command, option, nargs in OPTIONS
    for value in NUMBERS
    if value not in (*LONG_VALUES.get(command, ()), *LONG_VALUES.get(f"{command} {option}", ()))
]


prepared_files = prepared(
    {"short.toml": f'name = "short"\n{SHORT}', "many.toml": MANY},
    ["run short.toml --plants analytic --out one.mcap", "campaign run many.toml --out result"],
)


@pytest.mark.usefixtures("in_copy_of_files")
@pytest.mark.parametrize(
    ("command", "option", "nargs", "value"), [case[1:] for case in share_of(CASES, 40, ALWAYS_TESTED)]
)
def test_an_odd_number_gives_a_result_or_an_explained_error(
    command: str, option: str, nargs: int, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    line = QUICK_LINES.get(f"{command} {option}") or QUICK_LINES[command]
    if f" {option} " in line:
        line = line.partition(f" {option} ")[0]
    code = main([*line.split(), option, *[value] * nargs])
    error = capsys.readouterr().err
    assert code in (0, 1, 2, 3), error
    assert "Traceback" not in error
    if code == 2:
        assert "Invalid value" in error or ("found:" in error and "remedy:" in error), error


@pytest.mark.usefixtures("in_copy_of_files")
@pytest.mark.parametrize(("command", "option", "nargs"), OPTIONS, ids=[" ".join(o[:2]) for o in OPTIONS])
def test_every_numeric_option_has_a_bound_that_the_error_tells(
    command: str, option: str, nargs: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """A new option without a bound would be accepted here, and run for ever or take all memory."""
    line = QUICK_LINES.get(f"{command} {option}") or QUICK_LINES[command]
    if f" {option} " in line:
        line = line.partition(f" {option} ")[0]
    huge = str(10**20)
    assert main([*line.split(), option, *[huge] * nargs]) == 2
    error = capsys.readouterr().err
    allowed = error.partition("allowed:")[2] or error.partition("is not in the range")[2]
    assert re.search(r"\d", allowed) or option in NAMES_OF_RUNS, error


def test_every_command_with_a_numeric_option_is_tested() -> None:
    assert {command for command, *_ in OPTIONS} == {name.partition(" --")[0] for name in QUICK_LINES}
    assert len(OPTIONS) > 25

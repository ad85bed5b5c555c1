"""Every command that takes a path or a name explains an odd one, and never exits with 70.

The arguments are read from the commands, so that new ones are tested too. `make test` runs a fixed selection
of the cases; RANGE_CASES=all runs all of them.
"""

from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from cranectl.cli.main import main
from cranectl.cli.names import Names
from tests.cli.command_lines import LINES, commands
from tests.ranges import share_of

NAMES = {
    "long": "x" * 300,
    "long-toml": "x" * 300 + ".toml",
    "long-mcap": "x" * 300 + ".mcap",
    "long-law": "x" * 300 + ".py:law",
    "long-below": "folder/" + "x" * 300,
    "long-path": "/".join(["x" * 200] * 30),
    "null": "a\0b",
    "no-text": "a\udcffb",
    "directory": "folder",
    "directory-toml": "folder.toml",
    "below-a-file": "short.toml/below",
    "below-a-device": "/dev/null/below.mcap",
    "unwritable": "/proc/cranectl.mcap",
    "loop": "loop.toml",
    "empty": "",
}
# Texts for people, and no names.
TEXTS = ("--set", "--label", "--size", "--allow-origin")
# Commands that take long where a name is a good one; those that read all results of a benchmark always do.
LONG = ("tune", "report --figures", "design --export", "live", "benchmark run", "thesis", "identify")
READS_RESULTS = ("benchmark report", "benchmark run --tuned")
REFUSED = ("long", "long-below", "long-path", "null", "below-a-file", "below-a-device", "unwritable")
NUMBERS = (click.types.BoolParamType, click.types.IntParamType, click.types.FloatParamType, click.Tuple)


def names_of(command: click.Command) -> Iterator[str]:
    """Yield the options, and the arguments by their place, that take a path or a name."""
    place = 0
    for parameter in command.params:
        is_name = not isinstance(parameter.type, (*NUMBERS, click.Choice)) and not parameter.is_eager
        if isinstance(parameter, click.Option):
            if is_name and not parameter.is_flag and parameter.opts[0] not in TEXTS:
                yield parameter.opts[0]
        else:
            if is_name:
                yield str(place)
            place += 1


def line_of(command: str, parameter: str, value: str) -> list[str]:
    """Return the command line with an odd value of one parameter."""
    words = LINES[command].split()
    if parameter.startswith("--"):
        if parameter in words:
            place = words.index(parameter)
            del words[place : place + 2]
        return [*command.split(), *words, parameter, value]
    place = int(parameter)
    is_given = place < len(words) and not words[place].startswith("--")
    return [*command.split(), *words[:place], value, *words[place + is_given :]]


ALWAYS_TESTED = ("benchmark report 0 long", "benchmark run --out long")  # which once failed
PARAMETERS = [(name, parameter) for name, command in commands() for parameter in names_of(command)]
CASES = [
    (f"{name} {parameter} {odd}", name, parameter, odd)
    for name, parameter in PARAMETERS
    for odd in NAMES
    if (odd in REFUSED or not f"{name} {parameter}".startswith(LONG))
    and (f"{name} {parameter} {odd}" in ALWAYS_TESTED or not f"{name} {parameter}".startswith(READS_RESULTS))
]


def test_every_command_is_tested() -> None:
    assert set(LINES) == {name for name, _ in commands()}
    assert len(PARAMETERS) > 100


@pytest.mark.usefixtures("in_copy_of_files")
@pytest.mark.parametrize(
    ("command", "parameter", "odd"), [case[1:] for case in share_of(CASES, 40, ALWAYS_TESTED)]
)
def test_an_odd_name_is_explained(
    command: str, parameter: str, odd: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("loop.toml").symlink_to("loop.toml")
    capsys.readouterr()
    code = main(line_of(command, parameter, NAMES[odd]))
    error = capsys.readouterr().err
    assert code in (0, 1, 2, 3), error
    assert "Traceback" not in error
    if code == 2:
        assert "Usage:" in error or ("found:" in error and "remedy:" in error), error


@pytest.mark.parametrize("odd", ["", "/", ".."])
def test_a_file_without_a_name_has_a_short_name(odd: str) -> None:
    """It is refused where it is read; `report x.mcap ''` ended before that."""
    assert Names.of_files([Path("a/x.mcap"), Path(odd)])[0] == "x"

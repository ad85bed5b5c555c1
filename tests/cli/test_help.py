"""`--help` lists every command in a group, with one line each."""

import re
from collections.abc import Iterator

import click
import pytest

from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.main import COMMANDS, NAMES, cli


def groups(group: click.Group) -> Iterator[click.Group]:
    yield group
    for command in group.commands.values():
        if isinstance(command, click.Group):
            yield from groups(command)


def help_text(group: click.Group) -> str:
    """Return the help for a terminal of 80 columns."""
    return group.get_help(click.Context(group, terminal_width=80))


@pytest.mark.parametrize("group", list(groups(cli)), ids=lambda group: group.name)
def test_every_command_has_a_one_line_summary(group: click.Group) -> None:
    text = help_text(group)
    for name, command in group.commands.items():
        (summary,) = re.findall(rf"^  {name} +(.*)$", text, re.MULTILINE)
        assert summary == command.get_short_help_str(limit=1000)
        assert summary.endswith("."), "the summary continues on the next line"
    assert re.findall(r"^  (\w+)  ", text, re.MULTILINE) == list(group.commands)


def test_every_command_is_in_one_group() -> None:
    assert len(NAMES) == len(set(NAMES)) <= 20
    assert max(map(len, help_text(cli).splitlines())) <= 80
    assert [line[:-1] for line in help_text(cli).splitlines() if line[:-1] in COMMANDS] == list(COMMANDS)


def test_the_help_lists_every_exit_code() -> None:
    assert len(ExitCode) == 6
    for code in ExitCode:
        assert f"{code:3}  {code.meaning}" in help_text(cli)

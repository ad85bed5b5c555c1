"""Find and execute the commands that an output suggests."""

import html
import re
import shlex
from pathlib import Path

from cranectl.cli.main import NAMES, main
from cranectl.loaders.opening import close_controllers

SUGGESTED = re.compile(rf"cranectl (?:{'|'.join(NAMES)})\b[^\n;]*")


def suggested_commands(text: str) -> list[str]:
    """Return the different commands in an output."""
    return list(dict.fromkeys(command.rstrip(" .,") for command in SUGGESTED.findall(text)))


def commands_of_page(page: Path) -> list[str]:
    """Return the different commands in the cells and the footer of a page."""
    cells = re.findall(r"<(?:td|code)[^>]*>([^<]*)<", page.read_text(encoding="utf-8"))
    return list(dict.fromkeys(text for text in map(html.unescape, cells) if SUGGESTED.fullmatch(text)))


def execute(command: str) -> int:
    """Execute a command as a shell does, with no controller opened before; return its exit code."""
    close_controllers()
    program, *arguments = shlex.split(command)
    assert program == "cranectl"
    return main(arguments)

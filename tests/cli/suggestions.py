"""Find and execute the commands that an output suggests, and find all commands in the package's texts."""

import ast
import html
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from cranectl.cli.main import NAMES, main
from cranectl.loaders.opening import close_controllers

ANY_NAME = "|".join(NAMES)
SUGGESTED = re.compile(rf"cranectl (?:{ANY_NAME})\b[^\n;]*")


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


def commands_in(package: Path) -> Iterator[tuple[str, str]]:
    """Yield each file and command that a text of the package names, outside docstrings.

    The command is only `cranectl` if the code builds a list of words that begins with it.
    """
    for path in sorted(package.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        docstrings = {
            id(node.body[0].value)
            for node in ast.walk(tree)
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            and node.body
            and isinstance(node.body[0], ast.Expr)
        }
        file = path.relative_to(package).as_posix()
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
                names = re.findall(rf"cranectl (?:{ANY_NAME})\b", node.value)
                yield from ((file, name) for name in names)
            elif isinstance(node, ast.List) and len(node.elts) > 1:
                first = node.elts[0]
                if isinstance(first, ast.Constant) and first.value == "cranectl":
                    yield file, "cranectl"

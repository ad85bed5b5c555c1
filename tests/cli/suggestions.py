"""Commands that an output suggests, and what is known of each that the package can print."""

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


def suggested(text: str) -> list[str]:
    """Commands in what was printed, each once."""
    return list(dict.fromkeys(each.rstrip(" .,") for each in SUGGESTED.findall(text)))


def suggested_by_page(page: Path) -> list[str]:
    """Commands in the cells and the footer of a page, each once."""
    found = re.findall(r"<(?:td|code)[^>]*>([^<]*)<", page.read_text(encoding="utf-8"))
    return list(dict.fromkeys(text for text in map(html.unescape, found) if SUGGESTED.fullmatch(text)))


def executed(command: str) -> int:
    """The exit code of a command as a shell would pass it, in a process that has opened nothing."""
    close_controllers()
    program, *arguments = shlex.split(command)
    assert program == "cranectl"
    return main(arguments)


def commands_in(package: Path) -> Iterator[tuple[str, str]]:
    """Files of the package with the texts in their code, docstrings apart, that name a command of ours.

    `cranectl` alone begins the list of a command's words.
    """
    for path in sorted(package.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        described = {
            id(node.body[0].value)
            for node in ast.walk(tree)
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            and node.body
            and isinstance(node.body[0], ast.Expr)
        }
        place = path.relative_to(package).as_posix()
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in described:
                yield from ((place, found) for found in re.findall(rf"cranectl (?:{ANY_NAME})\b", node.value))
            elif isinstance(node, ast.List) and len(node.elts) > 1:
                first = node.elts[0]
                if isinstance(first, ast.Constant) and first.value == "cranectl":
                    yield place, "cranectl"

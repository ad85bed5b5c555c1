"""Texts of the package that name an option of a command: what a new one must be tried with."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import click

from cranectl.cli.main import cli
from tests.remedies import HOLE, PACKAGE

NAMED = re.compile(r"(?<![\w-])--[a-z][a-z-]*[a-z]")
DECLARES = re.compile(r"option$|argument$")  # names of functions that declare an option
ERRORS = ("InputError", "LogError", "UsageError")  # whose first argument says what was found
OF_PYTEST = "--cranectl-update"


def texts_with_options(folder: Path = PACKAGE) -> set[tuple[str, str]]:
    """Return the file and the text, with holes, of each message that names an option to take."""
    ours = {*_options(iter(cli.commands.values())), OF_PYTEST}
    return {
        (path.relative_to(folder).as_posix(), text)
        for path in sorted(folder.rglob("*.py"))
        for text in _texts(ast.parse(path.read_text(encoding="utf-8")))
        if ours.intersection(NAMED.findall(text)) and NAMED.sub("", text).strip("/ ") != ""
    }


def _options(commands: Iterator[click.Command]) -> Iterator[str]:
    for command in commands:
        yield from (name for each in command.params for name in each.opts if name.startswith("--"))
        if isinstance(command, click.Group):
            yield from _options(iter(command.commands.values()))


def _texts(node: ast.AST) -> Iterator[str]:
    """Yield the texts below a node, but for docstrings, help on options and what was found or is allowed."""
    match node:
        case ast.JoinedStr(values=parts):
            yield "".join(str(each.value) if isinstance(each, ast.Constant) else HOLE for each in parts)
            return
        case ast.Constant(value=str(text)):
            yield text
            return
        case ast.Expr(value=ast.Constant()) | ast.keyword(arg="allowed"):
            return
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)) if DECLARES.search(name):
            return
    found = isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute)
    raised = getattr(node.func, "id", getattr(node.func, "attr", "")) if found else ""
    for child in ast.iter_child_nodes(node):
        if raised not in ERRORS or child is not next(iter(node.args), None):
            yield from _texts(child)

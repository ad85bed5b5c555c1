"""Collect the texts of the package that name an option, so that a test of every new one can be required."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import click

from cranectl.cli.main import cli
from tests.remedies import PACKAGE, PLACEHOLDER

OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*[a-z]")
DECLARES = re.compile(r"option$|argument$")  # names of functions that declare an option
ERRORS = ("InputError", "LogError", "UsageError")  # their first argument describes the found input
PYTEST_OPTION = "--cranectl-update"


def texts_with_options(folder: Path = PACKAGE) -> set[tuple[str, str]]:
    """Return the file and the text, with placeholders, of each message that suggests an option."""
    options = {*_options(iter(cli.commands.values())), PYTEST_OPTION}
    return {
        (path.relative_to(folder).as_posix(), text)
        for path in sorted(folder.rglob("*.py"))
        for text in _texts(ast.parse(path.read_text(encoding="utf-8")))
        if options.intersection(OPTION.findall(text)) and OPTION.sub("", text).strip("/ ") != ""
    }


def _options(commands: Iterator[click.Command]) -> Iterator[str]:
    for command in commands:
        yield from (name for option in command.params for name in option.opts if name.startswith("--"))
        if isinstance(command, click.Group):
            yield from _options(iter(command.commands.values()))


def _texts(node: ast.AST) -> Iterator[str]:
    """Yield the texts in a node, except docstrings, help on options, and the found and allowed values."""
    match node:
        case ast.JoinedStr(values=parts):
            yield "".join(
                str(part.value) if isinstance(part, ast.Constant) else PLACEHOLDER for part in parts
            )
            return
        case ast.Constant(value=str(text)):
            yield text
            return
        case ast.Expr(value=ast.Constant()) | ast.keyword(arg="allowed"):
            return
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)) if DECLARES.search(name):
            return
    is_call = isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute)
    function = getattr(node.func, "id", getattr(node.func, "attr", "")) if is_call else ""
    for child in ast.iter_child_nodes(node):
        if function not in ERRORS or child is not next(iter(node.args), None):
            yield from _texts(child)

"""Collect every remedy in the sources, and check that following a remedy works."""

import ast
import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from tests.conftest import ROOT

PLACEHOLDER = "{}"  # stands for the part of a remedy that depends on the input
Remedy = tuple[str, str]  # (file, text with placeholders)
PACKAGE = ROOT / "cranectl"


class Case(NamedTuple):
    """A remedy of a source file, input that is refused with this remedy, and input that follows it.

    Both inputs are words that are appended to a command: options, or assignments for `--set`. They replace
    the command if the first word is `cranectl`.
    """

    source: str
    remedy: str
    refused: list[str]
    remedied: list[str]


def label(case: Case) -> str:
    """Return the test id of a case."""
    return f"{case.source}: {case.remedy}"


def written(contents: Mapping[str, str | bytes]) -> Any:
    """Return an automatic fixture that writes files into an empty working directory."""

    @pytest.fixture(autouse=True)
    def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        for name, content in contents.items():
            Path(name).write_bytes(content.encode() if isinstance(content, str) else content)

    return files


def check(case: Case, base: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Assert that a command is refused with the remedy of a case, and that it runs after the remedy."""
    close_controllers()
    capsys.readouterr()
    assert main(words(base, case.refused)) == 2
    error = capsys.readouterr().err
    remedy = re.search("remedy: *(.*)", error)
    assert remedy is not None, error
    assert re.search(".*".join(map(re.escape, case.remedy.split(PLACEHOLDER))), remedy[1]), error
    close_controllers()
    assert main(words(base, case.remedied)) in (0, 1), capsys.readouterr().err


def remedy_test(cases: list[Case], base: list[str]) -> Callable[..., None]:
    """Return a test that checks each case with the command `base`."""

    @pytest.mark.parametrize("case", cases, ids=label)
    def test(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
        check(case, base, capsys)

    return test


def words(base: list[str], appended: list[str]) -> list[str]:
    """Return the words of a command: `base` with the appended words, or these alone after `cranectl`."""
    line = [*base, *appended] if appended[:1] != ["cranectl"] else appended[1:]
    pairs = (["--set", word] if re.match(r"[a-z][\w.-]*=", word) else [word] for word in line)
    return list(itertools.chain.from_iterable(pairs))


def remedies_in(folder: Path = PACKAGE) -> set[Remedy]:
    """Return every remedy in the sources below a folder."""
    trees = {path: ast.parse(path.read_text()) for path in sorted(folder.rglob("*.py"))}
    all_definitions = definitions(itertools.chain.from_iterable(tree.body for tree in trees.values()))
    return {
        (path.relative_to(folder).as_posix(), text)
        for path, tree in trees.items()
        for node in ast.walk(tree)
        for expression in _remedies_at(node)
        for text in texts(expression, {**all_definitions, **definitions(tree.body)})
        if text.strip()
    }


def without_remedy(folder: Path = PACKAGE) -> list[str]:
    """Return the source lines that create an error about the user's input without a remedy."""
    return [
        f"{path.relative_to(folder)}:{node.lineno}"
        for path in sorted(folder.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) in ("InputError", "LogError", "StepError", "MachineError", "RuleError")
        and "remedy" not in [keyword.arg for keyword in node.keywords]
    ]


def _remedies_at(node: ast.AST) -> Iterator[ast.expr]:
    """Yield the remedy in a node: an argument, a default, an item of a table or a variable."""
    if isinstance(node, ast.Call):
        yield from (keyword.value for keyword in node.keywords if keyword.arg == "remedy")
    elif isinstance(node, ast.FunctionDef):
        defaults = zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
        yield from (value for argument, value in defaults if argument.arg == "remedy" and value)
        if "(found, allowed, remedy)" in (ast.get_docstring(node) or ""):
            yield from (value.elts[2] for value in _returned(node) if isinstance(value, ast.Tuple))
    elif isinstance(node, ast.Dict):
        items = zip(node.keys, node.values, strict=True)
        yield from (value for key, value in items if isinstance(key, ast.Constant) and key.value == "remedy")
    elif isinstance(node, ast.Assign) and _is_table(node):
        yield node.value
    elif isinstance(node, ast.Assign):
        yield from _assigned_remedies(node.targets[0], node.value)
    elif isinstance(node, ast.For) and isinstance(node.iter, ast.Tuple):
        for item in node.iter.elts:
            yield from _assigned_remedies(node.target, item)


def _is_table(node: ast.Assign) -> bool:
    """Return True for a table of remedies."""
    target = node.targets[0]
    return isinstance(target, ast.Name) and target.id.endswith("REMEDIES")


def _assigned_remedies(target: ast.expr, value: ast.expr) -> Iterator[ast.expr]:
    """Yield each expression that is assigned to the name `remedy`, also within a tuple."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        for name, item in zip(target.elts, value.elts, strict=True):
            yield from _assigned_remedies(name, item)
    elif isinstance(target, ast.Name) and target.id == "remedy":
        yield value


def _returned(function: ast.FunctionDef) -> list[ast.expr]:
    nodes = ast.walk(function)
    return [node.value for node in nodes if isinstance(node, ast.Return) and node.value is not None]


def definitions(body: Iterable[ast.stmt]) -> dict[str, ast.expr | ast.FunctionDef]:
    """Return the constants and functions of modules by name; remedies are composed of them."""
    names: dict[str, ast.expr | ast.FunctionDef] = {}
    for node in body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            names[node.targets[0].id] = node.value
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value:
            names[node.target.id] = node.value
        elif isinstance(node, ast.FunctionDef):
            names[node.name] = node
    return names


def texts(expression: ast.expr, known: dict[str, ast.expr | ast.FunctionDef]) -> list[str]:
    """Return each text that an expression can evaluate to; none if its definition is unknown."""

    def of(*parts: ast.expr) -> list[str]:
        return [text for part in parts for text in texts(part, known)]

    match expression:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.JoinedStr(values=parts):
            return ["".join(str(p.value) if isinstance(p, ast.Constant) else PLACEHOLDER for p in parts)]
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return [a + b for a in of(left) or [PLACEHOLDER] for b in of(right) or [PLACEHOLDER]]
        case ast.IfExp(body=one, orelse=other):
            return of(one, other)
        case ast.BoolOp(values=choices) | ast.Dict(values=choices):
            return of(*choices)
        case ast.Name(id=name) | ast.Subscript(value=ast.Name(id=name)):
            value = known.get(name)
            return of(value) if isinstance(value, ast.expr) else []
        case ast.Call(func=ast.Attribute(value=table, attr="get"), args=[_, other]):
            return of(table, other)
        case ast.Call(func=ast.Name(id=name)):
            function = known.get(name)
            return of(*_returned(function)) if isinstance(function, ast.FunctionDef) else []
    return []

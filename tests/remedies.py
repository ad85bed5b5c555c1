"""Every remedy that the sources hold, and how a test takes one."""

import ast
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from tests.conftest import ROOT

HOLE = "{}"  # what a remedy says of the case at hand
Remedy = tuple[str, str]  # (file, text with holes)
PACKAGE = ROOT / "cranectl"


class Case(NamedTuple):
    """A remedy of a source file, what is refused with it, and the same as the remedy would have it.

    Both are words that are added to a command: options, or assignments for `--set`. They are a command of
    their own where the first word is `cranectl`.
    """

    source: str
    remedy: str
    refused: list[str]
    taken: list[str]


def label(case: Case) -> str:
    """Return what a test of a case is called."""
    return f"{case.source}: {case.remedy}"


def written(contents: Mapping[str, str | bytes]) -> Any:
    """Return a fixture that writes files into an empty working directory, for every test of a module."""

    @pytest.fixture(autouse=True)
    def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        for name, content in contents.items():
            Path(name).write_bytes(content.encode() if isinstance(content, str) else content)

    return files


def check(case: Case, base: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Assert that a command is refused with the remedy of a case, and that it runs when that is taken."""
    close_controllers()
    capsys.readouterr()
    assert main(words(base, case.refused)) == 2
    error = capsys.readouterr().err
    told = re.search("remedy: *(.*)", error)
    assert told is not None, error
    assert re.search(".*".join(map(re.escape, case.remedy.split(HOLE))), told[1]), error
    close_controllers()
    assert main(words(base, case.taken)) in (0, 1), capsys.readouterr().err


def words(base: list[str], added: list[str]) -> list[str]:
    """Return a command with what is added to it."""
    whole = [*base, *added] if added[:1] != ["cranectl"] else added[1:]
    pairs = (["--set", word] if re.match(r"[a-z][\w.-]*=", word) else [word] for word in whole)
    return list(itertools.chain.from_iterable(pairs))


def remedies_in(folder: Path = PACKAGE) -> set[Remedy]:
    """Return every remedy that the sources below a folder build."""
    trees = {path: ast.parse(path.read_text()) for path in sorted(folder.rglob("*.py"))}
    everywhere = definitions(itertools.chain.from_iterable(tree.body for tree in trees.values()))
    return {
        (path.relative_to(folder).as_posix(), text)
        for path, tree in trees.items()
        for node in ast.walk(tree)
        for expression in _remedies_at(node)
        for text in texts(expression, {**everywhere, **definitions(tree.body)})
        if text.strip()
    }


def without_remedy(folder: Path = PACKAGE) -> list[str]:
    """Return the places that make an error of the user's and give it no remedy."""
    return [
        f"{path.relative_to(folder)}:{node.lineno}"
        for path in sorted(folder.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) in ("InputError", "LogError", "StepError", "MachineError", "RuleError")
        and "remedy" not in [keyword.arg for keyword in node.keywords]
    ]


def _remedies_at(node: ast.AST) -> Iterator[ast.expr]:
    """Yield the remedy that a node gives: as an argument, a default, an item of a table or a variable."""
    if isinstance(node, ast.Call):
        yield from (each.value for each in node.keywords if each.arg == "remedy")
    elif isinstance(node, ast.FunctionDef):
        given = zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
        yield from (value for each, value in given if each.arg == "remedy" and value)
        if "(found, allowed, remedy)" in (ast.get_docstring(node) or ""):
            yield from (each.elts[2] for each in _returned(node) if isinstance(each, ast.Tuple))
    elif isinstance(node, ast.Dict):
        items = zip(node.keys, node.values, strict=True)
        yield from (value for key, value in items if isinstance(key, ast.Constant) and key.value == "remedy")
    elif isinstance(node, ast.Assign) and _is_table(node):
        yield node.value
    elif isinstance(node, ast.Assign):
        yield from _matching(node.targets[0], node.value)
    elif isinstance(node, ast.For) and isinstance(node.iter, ast.Tuple):
        yield from itertools.chain.from_iterable(_matching(node.target, each) for each in node.iter.elts)


def _is_table(node: ast.Assign) -> bool:
    """Return True for a table of remedies."""
    target = node.targets[0]
    return isinstance(target, ast.Name) and target.id.endswith("REMEDIES")


def _matching(target: ast.expr, value: ast.expr) -> Iterator[ast.expr]:
    """Yield what a target called `remedy` is given, also within a tuple."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        for each, given in zip(target.elts, value.elts, strict=True):
            yield from _matching(each, given)
    elif isinstance(target, ast.Name) and target.id == "remedy":
        yield value


def _returned(function: ast.FunctionDef) -> list[ast.expr]:
    nodes = ast.walk(function)
    return [node.value for node in nodes if isinstance(node, ast.Return) and node.value is not None]


def definitions(body: Iterable[ast.stmt]) -> dict[str, ast.expr | ast.FunctionDef]:
    """Return the constants and functions of modules by name, from which remedies are put together."""
    found: dict[str, ast.expr | ast.FunctionDef] = {}
    for node in body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            found[node.targets[0].id] = node.value
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value:
            found[node.target.id] = node.value
        elif isinstance(node, ast.FunctionDef):
            found[node.name] = node
    return found


def texts(expression: ast.expr, known: dict[str, ast.expr | ast.FunctionDef]) -> list[str]:
    """Return each text that an expression can be; none where another place gives it."""

    def of(*parts: ast.expr) -> list[str]:
        return [text for part in parts for text in texts(part, known)]

    match expression:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.JoinedStr(values=parts):
            return ["".join(str(p.value) if isinstance(p, ast.Constant) else HOLE for p in parts)]
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return [a + b for a in of(left) or [HOLE] for b in of(right) or [HOLE]]
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

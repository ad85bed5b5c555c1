"""Collect every remedy in the sources, and check that following a remedy works."""

import ast
import contextlib
import itertools
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from tests.syntax import PACKAGE, trees_in

PLACEHOLDER = "{}"  # stands for the part of a remedy that depends on the input
Remedy = tuple[str, str]  # (file, text with placeholders)


Words = (
    str | list[str]
)  # words of a command: assignments, which `--set` gets, and texts that are split at spaces


class Case:
    """A remedy, input that is refused with it, and inputs that follow it.

    Inputs are appended to a command. They replace it if they begin with `cranectl`.
    """

    def __init__(self, remedy: str, refused: Words, *remedied: Words) -> None:
        self.remedy, self.refused, self.remedied = remedy, refused, remedied


Cases = dict[str, list[Case]]  # by source file


def written(contents: Mapping[str, str | bytes]) -> Any:
    """Return an automatic fixture that writes files into an empty working directory."""

    @pytest.fixture(autouse=True)
    def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        write(contents)

    return files


def prepared(
    contents: Mapping[str, str | bytes], commands: Iterable[str], then: Callable[[], object] = dict
) -> Any:
    """Return the fixture `prepared_files` of a module: a folder with files and what commands write there."""

    @pytest.fixture(scope="module")
    def prepared_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("files")
        with contextlib.chdir(folder):
            write(contents)
            for command in commands:
                assert main(command.split()) == 0, command
            then()
        return folder

    return prepared_files


def write(contents: Mapping[str, str | bytes]) -> None:
    """Write files into the working directory."""
    for name, content in contents.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_bytes(content.encode() if isinstance(content, str) else content)


def check(case: Case, base: str, capsys: pytest.CaptureFixture[str], worked: set[str] | None = None) -> None:
    """Assert that a command is refused with the remedy of a case, and that it runs after the remedy.

    What follows several remedies alike is run once: `worked` has the commands that ran with the same files.
    """
    close_controllers()
    capsys.readouterr()
    assert main(words(base, case.refused)) == 2
    error = capsys.readouterr().err
    remedy = re.search("remedy: *(.*)", error)
    assert remedy is not None, error
    assert re.search(".*".join(map(re.escape, case.remedy.split(PLACEHOLDER))), remedy[1]), error
    worked = set() if worked is None else worked
    for line in (words(base, remedied) for remedied in case.remedied):
        if shlex.join(line) not in worked:
            close_controllers()
            assert main(line) in (0, 1), (line, capsys.readouterr().err)
            worked.add(shlex.join(line))


def remedy_test(cases: Cases, base: str) -> Callable[..., None]:
    """Return a test that checks each case with the command `base`."""
    parameters = [(case, f"{source}: {case.remedy}") for source in cases for case in cases[source]]
    worked: set[str] = set()

    @pytest.mark.parametrize("case", [case for case, _ in parameters], ids=[label for _, label in parameters])
    def test(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
        check(case, base, capsys, worked)

    return test


def words(base: str, appended: Words) -> list[str]:
    """Return the words of a command: `base` with the appended words, or these alone after `cranectl`."""
    line = [base, appended] if isinstance(appended, str) else [base, *appended]
    if line[1].startswith("cranectl "):
        line = [line[1].removeprefix("cranectl "), *line[2:]]
    pairs = (["--set", text] if re.match(r"[a-z][\w.-]*=", text) else text.split() for text in line)
    return list(itertools.chain.from_iterable(pairs))


def remedies_in(folder: Path = PACKAGE) -> set[Remedy]:
    """Return every remedy in the sources below a folder."""
    trees = trees_in(folder)
    all_definitions = definitions(itertools.chain.from_iterable(tree.body for tree in trees.values()))
    found: set[Remedy] = set()
    for path, tree in trees.items():
        known = {**all_definitions, **definitions(tree.body)}
        expressions = itertools.chain.from_iterable(map(_remedies_at, ast.walk(tree)))
        own = {text for expression in expressions for text in texts(expression, known) if text.strip()}
        found |= {(path.relative_to(folder).as_posix(), text) for text in own}
    return found


def without_remedy(folder: Path = PACKAGE) -> list[str]:
    """Return the source lines that create an error about the user's input without a remedy."""
    return [
        f"{path.relative_to(folder)}:{node.lineno}"
        for path, tree in trees_in(folder).items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in ("InputError", "LogError", "StepError", "MachineError", "RuleError")
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
        elif isinstance(node, ast.ClassDef):
            members = definitions(node.body)
            names |= {f"{node.name}.{name}": member for name, member in members.items()}
            names |= members if node.name == "InputError" else {}
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
        case ast.Call(
            func=ast.Name(id=name) | ast.Attribute(value=ast.Name(id="cls" | "InputError"), attr=name)
        ):
            function = known.get(name)
            return of(*_returned(function)) if isinstance(function, ast.FunctionDef) else []
        case ast.Call(func=ast.Attribute(value=ast.Name(id=owner), attr=name)):
            function = known.get(f"{owner}.{name}")
            return of(*_returned(function)) if isinstance(function, ast.FunctionDef) else []
    return []

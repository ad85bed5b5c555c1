"""How code is shaped: few positional arguments, little nesting."""

import ast
from collections.abc import Iterator

import pytest

from tests.conftest import ROOT

MAX_POSITIONAL = 5  # of a function, without `self`
MAX_OF_KERNEL = 10  # arguments of a compiled function
MAX_NESTING = 3
NESTS = (ast.For, ast.While, ast.If, ast.With, ast.Try)
COMPILERS = ("jit", "cfunc", "overload", "intrinsic")


def trees() -> dict[str, ast.Module]:
    root = ROOT / "cranectl"
    return {str(p.relative_to(root)): ast.parse(p.read_text()) for p in sorted(root.rglob("*.py"))}


def compiled_by_call(modules: dict[str, ast.Module]) -> set[str]:
    """Names of functions that are given to a compiler: `jit(step)`."""
    calls = [n for tree in modules.values() for n in ast.walk(tree) if isinstance(n, ast.Call)]
    given = [call.args for call in calls if any(each in ast.unparse(call.func) for each in COMPILERS)]
    return {each.id for arguments in given for each in arguments if isinstance(each, ast.Name)}


def nesting(node: ast.AST) -> int:
    """How deep blocks are in a function or block; an `elif` is as deep as its `if`."""
    deepest = 0
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        children = getattr(node, field, [])
        is_elif = field == "orelse" and isinstance(node, ast.If) and len(children) == 1
        for child in children:
            if not isinstance(child, ast.FunctionDef | ast.ClassDef):
                own = isinstance(child, NESTS) and not (is_elif and isinstance(child, ast.If))
                deepest = max(deepest, own + nesting(child))
    return deepest


def misshapen(modules: dict[str, ast.Module]) -> Iterator[str]:
    compiled = compiled_by_call(modules)
    functions = [
        (p, n) for p, tree in modules.items() for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)
    ]
    for place, function in functions:
        decorators = " ".join(map(ast.unparse, function.decorator_list))
        arguments = function.args.posonlyargs + function.args.args
        positional = [each for each in arguments if each.arg not in ("self", "cls")]
        name = f"{place}: {function.name}"
        if function.name in compiled or any(each in decorators for each in COMPILERS):
            if len(arguments + function.args.kwonlyargs) > MAX_OF_KERNEL:
                yield f"{name} takes {len(arguments)} arguments"
        elif "command" not in decorators:
            if len(positional) > MAX_POSITIONAL:
                yield f"{name} takes {len(positional)} positional arguments"
            if nesting(function) > MAX_NESTING:
                yield f"{name} nests {nesting(function)} deep"


def test_functions_take_few_positional_arguments_and_nest_little() -> None:
    """Kernels may nest: they loop over rows and columns."""
    assert list(misshapen(trees())) == []


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("def f(a, b, c, d, e, g): ...", "takes 6 positional"),
        ("class A:\n def f(self, a, b, c, d, e, g): ...", "takes 6 positional"),
        ("@jit\ndef f(a, b, c, d, e, g, h, i, j, k, l): ...", "takes 11 arguments"),
        ("def f(a, b, c, d, e, g, h, i, j, k, l): ...\njit(f)", "takes 11 arguments"),
        ("def f():\n for a in b:\n  with c:\n   try: ...\n   finally:\n    if d: ...", "nests 4 deep"),
        ("def f():\n if a:\n  if b:\n   while c:\n    if d: ...", "nests 4 deep"),
    ],
)
def test_a_misshapen_function_is_noticed(code: str, reason: str) -> None:
    (found,) = misshapen({"module.py": ast.parse(code)})
    assert reason in found


@pytest.mark.parametrize(
    "code",
    [
        "def f(a, b, c, d, e, *, g): ...",
        "@jit\ndef f(a, b, c, d, e, g, h, i, j, k): ...",
        "@click.command\ndef f(a, b, c, d, e, g): ...",
        "def f():\n if a: ...\n elif b: ...\n elif c:\n  if d:\n   if e: ...",
    ],
)
def test_what_is_allowed_is_not_noticed(code: str) -> None:
    assert list(misshapen({"module.py": ast.parse(code)})) == []

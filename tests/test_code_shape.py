"""The shape of functions: few positional arguments and little nesting."""

import ast
from collections.abc import Iterator

import pytest

from tests.syntax import PACKAGE, trees_in

MAX_POSITIONAL = 5  # of a function, without `self`
MAX_KERNEL_ARGUMENTS = 10  # of a compiled function
MAX_NESTING = 3
NESTS = (ast.For, ast.While, ast.If, ast.With, ast.Try)
COMPILERS = ("jit", "cfunc", "overload", "intrinsic", "Specialised")


def trees() -> dict[str, ast.Module]:
    return {str(path.relative_to(PACKAGE)): tree for path, tree in trees_in().items()}


def compiled_by_call(modules: dict[str, ast.Module]) -> set[str]:
    """Return the names of functions that are passed to a compiler: `jit(step)`."""
    calls = [n for tree in modules.values() for n in ast.walk(tree) if isinstance(n, ast.Call)]
    passed = [(call, arg.id) for call in calls for arg in call.args if isinstance(arg, ast.Name)]
    return {name for call, name in passed if any(each in ast.unparse(call.func) for each in COMPILERS)}


def nesting(node: ast.AST) -> int:
    """Return the depth of nested blocks in a function or block; an `elif` is as deep as its `if`."""
    deepest = 0
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        children = getattr(node, field, [])
        is_elif = field == "orelse" and isinstance(node, ast.If) and len(children) == 1
        for child in children:
            if not isinstance(child, ast.FunctionDef | ast.ClassDef):
                own = isinstance(child, NESTS) and not (is_elif and isinstance(child, ast.If))
                deepest = max(deepest, own + nesting(child))
    return deepest


def shape_violations(modules: dict[str, ast.Module]) -> Iterator[str]:
    compiled = compiled_by_call(modules)
    functions = [
        (p, n) for p, tree in modules.items() for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)
    ]
    for path, function in functions:
        decorators = " ".join(map(ast.unparse, function.decorator_list))
        arguments = function.args.posonlyargs + function.args.args
        positional = [argument for argument in arguments if argument.arg not in ("self", "cls")]
        name = f"{path}: {function.name}"
        if function.name in compiled or any(compiler in decorators for compiler in COMPILERS):
            if len(arguments + function.args.kwonlyargs) > MAX_KERNEL_ARGUMENTS:
                yield f"{name} takes {len(arguments)} arguments"
        elif "command" not in decorators:
            if len(positional) > MAX_POSITIONAL:
                yield f"{name} takes {len(positional)} positional arguments"
            if nesting(function) > MAX_NESTING:
                yield f"{name} nests {nesting(function)} deep"


def test_functions_have_few_positional_arguments_and_little_nesting() -> None:
    """Compiled functions may nest more, because they loop over rows and columns."""
    assert list(shape_violations(trees())) == []


# Code, and the violation that is found in it.
SHAPES = {
    "def f(a, b, c, d, e, g): ...": "f takes 6 positional arguments",
    "class A:\n def f(self, a, b, c, d, e, g): ...": "f takes 6 positional arguments",
    "@jit\ndef f(a, b, c, d, e, g, h, i, j, k, l): ...": "f takes 11 arguments",
    "def f(a, b, c, d, e, g, h, i, j, k, l): ...\njit(f)": "f takes 11 arguments",
    "def f():\n for a in b:\n  with c:\n   try: ...\n   finally:\n    if d: ...": "f nests 4 deep",
    "def f():\n if a:\n  if b:\n   while c:\n    if d: ...": "f nests 4 deep",
    "def f(a, b, c, d, e, *, g): ...": "",
    "@jit\ndef f(a, b, c, d, e, g, h, i, j, k): ...": "",
    "@click.command\ndef f(a, b, c, d, e, g): ...": "",
    "def f():\n if a: ...\n elif b: ...\n elif c:\n  if d:\n   if e: ...": "",
}


@pytest.mark.parametrize(("code", "found"), SHAPES.items())
def test_violations_are_detected_and_allowed_shapes_accepted(code: str, found: str) -> None:
    violations = [f"module.py: {found}"] if found else []
    assert list(shape_violations({"module.py": ast.parse(code)})) == violations

"""What of the limits of planned motions is mutated by `mutations`: there numbers come in lists."""

import ast
from collections.abc import Iterator
from typing import Any

import numpy as np

LIMITED = {
    "cranectl.planning.limits": """
        limits_of share_of motion constraints excesses clearance clear_of _symmetric
    """,
    "cranectl.reference.series": """
        from_derivatives differentiated shifted plus times over root square_root turned _dot
    """,
}
INDEX = "next index"
# What they are given is a term.
_RECORDS = ("Limits", "Motion", "Constraint", "_symmetric")
# No terms: types, records, words, places, choices between limits; 1 % more than infinite is infinite.
_NOT_A_TERM = (
    "list[", "Sequence[", "Limits(", "Motion(", "Constraint(", "_symmetric(", "tuple((Box", "side[", "0 if ",
    "effects.sensing or", "scenario.rig", "scenario.effects", "{", "-np.inf",
)  # fmt: skip
_NO_NUMBERS = (
    "coefficients",
    "constraint",
    "by_name",
    "name",
    "quotient",
    "result",
    "planning",
    "rig",
    "scenario.planning",
)


def is_number(node: ast.expr) -> bool:
    """Return True for a number, and for a tuple or list of numbers."""
    text = ast.unparse(node)
    return not text.startswith(_NOT_A_TERM) and text not in _NO_NUMBERS


def listed_terms(tree: ast.AST) -> Iterator[ast.expr]:
    """Yield the terms of `mutations.terms`, arguments of records, and indexed values."""
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.AnnAssign | ast.Assign | ast.AugAssign | ast.Return)
            and node.value is not None
        ):
            yield from _listed(node.value)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            yield from (node.left, node.right)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in _RECORDS:
            for value in (*node.args, *(keyword.value for keyword in node.keywords)):
                yield from _listed(value)
        elif is_indexed(node):
            yield node


def _listed(value: ast.expr) -> Iterator[ast.expr]:
    """Yield the expressions in a value: elements of lists, tuples, arrays and comprehensions."""
    if isinstance(value, ast.Tuple | ast.List):
        for element in value.elts:
            yield from _listed(element)
    elif isinstance(value, ast.Call) and value.args and isinstance(value.args[0], ast.List):
        yield from _listed(value.args[0])
    elif isinstance(value, ast.ListComp | ast.GeneratorExp):
        yield from _listed(value.elt)
    elif isinstance(value, ast.Starred):
        yield from _listed(value.value)
    elif not isinstance(value, ast.JoinedStr) and (
        not isinstance(value, ast.Constant) or isinstance(value.value, float)
    ):
        yield value


def is_indexed(node: ast.AST) -> bool:
    """Return True if a node is an element of something, by one index."""
    return (
        isinstance(node, ast.Subscript)
        and isinstance(node.ctx, ast.Load)
        and (isinstance(node.slice, ast.Name) or _whole(node.slice))
    )


def _whole(index: ast.expr) -> bool:
    return isinstance(index, ast.Constant) and isinstance(index.value, int)


def scaled(value: Any, factor: float) -> Any:
    """Scale a number, or all numbers in lists."""
    if isinstance(value, list | tuple):
        return type(value)(scaled(each, factor) for each in value)
    return factor * value


def moved_on(values: Any) -> Any:
    """Shift all values by one place; the last gets the first."""
    return np.roll(values, -1, axis=0) if isinstance(values, np.ndarray) else [*values[1:], values[0]]


NUMBERS = {"scaled": scaled, "moved_on": moved_on}  # as mutants call them

"""Find the terms of the limits of planned motions that `mutations.py` changes; many are in lists."""

import ast
from collections.abc import Iterator
from typing import Any

import numpy as np

LIMIT_TARGETS = {  # functions by module
    "cranectl.planning.limits": """
        limits_of share_of motion constraints excesses clearance side_distances _symmetric
    """,
    "cranectl.reference.series": """
        Series.from_derivatives Series.derivative Series.__add__ Series.__sub__ Series.__rsub__
        Series.__mul__ Series.__truediv__ Series.sqrt Series.cos_sin square_root _dot
    """,
}
INDEX = "next index"  # name of the operation
# The arguments of these calls are terms.
_TERM_CALLS = ("Limits", "Motion", "Constraint", "_symmetric")
# Expressions that begin so are no terms: types, records, names, choices between limits, infinite numbers.
_NO_TERM_PREFIXES = (
    "list[", "Sequence[", "Limits(", "Motion(", "Constraint(", "_symmetric(", "tuple((Box", "side[", "0 if ",
    "effects.sensing or", "scenario.rig", "scenario.effects", "{", "-np.inf",
)  # fmt: skip
_NO_TERMS = (
    "coefficients", "constraint", "by_name", "name", "quotient", "result", "planning", "rig", "Series()",
    "scenario.planning",
)  # fmt: skip


def is_number(node: ast.expr) -> bool:
    """Return True if an expression is a number, or a tuple or list of numbers."""
    text = ast.unparse(node)
    return not text.startswith(_NO_TERM_PREFIXES) and text not in _NO_TERMS


def listed_terms(tree: ast.AST) -> Iterator[ast.expr]:
    """Yield the same terms as `mutations.terms`, also in lists, arguments of records, and indexed values."""
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.AnnAssign | ast.Assign | ast.AugAssign | ast.Return)
            and node.value is not None
        ):
            yield from _listed(node.value)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            yield from (node.left, node.right)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in _TERM_CALLS:
            for value in (*node.args, *(keyword.value for keyword in node.keywords)):
                yield from _listed(value)
        elif is_indexed(node):
            yield node


def _listed(value: ast.expr) -> Iterator[ast.expr]:
    """Yield the elements of lists, tuples, arrays and comprehensions, or the value itself."""
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
    """Return True if a node is an element with one index."""
    return (
        isinstance(node, ast.Subscript)
        and isinstance(node.ctx, ast.Load)
        and (isinstance(node.slice, ast.Name) or _is_integer(node.slice))
    )


def _is_integer(index: ast.expr) -> bool:
    return isinstance(index, ast.Constant) and isinstance(index.value, int)


def scale(value: Any, factor: float) -> Any:
    """Scale a number, or all numbers in nested lists."""
    if isinstance(value, list | tuple):
        return type(value)(scale(item, factor) for item in value)
    return factor * value


def shift(values: Any) -> Any:
    """Shift all values by one index; the last element becomes the first value."""
    return np.roll(values, -1, axis=0) if isinstance(values, np.ndarray) else [*values[1:], values[0]]


HELPERS = {"scale": scale, "shift": shift}  # functions that mutants call, by name

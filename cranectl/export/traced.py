"""Numbers that remember how they were computed, as C text."""

from collections.abc import Callable
from operator import add, mul, neg, sub, truediv
from typing import Any

Operator = Callable[[Any, Any], Any]


class Traced:
    """A number, and the C expression that computes it in the same order with the same rounding.

    It takes part in sums, products and quotients. Anything else, such as its sine, raises TypeError: it is no
    float for Python.
    """

    __array_ufunc__ = None  # NumPy's numbers leave arithmetic with it to this class

    def __init__(self, value: float, text: str) -> None:
        """Make a number of a value and a C expression, which is in parentheses if it needs them."""
        self.value, self.text = value, text

    def __bool__(self) -> bool:
        return bool(self.value)

    def __neg__(self) -> "Traced":
        return Traced(neg(self.value), f"(-{self.text})")


def _forward(operator: Operator, sign: str) -> Callable[[Traced, Any], Traced]:
    """Return the method of an operator with the traced number on the left."""

    def method(self: Traced, other: Any) -> Traced:
        value, text = _parts(other)
        return Traced(operator(self.value, value), f"({self.text} {sign} {text})")

    return method


def _reflected(operator: Operator, sign: str) -> Callable[[Traced, Any], Traced]:
    """Return the method of an operator with the traced number on the right."""

    def method(self: Traced, other: Any) -> Traced:
        value, text = _parts(other)
        return Traced(operator(value, self.value), f"({text} {sign} {self.text})")

    return method


def _parts(other: Any) -> tuple[float, str]:
    """Return value and C text of an operand."""
    return (other.value, other.text) if isinstance(other, Traced) else (float(other), float(other).hex())


for _name, _operator, _sign in (
    ("add", add, "+"),
    ("sub", sub, "-"),
    ("mul", mul, "*"),
    ("truediv", truediv, "/"),
):
    setattr(Traced, f"__{_name}__", _forward(_operator, _sign))
    setattr(Traced, f"__r{_name}__", _reflected(_operator, _sign))

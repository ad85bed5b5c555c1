"""Numbers that remember how they were computed, as C text."""

from collections.abc import Callable
from operator import add, mul, neg, sub, truediv
from typing import Any


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


def _method(operator: Callable[[Any, Any], Any], sign: str, *, is_reflected: bool) -> Callable[..., Traced]:
    """Return the method of an operator; it is reflected if the number itself is the right operand."""

    def method(self: Traced, other: Any) -> Traced:
        if not isinstance(other, Traced):
            other = Traced(float(other), float(other).hex())
        left, right = (other, self) if is_reflected else (self, other)
        return Traced(operator(left.value, right.value), f"({left.text} {sign} {right.text})")

    return method


for _operator, _sign in ((add, "+"), (sub, "-"), (mul, "*"), (truediv, "/")):
    setattr(Traced, f"__{_operator.__name__}__", _method(_operator, _sign, is_reflected=False))
    setattr(Traced, f"__r{_operator.__name__}__", _method(_operator, _sign, is_reflected=True))

"""C text of expressions, and what is known of their values."""

import math
from collections.abc import Callable
from decimal import Decimal
from typing import Any, NamedTuple

from cranectl.tools.export.inference import Type

ATOM, UNARY, PRODUCT, SUM, ORDER, EQUALITY, AND, OR, CHOICE = range(15, 6, -1)  # ranks of C's operators


class Value(NamedTuple):
    """C text of an expression, and what is known of it."""

    text: str
    type: Type
    rank: int = ATOM  # of its outermost operator
    constant: Any = None  # its number, if known
    is_natural: bool = False  # whether it is an integer that is certainly not negative
    length: "Callable[[], Value] | None" = None  # of an array; to ask notes that the length is needed
    bases: frozenset[str] | None = frozenset()  # of an array: names of arrays it is a part of
    columns: int = 0  # of a matrix
    end: str = ""  # of a slice, in Python

    def within(self, rank: int) -> str:
        """Return the text for an operand of an operator with `rank`, in parentheses if needed."""
        return self.text if self.rank >= rank else f"({self.text})"


class Facts:
    """What a function does with its variables; a translation is repeated until it finds no new fact."""

    def __init__(self, signed: set[str]) -> None:
        self.sized: set[str] = set()  # arrays whose lengths are needed
        self.written: set[str] = set()  # arrays that are written to
        self.signed = signed  # integers that may be negative
        self.bases: dict[str, frozenset[str]] = {}
        self.columns: dict[str, int] = {}
        self.lengths: dict[str, int] = {}  # of arrays, if known

    def count(self) -> int:
        """Return the number of facts."""
        return sum(map(len, (self.sized, self.written, self.signed, self.lengths, *self.bases.values())))


def literal(value: float) -> tuple[str, bool]:
    """Return C text of a number, and whether it is an exact decimal; other numbers are hexadecimal."""
    if math.isnan(value):
        return "NAN", True
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY", True
    text = repr(value)
    if Decimal(text) == Decimal(value):
        return text, True
    mantissa, exponent = value.hex().split("p")
    return f"{mantissa.rstrip('0').rstrip('.')}p{exponent}", False

"""Intervals over arrays, rounded outwards: what an expression gives for any point of its operands'.

+, -, *, / and the square root of IEEE 754 are rounded to nearest, so the number next to it on the
outer side bounds the exact result.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.reference.geometry import expand_about, gathered, padded, select_between, shifted_powers
from cranectl.reference.series import Series
from cranectl.support.arrays import Array

LIBRARY_ERROR = 1e-15  # of a cosine, and of the sum that it is in: four times what NumPy's are off at most


@dataclass(frozen=True, slots=True)
class Interval:
    """All numbers from `low` to `high`, elementwise."""

    low: Array
    high: Array

    def __getitem__(self, index: Any) -> "Interval":
        return Interval(self.low[index], self.high[index])

    def __add__(self, other: "Operand") -> "Interval":
        other = interval(other)
        return _outwards(self.low + other.low, self.high + other.high)

    __radd__ = __add__

    def __neg__(self) -> "Interval":
        return Interval(-self.high, -self.low)

    def __sub__(self, other: "Operand") -> "Interval":
        return self + -interval(other)

    def __rsub__(self, other: "Operand") -> "Interval":
        return -self + other

    def __mul__(self, other: "Operand") -> "Interval":
        if isinstance(other, Interval):
            a, b = self.low * other.low, self.low * other.high
            c, d = self.high * other.low, self.high * other.high
            low, high = np.minimum(a, b), np.maximum(a, b)
            return _outwards(np.minimum(low, np.minimum(c, d)), np.maximum(high, np.maximum(c, d)))
        low, high = self.low * other, self.high * other
        return _outwards(np.minimum(low, high), np.maximum(low, high))

    __rmul__ = __mul__

    def __truediv__(self, other: "Operand") -> "Interval":
        """Everything where the divisor's interval holds zero."""
        other = interval(other)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            inverse = _outwards(1.0 / other.high, 1.0 / other.low)
        whole = (other.low <= 0.0) & (other.high >= 0.0)
        inverse = Interval(np.where(whole, -np.inf, inverse.low), np.where(whole, np.inf, inverse.high))
        with np.errstate(invalid="ignore", over="ignore"):
            return _whole_for_nan(self * inverse)

    def sqrt(self) -> "Interval":
        """Of what in it is not negative."""
        low, high = np.sqrt(np.maximum(self.low, 0.0)), np.sqrt(np.maximum(self.high, 0.0))
        return Interval(np.maximum(np.nextafter(low, -np.inf), 0.0), np.nextafter(high, np.inf))

    def cos(self) -> "Interval":
        """Of angles far below 1e15: its middle and at most as far from it as the angle."""
        return self._turned(np.cos)

    def sin(self) -> "Interval":
        """As `cos`."""
        return self._turned(np.sin)

    def _turned(self, function: np.ufunc) -> "Interval":
        middle = 0.5 * (self.low + self.high)
        reach = np.nextafter(np.maximum(self.high - middle, middle - self.low), np.inf) + LIBRARY_ERROR
        value = function(middle)
        return Interval(
            np.maximum(value - reach, -1.0 - LIBRARY_ERROR), np.minimum(value + reach, 1.0 + LIBRARY_ERROR)
        )

    def meet(self, other: "Interval") -> "Interval":
        """What both hold."""
        return Interval(np.maximum(self.low, other.low), np.minimum(self.high, other.high))


Operand = Interval | Array | float


def interval(number: Operand) -> Interval:
    """A number as the interval of itself."""
    if isinstance(number, Interval):
        return number
    exact = np.asarray(number, dtype=np.float64)
    return Interval(exact, exact)


def stacked(numbers: Sequence[Interval], axis: int) -> Interval:
    """As `numpy.stack`."""
    return Interval(np.stack([n.low for n in numbers], axis), np.stack([n.high for n in numbers], axis))


def _outwards(low: Array, high: Array) -> Interval:
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def _whole_for_nan(number: Interval) -> Interval:
    return Interval(
        np.where(np.isnan(number.low), -np.inf, number.low),
        np.where(np.isnan(number.high), np.inf, number.high),
    )


@expand_about.register
def _(s: Interval, coefficients: Array, count: int) -> list[Series]:
    """About the middle, and from there as far as the interval: what is far away cancels."""
    s = s[:, None]
    middle = 0.5 * (s.low + s.high)
    about, step = shifted_powers(list(coefficients), Interval(middle, middle) - 0.5), s - middle
    found = []
    for k in range(min(count, len(about))):
        value = about[-1] * float(comb(len(about) - 1, k))
        for j in range(len(about) - 2, k - 1, -1):
            value = value * step + about[j] * float(comb(j, k))
        found.append(value)
    return [[each[:, axis] for each in padded(found, count)] for axis in range(3)]


@select_between.register
def _(s: Interval, low: float, high: float) -> tuple[NDArray[np.intp], Interval]:
    where = np.flatnonzero((s.low <= high) & (s.high >= low))
    return where, s[where].meet(Interval(np.array(low), np.array(high)))


@gathered.register
def _(like: Interval, found: list[tuple[NDArray[np.intp], Interval]]) -> Interval:
    """Of a point on several pieces the hull."""
    low, high = np.full(len(like.low), np.inf), np.full(len(like.low), -np.inf)
    for where, part in found:
        low[where] = np.minimum(low[where], part.low)
        high[where] = np.maximum(high[where], part.high)
    return Interval(low, high)

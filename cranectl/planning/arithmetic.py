"""Two kinds of numbers over arrays: intervals, rounded outwards, and numbers that carry their gradient.

The interval of an expression contains its values for all points of its operands. IEEE 754 rounds +, -, *, /
and the square root to nearest, so the next floating-point number outwards bounds the exact result. Gradients
come from forward differentiation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.reference import Series
from cranectl.support import Array

LIBRARY_ERROR = 1e-15  # of NumPy's sine and cosine and a sum with them: four times the largest error


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
        """Return the quotients, which are all real numbers where the divisor contains zero."""
        other = interval(other)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            inverse = _outwards(1.0 / other.high, 1.0 / other.low)
        has_zero = (other.low <= 0.0) & (other.high >= 0.0)
        inverse = Interval(np.where(has_zero, -np.inf, inverse.low), np.where(has_zero, np.inf, inverse.high))
        with np.errstate(invalid="ignore", over="ignore"):
            return unbound_nan(self * inverse)

    def sqrt(self) -> "Interval":
        """Return the square roots of the numbers that are not negative."""
        low, high = np.sqrt(np.maximum(self.low, 0.0)), np.sqrt(np.maximum(self.high, 0.0))
        return Interval(np.maximum(np.nextafter(low, -np.inf), 0.0), np.nextafter(high, np.inf))

    def cos(self) -> "Interval":
        """Enclose the cosines of angles far below 1e15, which differ by no more than the angles do."""
        return self._enclose_wave(np.cos)

    def sin(self) -> "Interval":
        """Enclose the sines, as `cos` does."""
        return self._enclose_wave(np.sin)

    def _enclose_wave(self, function: np.ufunc) -> "Interval":
        middle = 0.5 * (self.low + self.high)
        radius = np.nextafter(np.maximum(self.high - middle, middle - self.low), np.inf) + LIBRARY_ERROR
        value = function(middle)
        return Interval(
            np.maximum(value - radius, -1.0 - LIBRARY_ERROR), np.minimum(value + radius, 1.0 + LIBRARY_ERROR)
        )

    def intersect(self, other: "Interval") -> "Interval":
        """Return the numbers that both intervals contain."""
        return Interval(np.maximum(self.low, other.low), np.minimum(self.high, other.high))

    def expand_about(self, coefficients: Array, count: int) -> list[Series]:
        """Expand about the middle, then about all of the interval, so that large terms cancel."""
        s = self[:, None]
        middle = 0.5 * (s.low + s.high)
        about, step = Series.about(Interval(middle, middle) - 0.5, list(coefficients)), s - middle
        expanded = Series()
        for k in range(min(count, len(about))):
            value = about[-1] * float(comb(len(about) - 1, k))
            for j in range(len(about) - 2, k - 1, -1):
                value = value * step + about[j] * float(comb(j, k))
            expanded.append(value)
        return [Series(coefficient[:, axis] for coefficient in expanded.padded(count)) for axis in range(3)]

    def select_between(self, low: float, high: float) -> "tuple[NDArray[np.intp], Interval]":
        """Return the indices of the intervals that meet the one from `low` to `high`, and what is inside."""
        index = np.flatnonzero((self.low <= high) & (self.high >= low))
        return index, self[index].intersect(Interval(np.array(low), np.array(high)))

    def gather(self, parts: "list[tuple[NDArray[np.intp], Interval]]") -> "Interval":
        """Combine segments; return the hull where a point lies on several."""
        low, high = np.full(len(self.low), np.inf), np.full(len(self.low), -np.inf)
        for index, part in parts:
            low[index] = np.minimum(low[index], part.low)
            high[index] = np.maximum(high[index], part.high)
        return Interval(low, high)


Operand = Interval | Array | float


def interval(number: Operand) -> Interval:
    """Return a number as an interval of zero width."""
    if isinstance(number, Interval):
        return number
    exact = np.asarray(number, dtype=np.float64)
    return Interval(exact, exact)


def stacked(numbers: Sequence[Interval], axis: int) -> Interval:
    """Stack intervals as `numpy.stack` does."""
    return Interval(np.stack([n.low for n in numbers], axis), np.stack([n.high for n in numbers], axis))


def _outwards(low: Array, high: Array) -> Interval:
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def unbound_nan(number: Interval) -> Interval:
    """Replace each end that is not a number by infinity."""
    return Interval(
        np.where(np.isnan(number.low), -np.inf, number.low),
        np.where(np.isnan(number.high), np.inf, number.high),
    )


@dataclass(frozen=True, slots=True)
class Gradient:
    """Values at N points, and at each their gradient with respect to M inputs."""

    value: Array  # (N,)
    slope: Array  # (N, M)

    def __getitem__(self, points: Any) -> "Gradient":
        return Gradient(self.value[points], self.slope[points])

    def __add__(self, other: "Gradient | float") -> "Gradient":
        if isinstance(other, Gradient):
            return Gradient(self.value + other.value, self.slope + other.slope)
        return Gradient(self.value + other, self.slope)

    __radd__ = __add__

    def __neg__(self) -> "Gradient":
        return Gradient(-self.value, -self.slope)

    def __sub__(self, other: "Gradient | float") -> "Gradient":
        return self + -other

    def __rsub__(self, other: float) -> "Gradient":
        return -self + other

    def __mul__(self, other: "Gradient | float") -> "Gradient":
        if isinstance(other, Gradient):
            slope = self.value[:, None] * other.slope + other.value[:, None] * self.slope
            return Gradient(self.value * other.value, slope)
        return Gradient(self.value * other, self.slope * other)

    __rmul__ = __mul__

    def __truediv__(self, other: "Gradient | float") -> "Gradient":
        if isinstance(other, Gradient):
            value = self.value / other.value
            return Gradient(value, (self.slope - value[:, None] * other.slope) / other.value[:, None])
        return Gradient(self.value / other, self.slope / other)

    def sqrt(self) -> "Gradient":
        """Return the square root of positive values."""
        value = np.sqrt(self.value)
        return Gradient(value, self.slope / (2.0 * value[:, None]))

    def cos(self) -> "Gradient":
        return Gradient(np.cos(self.value), -np.sin(self.value)[:, None] * self.slope)

    def sin(self) -> "Gradient":
        return Gradient(np.sin(self.value), np.cos(self.value)[:, None] * self.slope)

    def expand_about(self, coefficients: Array, count: int) -> list[Series]:
        """Return the coefficients about each value, with their gradients."""
        expanded = Series.about(self.value[:, None] - 0.5, list(coefficients)).padded(count + 1)
        slopes = [(k + 1) * power for k, power in enumerate(expanded[1:])]
        return [
            Series(
                Gradient(value[:, axis], slope[:, axis, None] * self.slope)
                for value, slope in zip(expanded, slopes, strict=False)
            )
            for axis in range(3)
        ]

    def select_between(self, low: float, high: float) -> "tuple[NDArray[np.intp], Gradient]":
        """Return the indices of the values from `low` to `high`, and the numbers there."""
        index = np.flatnonzero((self.value >= low) & (self.value < high))
        return index, self[index]

    def gather(self, parts: "list[tuple[NDArray[np.intp], Gradient]]") -> "Gradient":
        """Combine segments, of which each point lies on one."""
        gathered = Gradient(np.empty_like(self.value), np.empty(self.slope.shape))
        for index, part in parts:
            gathered.value[index], gathered.slope[index] = part.value, part.slope
        return gathered


def inputs(columns: Array) -> list[Gradient]:
    """Return each column of (N, M) as an independent input."""
    unit = np.eye(columns.shape[1])
    return [
        Gradient(column, np.broadcast_to(row, (len(column), len(row))))
        for column, row in zip(columns.T, unit, strict=True)
    ]

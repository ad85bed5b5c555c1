"""Truncated Taylor series in time over any kind of number: floats, gradients, intervals, symbols."""

from collections.abc import Sequence
from math import factorial
from typing import Any

import numpy as np

Number = Any  # of one kind throughout a series


class Series(list[Number]):
    """Coefficients f, f', f''/2!, f'''/3!, … of a function of time; one computes with them as with numbers.

    Sums, products and quotients of two series have the length of the shorter one. A number that is added or
    subtracted is a constant. Coefficients need the operators `+`, `-`, `*`, `/`, and the functions that are
    used: NumPy arrays have them, and the numbers of `planning.arithmetic`.
    """

    @classmethod
    def from_derivatives(cls, values: Sequence[Number]) -> "Series":
        """Return the series of f, f', f'', …."""
        return cls(value * (1.0 / factorial(order)) for order, value in enumerate(values))

    @classmethod
    def about(cls, origin: Number, coefficients: Sequence[Number]) -> "Series":
        """Return the coefficients in powers of x - `origin` from those in powers of x, by Horner's scheme."""
        shifted = cls(origin * 0.0 + coefficient for coefficient in coefficients)
        for first in range(len(shifted) - 1):
            for k in range(len(shifted) - 2, first - 1, -1):
                shifted[k] = shifted[k] + origin * shifted[k + 1]
        return shifted

    def derivative(self, times: int = 1) -> "Series":
        """Return the series of a derivative, shorter by `times` coefficients."""
        series = self
        for _ in range(times):
            series = Series(series[k] * float(k) for k in range(1, len(series)))
        return series

    def __add__(self, other: Number) -> "Series":
        if isinstance(other, Series):
            return Series(x + y for x, y in zip(self, other, strict=False))
        return Series([self[0] + other, *self[1:]])

    def __neg__(self) -> "Series":
        return Series(-coefficient for coefficient in self)

    def __sub__(self, other: Number) -> "Series":
        return self + -other if isinstance(other, Series) else Series([self[0] - other, *self[1:]])

    def __rsub__(self, constant: Number) -> "Series":
        return Series([constant - self[0], *(-coefficient for coefficient in self[1:])])

    def __mul__(self, other: Number) -> "Series":
        """Return the Cauchy product with another series, or the series times a number."""
        if not isinstance(other, Series):
            return Series(coefficient * other for coefficient in self)
        size = min(len(self), len(other))
        return Series(_dot(self[: n + 1], other[n::-1] if n else other[:1]) for n in range(size))

    # What a list would do here, repeat or grow, is never meant.
    __rmul__, __iadd__, __imul__ = __mul__, __add__, __mul__

    def __truediv__(self, other: "Series") -> "Series":
        quotient = Series()
        for n in range(min(len(self), len(other))):
            rest = self[n] - _dot(quotient, other[n:0:-1]) if n else self[0]
            quotient.append(rest / other[0])
        return quotient

    def sqrt(self) -> "Series":
        """Return the square root."""
        first = square_root(self[0])
        root = Series([first])
        for n in range(1, len(self)):
            rest = self[n] - _dot(root[1:], root[:0:-1]) if n > 1 else self[n]
            root.append(rest / (first * 2.0))
        return root

    def cos_sin(self) -> tuple["Series", "Series"]:
        """Return cosine and sine of an angle a, from c' = -s a' and s' = c a'."""
        first = self[0]
        if isinstance(first, float | np.ndarray):
            cosine, sine = Series([np.cos(first)]), Series([np.sin(first)])
        else:
            cosine, sine = Series([first.cos()]), Series([first.sin()])
        rates = [coefficient * float(k) for k, coefficient in enumerate(self)]
        for n in range(1, len(self)):
            cosine.append(_dot(rates[1 : n + 1], sine[n - 1 :: -1]) * (-1.0 / n))
            sine.append(_dot(rates[1 : n + 1], cosine[n - 1 :: -1]) * (1.0 / n))
        return cosine, sine

    def padded(self, count: int) -> "Series":
        """Return the first `count` coefficients, with zeros where there are fewer."""
        return Series([*self[:count], *[self[0] * 0.0] * (count - len(self))])


def square_root(number: Number) -> Number:
    """Return the square root of any kind of number."""
    return np.sqrt(number) if isinstance(number, float | np.ndarray) else number.sqrt()


def _dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total

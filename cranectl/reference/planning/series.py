"""Truncated Taylor series in time over any kind of number: floats, gradients, intervals, symbols.

A series is the list of its coefficients f, f', f''/2!, f'''/3!, … so that products are Cauchy's. Numbers need
+, -, *, /, and a square root: NumPy arrays, `gradients.Gradient`, `intervals.Interval`, CasADi's expressions.
"""

from collections.abc import Sequence
from math import factorial
from typing import Any

import numpy as np

Number = Any  # of one kind throughout a series
Series = list[Number]


def from_derivatives(values: Sequence[Number]) -> Series:
    """The series of f, f', f'', …."""
    return [value * (1.0 / factorial(order)) for order, value in enumerate(values)]


def derivative(series: Series, order: int) -> Number:
    """The derivative of that order itself, at the point of expansion."""
    return series[order] * float(factorial(order))


def differentiated(series: Series, times: int) -> Series:
    """The series of a derivative, shorter by so many coefficients."""
    for _ in range(times):
        series = [series[k] * float(k) for k in range(1, len(series))]
    return series


def plus(a: Series, b: Series) -> Series:
    """As long as the shorter one."""
    return [x + y for x, y in zip(a, b, strict=False)]


def times(a: Series, b: Series) -> Series:
    """Cauchy product, as long as the shorter one."""
    return [_dot(a[: n + 1], b[n::-1] if n else b[:1]) for n in range(min(len(a), len(b)))]


def over(a: Series, b: Series) -> Series:
    """The quotient; as long as the shorter one."""
    quotient: Series = []
    for n in range(min(len(a), len(b))):
        rest = a[n] - _dot(quotient, b[n:0:-1]) if n else a[0]
        quotient.append(rest / b[0])
    return quotient


def root(a: Series) -> Series:
    """The square root."""
    first = square_root(a[0])
    found: Series = [first]
    for n in range(1, len(a)):
        rest = a[n] - _dot(found[1:], found[:0:-1]) if n > 1 else a[n]
        found.append(rest / (first * 2.0))
    return found


def square_root(number: Number) -> Number:
    """Of any kind of number."""
    return np.sqrt(number) if isinstance(number, float | np.ndarray) else number.sqrt()


def composed(outer: Series, inner: Series) -> Series:
    """The series of f(g(t)) from that of f at g's first coefficient, and that of g."""
    rise: Series = [inner[0] * 0.0, *inner[1:]]
    total: Series = [outer[-1], *(inner[0] * 0.0 for _ in inner[1:])]
    for coefficient in outer[-2::-1]:
        total = times(total, rise)
        total[0] = total[0] + coefficient
    return total


def _dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total

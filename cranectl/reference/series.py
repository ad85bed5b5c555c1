"""Truncated Taylor series in time over any kind of number: floats, gradients, intervals, symbols.

A series is the list of its coefficients f, f', f''/2!, f'''/3!, …, so that products are Cauchy products.
Numbers need +, -, *, / and a square root: NumPy arrays and those of `planning.arithmetic`.
"""

from collections.abc import Sequence
from math import factorial
from typing import Any

import numpy as np

Number = Any  # of one kind throughout a series
Series = list[Number]


def from_derivatives(values: Sequence[Number]) -> Series:
    """Return the series of f, f', f'', …."""
    return [value * (1.0 / factorial(order)) for order, value in enumerate(values)]


def differentiate(series: Series, times: int) -> Series:
    """Return the series of a derivative, shorter by `times` coefficients."""
    for _ in range(times):
        series = [series[k] * float(k) for k in range(1, len(series))]
    return series


def add_constant(series: Series, constant: float) -> Series:
    """Return the series plus a constant."""
    return [series[0] + constant, *series[1:]]


def add(a: Series, b: Series) -> Series:
    """Add two series; the sum has the length of the shorter one."""
    return [x + y for x, y in zip(a, b, strict=False)]


def multiply(a: Series, b: Series) -> Series:
    """Return the Cauchy product, with the length of the shorter series."""
    return [_dot(a[: n + 1], b[n::-1] if n else b[:1]) for n in range(min(len(a), len(b)))]


def divide(a: Series, b: Series) -> Series:
    """Return the quotient, with the length of the shorter series."""
    quotient: Series = []
    for n in range(min(len(a), len(b))):
        rest = a[n] - _dot(quotient, b[n:0:-1]) if n else a[0]
        quotient.append(rest / b[0])
    return quotient


def take_root(a: Series) -> Series:
    """Return the square root of a series."""
    first = square_root(a[0])
    coefficients: Series = [first]
    for n in range(1, len(a)):
        rest = a[n] - _dot(coefficients[1:], coefficients[:0:-1]) if n > 1 else a[n]
        coefficients.append(rest / (first * 2.0))
    return coefficients


def square_root(number: Number) -> Number:
    """Return the square root of any kind of number."""
    return np.sqrt(number) if isinstance(number, float | np.ndarray) else number.sqrt()


def cosine_and_sine(angle: Series) -> tuple[Series, Series]:
    """Return the series of cosine and sine of an angle a, from c' = -s a' and s' = c a'."""
    first = angle[0]
    if isinstance(first, float | np.ndarray):
        cosine, sine = [np.cos(first)], [np.sin(first)]
    else:
        cosine, sine = [first.cos()], [first.sin()]
    rates = [coefficient * float(k) for k, coefficient in enumerate(angle)]
    for n in range(1, len(angle)):
        cosine.append(_dot(rates[1 : n + 1], sine[n - 1 :: -1]) * (-1.0 / n))
        sine.append(_dot(rates[1 : n + 1], cosine[n - 1 :: -1]) * (1.0 / n))
    return cosine, sine


def _dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total

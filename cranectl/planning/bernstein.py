"""Splines in pieces, each with the Bernstein coefficients of every derivative, whose hull holds the curve.

Halving derivatives' own coefficients keeps their digits; differences of halved positions would lose them by h
to the power of the order.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.planning.intervals import Interval, interval, stacked
from cranectl.support.arrays import Array


class Pieces(NamedTuple):
    """P stretches of a curve of d coordinates in time."""

    start: Array  # (P,) [s]
    length: Interval  # (P,) [s]
    derivatives: tuple[Interval, ...]  # of order k: Bernstein coefficients (P, degree - k + 1, d)

    def of(self, chosen: Array) -> "Pieces":
        """Those chosen."""
        return Pieces(
            self.start[chosen],
            self.length[chosen],
            tuple(each[chosen] for each in self.derivatives),
        )

    def hull(self, order: int, coordinate: int) -> Interval:
        """What a derivative is within on each piece, (P,)."""
        row = self.derivatives[order][:, :, coordinate]
        return Interval(row.low.min(axis=1), row.high.max(axis=1))

    def middle(self, order: int, coordinate: int) -> Interval:
        """A derivative in the middle of each piece, (P,)."""
        row = self.derivatives[order][:, :, coordinate]
        while row.low.shape[1] > 1:
            row = _means(row)
        return row[:, 0]

    def halved(self) -> "Pieces":
        """Twice as many, first all left halves, then all right ones."""
        half = self.length * 0.5
        left, right = zip(*map(_halves, self.derivatives), strict=True)
        both = tuple(
            Interval(np.concatenate([a.low, b.low]), np.concatenate([a.high, b.high]))
            for a, b in zip(left, right, strict=True)
        )
        starts = np.concatenate([self.start, self.start + half.low])
        return Pieces(starts, Interval(np.tile(half.low, 2), np.tile(half.high, 2)), both)


def pieces_of(breaks: Array, coefficients: Array, degree: int, orders: int) -> Pieces:
    """The spans of a B-spline with knots at `breaks` (spans + 1,) [s]; coefficients (spans + degree, d)."""
    spans = len(breaks) - 1
    knots = np.concatenate([np.full(degree, breaks[0]), breaks, np.full(degree, breaks[-1])])
    first = np.arange(spans)
    ends = knots[degree + first], knots[degree + first + 1]
    rows = [
        _blossom(coefficients, knots, first, [ends[level <= later] for level in range(1, degree + 1)])
        for later in range(degree + 1)
    ]
    derivative = stacked(rows, axis=1)
    length = interval(ends[1]) - interval(ends[0])
    wide = length[:, None, None]
    found = [derivative]
    for order in range(1, orders):
        if order > degree:
            derivative = derivative * 0.0
        else:
            step = derivative[:, 1:] - derivative[:, :-1]
            derivative = step * float(degree - order + 1) / wide
        found.append(derivative)
    return Pieces(ends[0], length, tuple(found))


def _blossom(
    coefficients: Array, knots: Array, first: NDArray[np.intp], arguments: Sequence[Array]
) -> Interval:
    """Return the polar form of all spans by de Boor's recursion, an argument [s] for each degree."""
    degree = len(arguments)
    row = [interval(coefficients[first + k]) for k in range(degree + 1)]
    for level, argument in enumerate(arguments, 1):
        at = interval(argument)
        for k in range(degree, level - 1, -1):
            left, right = interval(knots[first + k]), interval(knots[first + degree + k - level + 1])
            part = (at - left) / (right - left)
            row[k] = row[k - 1] + part[:, None] * (row[k] - row[k - 1])
    return row[degree]


def _means(row: Interval) -> Interval:
    return (row[:, :-1] + row[:, 1:]) * 0.5


def _halves(row: Interval) -> tuple[Interval, Interval]:
    """De Casteljau's algorithm at one half."""
    left, right = [], []
    while True:
        left.append(row[:, 0])
        right.append(row[:, -1])
        if row.low.shape[1] == 1:
            break
        row = _means(row)
    return stacked(left, axis=1), stacked(right[::-1], axis=1)

"""Normal equations of least squares with splines, summed sample by sample in compiled loops.

A sample touches `ORDER` neighbouring basis functions only. So a row of the design matrix is `ORDER` numbers
and the column of the first; a million samples take seconds, where sparse matrices take minutes.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from cranectl.reference.time_laws import spline
from cranectl.support.arrays import Array
from cranectl.support.jit import jit

DEGREE = 7
ORDER = DEGREE + 1
AT_ONCE = 2**16  # samples whose rows are computed together, so that they take little memory
TIED = 5  # coefficients at each end that are one free coefficient

Integers = NDArray[np.int64]


class DesignMatrix(NamedTuple):
    """What each free coefficient of a spline contributes to each sample."""

    first: Integers  # (N,) column of the first number of each row
    values: Array  # (N, ORDER)
    columns: int

    @classmethod
    def of(cls, time: Array, breaks: Array) -> Self:
        """Return that of a spline of degree 7 on `breaks`, the coefficients of each end tied, at `time`."""
        free = free_coefficients(len(breaks) - 1)
        knots = spline(breaks, np.zeros(len(free)), DEGREE).t
        first, values = np.empty(len(time), dtype=np.int64), np.empty((len(time), ORDER))
        for start in range(0, len(time), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            rows = BSpline.design_matrix(time[part], knots, DEGREE)
            column = rows.indices.reshape(-1, ORDER)[:, 0].astype(np.int64)
            first[part], values[part] = _tied(column, rows.data, free)
        return cls(first, values, int(free[-1]) + 1)

    def without_first(self) -> Self:
        """Return it without the first column, which only the first rows have."""
        values, early = self.values.copy(), int(np.count_nonzero(self.first == 0))
        values[:early, :-1], values[:early, -1] = self.values[:early, 1:], 0.0
        return self._replace(first=np.maximum(self.first - 1, 0), values=values, columns=self.columns - 1)

    def banded(self, group: Integers, groups: int) -> Array:
        """Return A'A of each group's rows, upper diagonals as SciPy has them (groups, ORDER, columns)."""
        bands = _banded(self.first, self.values, group, np.zeros((groups, ORDER, self.columns + ORDER)))
        return bands[:, :, : self.columns]

    def times(self, group: Integers, groups: int, points: Array) -> Array:
        """Return A' `points` (N, 3) of the rows of each group (groups, columns, 3)."""
        sums = np.zeros((groups, self.columns + ORDER, 3))
        side = _times(self.first, self.values, group, points, sums)
        return side[:, : self.columns]

    def signed_times(self, block: Integers, signs: NDArray[np.int8], points: Array) -> Array:
        """Return A' (`signs` of the sample's block times `points`) for each draw (columns, 3, draws).

        `signs` (blocks, draws) holds 1 and -1.
        """
        sums = np.zeros((self.columns + ORDER, 3, signs.shape[1]))
        side = _signed_times(self.first, self.values, block, signs, points, sums)
        return side[: self.columns]

    def at(self, group: Integers, coefficients: Array) -> Array:
        """Return A `coefficients` (groups, columns, 3), each row with those of its group (N, 3)."""
        padded = np.concatenate([coefficients, np.zeros((len(coefficients), ORDER, 3))], axis=1)
        return _at(self.first, self.values, group, padded, np.zeros((len(group), 3)))


def free_coefficients(spans: int) -> NDArray[np.intp]:
    """Return which free coefficient each coefficient is (spans + DEGREE,)."""
    count = spans + DEGREE
    return np.clip(np.arange(count) - (TIED - 1), 0, count - 2 * TIED + 1)


@jit
def _tied(column: Integers, data: Array, free: NDArray[np.intp]) -> tuple[Integers, Array]:
    first, values = np.empty(len(column), dtype=np.int64), np.zeros((len(column), ORDER))
    for i in range(len(column)):
        first[i] = free[column[i]]
        for k in range(ORDER):
            values[i, free[column[i] + k] - first[i]] += data[ORDER * i + k]
    return first, values


@jit
def _banded(first: Integers, values: Array, group: Integers, sums: Array) -> Array:
    for i in range(len(first)):
        for a in range(ORDER):
            for b in range(a, ORDER):
                sums[group[i], DEGREE - (b - a), first[i] + b] += values[i, a] * values[i, b]
    return sums


@jit
def _times(first: Integers, values: Array, group: Integers, points: Array, sums: Array) -> Array:
    for i in range(len(first)):
        for k in range(ORDER):
            for axis in range(3):
                sums[group[i], first[i] + k, axis] += values[i, k] * points[i, axis]
    return sums


@jit
def _signed_times(
    first: Integers, values: Array, block: Integers, signs: NDArray[np.int8], points: Array, sums: Array
) -> Array:
    for i in range(len(first)):
        row = signs[block[i]]
        for k in range(ORDER):
            for axis in range(3):
                product, target = values[i, k] * points[i, axis], sums[first[i] + k, axis]
                for draw in range(len(row)):
                    target[draw] += row[draw] * product
    return sums


@jit
def _at(first: Integers, values: Array, group: Integers, coefficients: Array, values_at: Array) -> Array:
    for i in range(len(first)):
        for k in range(ORDER):
            for axis in range(3):
                values_at[i, axis] += values[i, k] * coefficients[group[i], first[i] + k, axis]
    return values_at

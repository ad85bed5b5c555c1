"""Normal equations of least squares with splines, summed sample by sample in compiled loops.

Only `ORDER` neighbouring basis functions are nonzero at a sample. So a row of the design matrix A is stored
as `ORDER` numbers and the column of the first. A million samples take seconds, with sparse matrices minutes.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from cranectl.reference.time_laws import spline
from cranectl.support import Array, jit

DEGREE = 7
ORDER = DEGREE + 1
BATCH_SIZE = 2**16  # samples whose rows are computed together, to save memory
REST_COEFFICIENTS = 5  # equal coefficients at each end, which make the motion rest there

Integers = NDArray[np.int64]


class DesignMatrix(NamedTuple):
    """The design matrix A: the value of each free basis function of a spline at each sample."""

    first: Integers  # (N,) column of the first number of each row
    values: Array  # (N, ORDER)
    columns: int

    @classmethod
    def of(cls, time: Array, breaks: Array) -> Self:
        """Return the matrix at `time` of a spline of degree 7 on `breaks` that rests at both ends."""
        free = free_indices(len(breaks) - 1)
        knots = spline(breaks, np.zeros(len(free)), DEGREE).t
        first, values = np.empty(len(time), dtype=np.int64), np.empty((len(time), ORDER))
        for start in range(0, len(time), BATCH_SIZE):
            batch = slice(start, start + BATCH_SIZE)
            rows = BSpline.design_matrix(time[batch], knots, DEGREE)
            column = rows.indices.reshape(-1, ORDER)[:, 0].astype(np.int64)
            first[batch], values[batch] = _merge_columns(column, rows.data, free)
        return cls(first, values, int(free[-1]) + 1)

    def without_first(self) -> Self:
        """Return the matrix without its first column, which is nonzero in the first rows only."""
        values, early = self.values.copy(), int(np.count_nonzero(self.first == 0))
        values[:early, :-1], values[:early, -1] = self.values[:early, 1:], 0.0
        return self._replace(first=np.maximum(self.first - 1, 0), values=values, columns=self.columns - 1)

    def gram_bands(self, group: Integers, groups: int) -> Array:
        """Return A'A of each group's rows, as upper bands in SciPy's form (groups, ORDER, columns)."""
        # Rows near the end reach beyond the last column, with zeros.
        bands = _sum_products(self.first, self.values, group, np.zeros((groups, ORDER, self.columns + ORDER)))
        return bands[:, :, : self.columns]

    def right_sides(self, group: Integers, groups: int, points: Array) -> Array:
        """Return A' `points` (N, 3) of each group's rows (groups, columns, 3)."""
        return self.weighted_right_sides(group, np.eye(groups, dtype=np.int8), points)

    def weighted_right_sides(self, block: Integers, weights: NDArray[np.int8], points: Array) -> Array:
        """Return A' `points`, each multiplied by the weight of its block, for each draw (draws, columns, 3).

        `weights` (blocks, draws) holds 1, 0 and -1.
        """
        sums = np.zeros((self.columns + ORDER, 3, weights.shape[1]))
        sides = _sum_weighted_sides(self.first, self.values, block, weights, points, sums)
        return np.ascontiguousarray(np.moveaxis(sides[: self.columns], -1, 0))

    def evaluate(self, group: Integers, coefficients: Array) -> Array:
        """Return A times the `coefficients` (groups, columns, 3) of each row's group: (N, 3)."""
        padded = np.concatenate([coefficients, np.zeros((len(coefficients), ORDER, 3))], axis=1)
        return _evaluate(self.first, self.values, group, padded, np.zeros((len(group), 3)))


def free_indices(spans: int) -> NDArray[np.intp]:
    """Return the index of the free coefficient that determines each coefficient (spans + DEGREE,)."""
    count = spans + DEGREE
    return np.clip(np.arange(count) - (REST_COEFFICIENTS - 1), 0, count - 2 * REST_COEFFICIENTS + 1)


@jit
def _merge_columns(column: Integers, data: Array, free: NDArray[np.intp]) -> tuple[Integers, Array]:
    first, values = np.empty(len(column), dtype=np.int64), np.zeros((len(column), ORDER))
    for i in range(len(column)):
        first[i] = free[column[i]]
        for k in range(ORDER):
            values[i, free[column[i] + k] - first[i]] += data[ORDER * i + k]
    return first, values


@jit
def _sum_products(first: Integers, values: Array, group: Integers, sums: Array) -> Array:
    for i in range(len(first)):
        for a in range(ORDER):
            for b in range(a, ORDER):
                sums[group[i], DEGREE - (b - a), first[i] + b] += values[i, a] * values[i, b]
    return sums


@jit
def _sum_weighted_sides(
    first: Integers, values: Array, block: Integers, weights: NDArray[np.int8], points: Array, sums: Array
) -> Array:
    for i in range(len(first)):
        row = weights[block[i]]
        for k in range(ORDER):
            for axis in range(3):
                product, target = values[i, k] * points[i, axis], sums[first[i] + k, axis]
                for draw in range(len(row)):
                    target[draw] += row[draw] * product
    return sums


@jit
def _evaluate(
    first: Integers, values: Array, group: Integers, coefficients: Array, values_at: Array
) -> Array:
    for i in range(len(first)):
        for k in range(ORDER):
            for axis in range(3):
                values_at[i, axis] += values[i, k] * coefficients[group[i], first[i] + k, axis]
    return values_at

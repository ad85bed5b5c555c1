"""Linear matrix inequalities, by Clarabel's cone of positive semidefinite matrices.

Boyd, El Ghaoui, Feron, Balakrishnan: Linear Matrix Inequalities in System and Control Theory, SIAM 1994.
"""

from collections.abc import Callable
from itertools import accumulate, pairwise

import clarabel
import numpy as np
from scipy import sparse

from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

Shape = int | tuple[int, int]  # n: symmetric, of n rows


def minimise(
    cost: Callable[..., float], inequalities: Callable[..., list[Array]], *shapes: Shape
) -> list[Array]:
    """Matrices of these `shapes` with the smallest `cost` for which all `inequalities` are <= 0.

    Both are affine in the matrices that they are called with, and what they are made of is found by calling
    them; `inequalities` returns symmetric matrices, <= 0 says that they are negative semidefinite. Raises
    InputError where there is no solution. It is one to about eight digits: who needs it strictly, checks.
    """
    total = sum(_size(shape) for shape in shapes)
    points = [_matrices(point, shapes) for point in (np.zeros(total), *np.eye(total))]
    costs = np.array([cost(*point) for point in points])
    found = [inequalities(*point) for point in points]
    columns = np.column_stack([np.concatenate([_triangle(each) for each in row]) for row in found])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    answer = clarabel.DefaultSolver(
        sparse.csc_matrix((total, total)),
        costs[1:] - costs[0],
        sparse.csc_matrix(columns[:, 1:] - columns[:, :1]),
        -columns[:, 0],
        [clarabel.PSDTriangleConeT(len(each)) for each in found[0]],
        settings,
    ).solve()
    if answer.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
        raise InputError(
            f"linear matrix inequalities without a solution: {answer.status}",
            allowed="demands that some controller meets together",
            remedy="relax one of them",
        )
    return _matrices(np.array(answer.x), shapes)


def _size(shape: Shape) -> int:
    return shape * (shape + 1) // 2 if isinstance(shape, int) else shape[0] * shape[1]


def _matrices(numbers: Array, shapes: tuple[Shape, ...]) -> list[Array]:
    ends = accumulate((_size(shape) for shape in shapes), initial=0)
    return [
        _symmetric(numbers[low:high], shape) if isinstance(shape, int) else numbers[low:high].reshape(shape)
        for (low, high), shape in zip(pairwise(ends), shapes, strict=True)
    ]


def _symmetric(numbers: Array, rows: int) -> Array:
    matrix = np.zeros((rows, rows))
    matrix[np.tril_indices(rows)] = numbers
    return matrix + np.tril(matrix, -1).T


def _triangle(matrix: Array) -> Array:
    """As Clarabel has them: columns of the upper triangle, what is off the diagonal times the root of 2."""
    rows, columns = np.tril_indices(len(matrix))
    scaled: Array = matrix[rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0))
    return scaled

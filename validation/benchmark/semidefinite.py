"""Solve linear matrix inequalities: least cost by Clarabel, analytic centre by Newton's method.

References
----------
Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994.
"""

from collections.abc import Callable
from itertools import accumulate, pairwise

import clarabel
import numpy as np
from scipy import sparse

from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

Shape = int | tuple[int, int]  # an integer n stands for a symmetric matrix of n rows
Cost = Callable[..., float]
Inequalities = Callable[..., list[Array]]

MIN_SLACK = 1e-7  # smallest common slack of the inequalities; Clarabel is accurate to 1e-8
NEWTON_STEPS = 200  # limit; 20 to 60 are usual
FULL_STEP = 0.25  # Newton decrement below which a full step converges quadratically
CENTRED = 1e-9  # Newton decrement below which the centre is accepted


def minimise(cost: Cost, inequalities: Inequalities, *shapes: Shape) -> list[Array]:
    """Find matrices with the least `cost` that satisfy all `inequalities`.

    The cost is accurate to about eight digits. If the cost is flat, the matrices are less accurate, and
    differ between processors. Those of `analytic_centre` do not.

    Parameters
    ----------
    cost : callable
        Affine function of the matrices.
    inequalities : callable
        Affine function of the matrices. It returns symmetric matrices that must be negative semidefinite.
    *shapes : int or (int, int)
        Shape of each matrix; an integer n stands for a symmetric matrix of n rows.

    Returns
    -------
    list of arrays
        The matrices, of these shapes.

    Raises
    ------
    InputError
        If there is no solution.
    """
    _, linear = _affine(lambda *matrices: np.array([cost(*matrices)]), shapes)
    sizes = [len(each) for each in inequalities(*_matrices(np.zeros(_total(shapes)), shapes))]
    constant, slope = _affine(
        lambda *matrices: np.concatenate([_triangle(each) for each in inequalities(*matrices)]), shapes
    )
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    answer = clarabel.DefaultSolver(
        sparse.csc_matrix((slope.shape[1],) * 2),
        linear[0],
        sparse.csc_matrix(slope),
        -constant,
        [clarabel.PSDTriangleConeT(size) for size in sizes],
        settings,
    ).solve()
    if answer.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
        raise InputError(
            f"linear matrix inequalities without a solution: {answer.status}",
            allowed="demands that some controller meets together",
            remedy="relax one of them",
        )
    return _matrices(np.array(answer.x), shapes)


def analytic_centre(inequalities: Inequalities, *shapes: Shape) -> list[Array]:
    """Find the matrices that maximise the product of the determinants of all -`inequalities`.

    They are unique if the inequalities bound the matrices. Newton's method finds them to rounding.

    Parameters
    ----------
    inequalities, *shapes
        As for `minimise`.

    Returns
    -------
    list of arrays
        The matrices, of these shapes; they satisfy the inequalities strictly.

    Raises
    ------
    InputError
        If the inequalities cannot be satisfied strictly, or do not bound the matrices.

    References
    ----------
    Boyd and Vandenberghe, Convex Optimization, Cambridge 2004, sections 8.5.3 and 9.6.
    """
    *start, slack = minimise(
        lambda *matrices: -matrices[-1][0, 0],
        lambda *matrices: [
            each + matrices[-1][0, 0] * np.eye(len(each)) for each in inequalities(*matrices[:-1])
        ],
        *shapes,
        (1, 1),
    )
    point = _numbers(start, shapes)
    _, slope = _affine(
        lambda *matrices: np.concatenate([each.ravel() for each in inequalities(*matrices)]), shapes
    )
    decrement = np.inf
    for _ in range(NEWTON_STEPS if slack[0, 0] > MIN_SLACK else 0):
        rows, sides, first = [], [], 0
        for each in inequalities(*_matrices(point, shapes)):
            size = len(each)
            root = np.linalg.inv(np.linalg.cholesky(-each))
            parts = slope[first : first + size * size].T.reshape(-1, size, size)
            rows.append((root @ parts @ root.T).reshape(len(parts), -1).T)
            sides.append(-np.eye(size).ravel())
            first += size * size
        scaled = np.vstack(rows)
        step = np.linalg.lstsq(scaled, np.concatenate(sides), rcond=None)[0]
        decrement = float(np.linalg.norm(scaled @ step))
        point = point + (step if decrement < FULL_STEP else step / (1.0 + decrement))
        if decrement < CENTRED:
            return _matrices(point, shapes)
    raise InputError(
        "linear matrix inequalities without an analytic centre",
        allowed="demands that some controller meets strictly, and that bound the matrices",
        remedy="relax one of them",
    )


def _affine(function: Callable[..., Array], shapes: tuple[Shape, ...]) -> tuple[Array, Array]:
    """Return the value at zero (m,) and the slope (m, n) of an affine function of the matrices."""
    total = _total(shapes)
    zero, *others = (function(*_matrices(point, shapes)) for point in (np.zeros(total), *np.eye(total)))
    return zero, np.column_stack([other - zero for other in others])


def _total(shapes: tuple[Shape, ...]) -> int:
    return sum(_size(shape) for shape in shapes)


def _size(shape: Shape) -> int:
    return shape * (shape + 1) // 2 if isinstance(shape, int) else shape[0] * shape[1]


def _matrices(numbers: Array, shapes: tuple[Shape, ...]) -> list[Array]:
    ends = accumulate((_size(shape) for shape in shapes), initial=0)
    return [
        _symmetric(numbers[low:high], shape) if isinstance(shape, int) else numbers[low:high].reshape(shape)
        for (low, high), shape in zip(pairwise(ends), shapes, strict=True)
    ]


def _numbers(matrices: list[Array], shapes: tuple[Shape, ...]) -> Array:
    """Return the entries of matrices in one array; inverse of `_matrices`."""
    pairs = zip(matrices, shapes, strict=True)
    return np.concatenate([m[np.tril_indices(len(m))] if isinstance(s, int) else m.ravel() for m, s in pairs])


def _symmetric(numbers: Array, rows: int) -> Array:
    matrix = np.zeros((rows, rows))
    matrix[np.tril_indices(rows)] = numbers
    return matrix + np.tril(matrix, -1).T


def _triangle(matrix: Array) -> Array:
    """Return the upper triangle by columns, off the diagonal times the root of 2, as Clarabel has it."""
    rows, columns = np.tril_indices(len(matrix))
    scaled: Array = matrix[rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0))
    return scaled

"""Compare solutions of linear matrix inequalities with closed forms."""

import numpy as np
import pytest

from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from validation.benchmark.semidefinite import Inequalities, analytic_centre, minimise

pytestmark = pytest.mark.processor


@pytest.mark.parametrize("rows", [1, 2, 5])
def test_largest_eigenvalue(rows: int) -> None:
    """It is the least t for which M - t <= 0; a second inequality does not act."""
    matrix = np.random.default_rng(rows).standard_normal((rows, rows))
    matrix = matrix + matrix.T
    (least,) = minimise(lambda t: t[0, 0], lambda t: [matrix - t[0, 0] * np.eye(rows), t - 100.0], (1, 1))
    assert least[0, 0] == pytest.approx(np.linalg.eigvalsh(matrix)[-1], rel=1e-7)


def test_matrices_of_both_shapes() -> None:
    """The symmetric X >= M with least trace is M; Y equals its target because the norm is minimised."""
    target = np.arange(6.0).reshape(2, 3)
    matrix = np.array([[2.0, -0.5, 0.3], [-0.5, 1.0, 0.2], [0.3, 0.2, 3.0]])

    def inequalities(x: Array, y: Array, t: Array) -> list[Array]:
        off = y - target
        return [matrix - x, -np.block([[t[0, 0] * np.eye(2), off], [off.T, t[0, 0] * np.eye(3)]])]

    x, y, _ = minimise(lambda x, _, t: np.trace(x) + t[0, 0], inequalities, 3, (2, 3), (1, 1))
    np.testing.assert_allclose(x, matrix, atol=1e-6)
    np.testing.assert_allclose(y, target, atol=1e-6)


def test_infeasible_problem_is_reported() -> None:
    """An unstable system has no Lyapunov function."""
    a = np.array([[0.1, 1.0], [0.0, -1.0]])
    with pytest.raises(InputError, match="without a solution: PrimalInfeasible"):
        minimise(lambda _: 0.0, lambda p: [a @ p + p @ a.T + np.eye(2), -p], 2)


def test_centre_between_two_matrices() -> None:
    """The product det(X) det(M - X) is largest at X = M/2, and (y - a)(b - y) is largest in the middle."""
    matrix = np.array([[2.0, -0.5, 0.3], [-0.5, 1.0, 0.2], [0.3, 0.2, 3.0]])
    x, y = analytic_centre(lambda x, y: [-x, x - matrix, y - 7.0, 3.0 - y], 3, (1, 1))
    np.testing.assert_allclose(x, 0.5 * matrix, rtol=1e-13)
    np.testing.assert_allclose(y, 5.0, rtol=1e-13)


@pytest.mark.parametrize("inequalities", [lambda x: [-x], lambda x: [x - 1.0, 1.0 - x]])
def test_set_without_centre_is_refused(inequalities: Inequalities) -> None:
    """Neither a half line nor a point has a centre."""
    with pytest.raises(InputError, match="without"):
        analytic_centre(inequalities, (1, 1))

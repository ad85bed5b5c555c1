"""Derivatives of the optimisation problem, against finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from cranectl.planning.minimum_time import along_path, fit_guess, tighten_limits
from cranectl.planning.problem import Problem, Task
from cranectl.reference.geometry import Circular
from tests.planning.tasks import limits_for, move, scenario

START = np.array([1.65, 0.77, -0.7])
ARC = Circular(START, np.array([1.0, 0.77]), -3.0)
TASKS = {
    "free": move("b"),
    "via": move("a", via=((1.0, 0.9, -0.9),)),
    "in a plane": move("a", plane=True),
    "over a wall": move("c, load of 0.05 m"),
    "along an arc": along_path(ARC, limits_for([START, START + [1.0, 0.0, 0.0]], scenario()), 3.0),  # noqa: RUF005
}


@pytest.fixture(params=TASKS)
def case(request: pytest.FixtureRequest) -> tuple[Problem, np.ndarray]:
    """Return a problem, and unknowns near its initial guess."""
    task: Task = replace(TASKS[request.param], spans=9)
    problem = Problem(tighten_limits(task), np.linspace(0.0, 1.0, 20))
    x = problem.unknowns(fit_guess(problem, 1.0), task.duration)
    return problem, x + np.random.default_rng(1).uniform(-0.01, 0.01, len(x))


def test_slopes_are_those_of_finite_differences(case: tuple[Problem, np.ndarray]) -> None:
    problem, x = case
    linearised, step = problem.linearise(x), 1e-6
    for index, row in enumerate(np.eye(len(x)) * step):
        ahead, behind = problem.linearise(x + row), problem.linearise(x - row)
        for values, slopes in (("excess", "slope"), ("efforts", "effort_slope")):
            expected = (getattr(ahead, values) - getattr(behind, values)) / (2 * step)
            actual = getattr(linearised, slopes)
            # Errors of differences; slopes are up to 1e4, and a wrong one would be off by its size.
            atol = 1e-6 * max(1.0, float(np.abs(actual).max()))
            np.testing.assert_allclose(actual[:, index], expected, atol=atol, rtol=1e-5)


def test_the_hessian_is_that_of_weighted_slopes(case: tuple[Problem, np.ndarray]) -> None:
    problem, x = case
    count = len(problem.linearise(x).excess)
    random = np.random.default_rng(2)
    multipliers = random.uniform(0.0, 1.0, count) * (random.uniform(size=count) < 0.1)
    actual, step = problem.hessian_of(x, multipliers), 1e-5
    expected = np.stack(
        [
            multipliers @ (problem.linearise(x + row).slope - problem.linearise(x - row).slope)
            for row in np.eye(len(x)) * step
        ]
    ) / (2 * step)
    expected = 0.5 * (expected + expected.T)
    # Both are finite differences; every block of the Hessian is larger than this tolerance, so it counts.
    np.testing.assert_allclose(actual, expected, atol=1e-4 * np.abs(expected).max())


def test_unknowns_contain_coefficients_and_duration() -> None:
    task = TASKS["via"]
    problem = Problem(task, np.linspace(0.0, 1.0, 9))
    x = problem.unknowns(fit_guess(problem, 1.0), 2.5)
    coefficients = problem.coefficients(x)
    assert problem.duration(x) == 2.5
    assert (coefficients[:5] == task.start).all()
    assert (coefficients[-5:] == task.end).all()
    np.testing.assert_array_equal(problem.unknowns(coefficients, 2.5), x)

"""What the solver is told of the problem, against differences."""

from dataclasses import replace

import numpy as np
import pytest

from cranectl.planning.minimum_time import _fitted, _inside, along_path
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
    """A problem, and unknowns near those that it begins with."""
    task: Task = replace(TASKS[request.param], spans=9)
    problem = Problem(_inside(task), np.linspace(0.0, 1.0, 20))
    x = problem.unknowns(_fitted(problem, 1.0), task.duration)
    return problem, x + np.random.default_rng(1).uniform(-0.01, 0.01, len(x))


def test_slopes_are_those_of_differences(case: tuple[Problem, np.ndarray]) -> None:
    problem, x = case
    near, step = problem.linearised(x), 1e-6
    for index, row in enumerate(np.eye(len(x)) * step):
        ahead, behind = problem.linearised(x + row), problem.linearised(x - row)
        for values, slopes in (("excess", "slope"), ("efforts", "effort_slope")):
            wanted = (getattr(ahead, values) - getattr(behind, values)) / (2 * step)
            found = getattr(near, slopes)
            # Of differences, where slopes are up to 1e4: an error in one would be of its size.
            atol = 1e-6 * max(1.0, float(np.abs(found).max()))
            np.testing.assert_allclose(found[:, index], wanted, atol=atol, rtol=1e-5)


def test_the_curvature_is_that_of_priced_slopes(case: tuple[Problem, np.ndarray]) -> None:
    problem, x = case
    count = len(problem.linearised(x).excess)
    random = np.random.default_rng(2)
    multipliers = random.uniform(0.0, 1.0, count) * (random.uniform(size=count) < 0.1)
    found, step = problem.curvature(x, multipliers), 1e-5
    wanted = np.stack(
        [
            multipliers @ (problem.linearised(x + row).slope - problem.linearised(x - row).slope)
            for row in np.eye(len(x)) * step
        ]
    ) / (2 * step)
    wanted = 0.5 * (wanted + wanted.T)
    # Both are differences; what is left out must show: every block is larger than this part of it.
    np.testing.assert_allclose(found, wanted, atol=1e-4 * np.abs(wanted).max())


def test_unknowns_are_what_they_stand_for() -> None:
    task = TASKS["via"]
    problem = Problem(task, np.linspace(0.0, 1.0, 9))
    x = problem.unknowns(_fitted(problem, 1.0), 2.5)
    coefficients = problem.coefficients(x)
    assert problem.duration(x) == 2.5
    assert (coefficients[:5] == task.start).all()
    assert (coefficients[-5:] == task.end).all()
    np.testing.assert_array_equal(problem.unknowns(coefficients, 2.5), x)

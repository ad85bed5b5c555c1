"""The planner's own solver against IPOPT with independent derivatives."""

from dataclasses import replace

import pytest

from cranectl.planning import programs
from cranectl.planning.minimum_time import minimum_time
from cranectl.planning.problem import Task
from tests.planning import ipopt
from tests.planning.tasks import move

FEW = 12  # spans; IPOPT takes ten times as long for 24


@pytest.mark.parametrize(
    "task",
    [move("a"), move("b"), move("c, load of 0.05 m"), move("a", via=((1.0, 0.9, -0.9),))],
    ids=["a", "b", "over a wall", "via"],
)
def test_both_solvers_find_the_same_duration(task: Task) -> None:
    coarse = replace(task, spans=FEW)
    own, other = minimum_time(coarse, programs.solve), minimum_time(coarse, ipopt.solve)
    assert own
    assert other
    # Measured: at most 1e-5 with the same samples, but the added samples differ.
    assert own.duration == pytest.approx(other.duration, rel=1e-3)


def test_a_failure_of_the_solver_yields_no_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ipopt.OPTIONS, "max_iter", 40)
    monkeypatch.setitem(ipopt.OPTIONS, "tol", 1e-30)  # feasible, but not known to be optimal
    assert minimum_time(replace(move("a"), spans=FEW), ipopt.solve) is None

"""The planner's own solver against another with derivatives of another make."""

from dataclasses import replace

import pytest

from cranectl.planning import programs
from cranectl.planning.minimum_time import minimum_time
from cranectl.planning.problem import Task
from tests.planning import ipopt
from tests.planning.tasks import move

FEW = 12  # spans: IPOPT takes a tenth of the time that it does for 24


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
    # Measured: 1e-5 and less, where both sample alike; which samples are added differs.
    assert own.duration == pytest.approx(other.duration, rel=1e-3)


def test_trouble_is_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ipopt.OPTIONS, "max_iter", 40)
    monkeypatch.setitem(ipopt.OPTIONS, "tol", 1e-30)  # feasible by then, and not known to be the best
    assert minimum_time(replace(move("a"), spans=FEW), ipopt.solve) is None

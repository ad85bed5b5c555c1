"""The other ways to write a campaign, to which its speed is compared, move the same cranes."""

import sys
from typing import Any

import numpy as np
import pytest

from cranectl.simulate import simulate_run
from tests.conftest import ROOT

CRANES = 3


@pytest.fixture(scope="module")
def ways() -> Any:
    sys.path.insert(0, str(ROOT / "validation" / "performance"))
    try:
        import other_implementations
    finally:
        sys.path.pop(0)
    other_implementations.OVERRIDES = ["duration=6.001"]  # its path takes 6 s
    return other_implementations


def test_all_ways_end_where_a_run_does(ways: Any) -> None:
    task = ways.Task("lqr+hinf")
    run = simulate_run(task.scenario, plant="mujoco", drive="velocity", design=task.design, plan=task.plan)
    state = run.block("state")[-1]
    end = np.zeros(10)
    end[task.positions], end[5 + task.rates] = state[0::2], state[1::2]
    assert np.abs(run.block("state")[0] - state).max() > 0.4, "it went somewhere"
    for way in (ways.python_loop, ways.batch_loop, ways.rollout_loop):
        cranes = 1 if way is ways.python_loop else CRANES
        assert way(task, cranes) == pytest.approx(np.tile(end, (cranes, 1)), abs=1e-12), way.__name__

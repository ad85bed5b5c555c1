"""The other implementations of a campaign, to which its speed is compared, simulate the same cranes."""

import sys
from typing import Any

import numpy as np
import pytest

from cranectl.simulate import simulate_run
from tests.conftest import ROOT

CRANES = 3


@pytest.fixture(scope="module")
def implementations() -> Any:
    sys.path.insert(0, str(ROOT / "validation" / "performance"))
    try:
        import other_implementations
    finally:
        sys.path.pop(0)
    other_implementations.OVERRIDES = ["duration=6.001"]  # the path of the scenario takes 6 s
    return other_implementations


@pytest.mark.slow
def test_other_implementations_end_in_the_state_of_a_run(implementations: Any) -> None:
    task = implementations.Task("lqr+hinf")
    run = simulate_run(task.scenario, plant="mujoco", drive="velocity", design=task.design, plan=task.plan)
    state = run.block("state")[-1]
    end = np.zeros(10)
    end[task.positions], end[5 + task.rates] = state[0::2], state[1::2]
    assert np.abs(run.block("state")[0] - state).max() > 0.4, "the crane has not moved"
    loops = (implementations.python_loop, implementations.batch_loop, implementations.rollout_loop)
    for loop in loops:
        cranes = 1 if loop is implementations.python_loop else CRANES
        assert loop(task, cranes) == pytest.approx(np.tile(end, (cranes, 1)), abs=1e-12), loop.__name__

"""Test `adrc`: the load has four poles, and a constant disturbance leaves no error.

`tests/controllers/test_observer.py` has the poles of its observers.
"""

from math import sqrt

import numpy as np
import pytest

from tests.benchmark.linear_loop import GRAVITY, PERIOD, loop_matrix
from tests.benchmark.runs import simulate
from validation.benchmark.adrc import ADRC, MEMORY

CONTROLLER = "adrc.py:ADRC"
LENGTH = 0.7
POLE = 0.7 * sqrt(GRAVITY / LENGTH)  # w_c [1/s]


def test_load_poles_with_fast_observers() -> None:
    poles = np.linalg.eigvals(loop_matrix(ADRC, LENGTH, MEMORY.begun, MEMORY.begun, observer=60.0))
    slow = np.sort_complex(np.log(poles) / PERIOD)[-10:]
    np.testing.assert_allclose(np.poly(slow), np.poly([-POLE] * 10), rtol=0.3)
    assert np.abs(np.linalg.eigvals(loop_matrix(ADRC, LENGTH, MEMORY.begun, MEMORY.begun))).max() < 1.0


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_motion_near_rest_agrees_with_poles(plant: str) -> None:
    offset = 1e-2
    rest = ["duration=4.0", "disturbances=[]", f"initial.load_offset=[{offset}, 0.0, {offset}]"]
    run = simulate(CONTROLLER, *rest, "controller.adrc.observer=60.0", plant=plant)
    wt, error = POLE * run.time, -run.block("error")
    expected = offset * (1.0 + wt + wt**2 / 2.0 + wt**3 / 6.0) * np.exp(-wt)
    np.testing.assert_allclose(error[:, 0], expected, atol=0.03 * offset)
    np.testing.assert_allclose(error[:, 2], offset * (1.0 + wt) * np.exp(-wt), atol=0.03 * offset)


@pytest.mark.parametrize(
    ("plant", "drive", "effects"),
    [("analytic", "ideal", []), ("mujoco", "velocity", []), ("mujoco", "velocity", ["effects.sensing={}"])],
)
def test_constant_disturbance_is_estimated_and_leaves_no_error(
    plant: str, drive: str, effects: list[str]
) -> None:
    """It leans the rope by b, so f_z = g b at rest, while b'' = f_b = 0."""
    run = simulate(CONTROLLER, *effects, plant=plant, drive=drive)
    late = run.time > 24.0
    state = run.block("state")[late].mean(axis=0)
    estimate = run.block("controller")[late].mean(axis=0)
    assert min(abs(state[[6, 8]])) > 0.05
    np.testing.assert_allclose(estimate[:2], GRAVITY * state[[8, 6]], rtol=5e-3)
    np.testing.assert_allclose(estimate[2:], 0.0, atol=5e-3)
    limit = 1e-4 if effects else 1e-6  # encoders read angles in steps
    assert np.abs(run.block("error")[late, :3].mean(axis=0)).max() < limit

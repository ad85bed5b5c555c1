"""Test `sliding-mode-observer`: time to reach its layer, poles in it, error of a constant disturbance."""

from math import exp, log, sqrt

import numpy as np
import pytest

from cranectl.controllers.observer import EXPECTED
from cranectl.support.arrays import Array
from tests.benchmark.linear_loop import (
    GRAVITY,
    PERIOD,
    filter_poles,
    loop_matrix,
    regulator_poles,
    relative_distances,
)
from tests.benchmark.runs import at_rest, simulate
from validation.benchmark.sliding_mode import MEMORY, SLIDING_MODE_OBSERVER

CONTROLLER = "sliding_mode.py:SLIDING_MODE_OBSERVER"
LENGTH = 0.7
POLE = sqrt(GRAVITY / LENGTH)  # [1/s]
SLOPE, SWAY_SLOPE = 0.19245 * POLE, 1.5396 * POLE * LENGTH  # lambda [1/s], kappa [m/s]
REACH, SWITCH, LAYER = 2.0 * POLE, 0.05 * GRAVITY, 0.02 * POLE * LENGTH  # W [1/s], K [m/s²], phi [m/s]
LAYER_POLE = REACH + SWITCH / LAYER  # [1/s], decay of s in the layer
DECAY = exp(-10.0 * POLE * PERIOD)  # of the observer's error over a sample
GAIN = np.array([[1.0 - DECAY**2], [(1.0 - DECAY) ** 2 / PERIOD]])


def crane() -> tuple[Array, Array, Array]:
    """Return A and b of (e, e', b, b'), and the gain of the controller in its layer."""
    a = np.diag([1.0, 0.0, 1.0], 1)
    a[3, 2] = -GRAVITY / LENGTH
    gain = [LAYER_POLE * SLOPE, SLOPE + LAYER_POLE, -LAYER_POLE * SWAY_SLOPE, -SWAY_SLOPE]
    return a, np.array([0.0, 1.0, 0.0, -1.0 / LENGTH]), np.array(gain)


def test_poles_in_layer_are_those_of_surface_and_layer() -> None:
    a, b, gain = crane()
    expected = np.poly([-POLE / sqrt(3.0)] * 3 + [-LAYER_POLE])
    np.testing.assert_allclose(np.poly(a - np.outer(b, gain)), expected, rtol=1e-4)


def test_loop_poles_are_those_of_controller_and_observer() -> None:
    a, b, gain = crane()
    drive, pendulum = np.diag([1.0], 1), np.array([[0.0, 1.0], [-GRAVITY / LENGTH, 0.0]])
    rope = regulator_poles(
        drive, np.array([0.0, 1.0]), np.array([LAYER_POLE * POLE, LAYER_POLE + POLE]), PERIOD
    )
    axis = regulator_poles(a, b, gain, PERIOD)
    observer = [filter_poles(chain, np.eye(2)[:1], GAIN, PERIOD) for chain in [drive] * 3 + [pendulum] * 2]
    np.testing.assert_allclose(observer[0], DECAY, rtol=1e-6)
    expected = np.concatenate([axis, axis, rope, *observer])
    poles = np.linalg.eigvals(loop_matrix(SLIDING_MODE_OBSERVER, LENGTH, MEMORY.begun, EXPECTED.disturbance))
    assert relative_distances(poles, expected).max() < 1e-2  # rounding splits multiple poles


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_layer_is_reached_in_finite_time_and_kept(plant: str) -> None:
    """Outside the layer s' = -W s - K for any angle, and inside s' = -(W + K/phi) s."""
    offset, drift = 0.4, SWITCH / REACH
    run = simulate(CONTROLLER, *at_rest(LENGTH, offset, 10.0), plant=plant)
    surface, t = run.block("controller")[:, 0], run.time
    start = SLOPE * offset
    assert start > 2.0 * LAYER
    reached = log((start + drift) / (LAYER + drift)) / REACH
    outside = (start + drift) * np.exp(-REACH * t) - drift
    inside = LAYER * np.exp(-LAYER_POLE * (t - reached))
    # Sampling with period T changes a decay with rate k by a factor of about 1 + k T/2.
    limit = 0.5 * PERIOD * LAYER_POLE * start
    np.testing.assert_allclose(surface, np.where(t < reached, outside, inside), atol=limit)
    assert np.linalg.norm(run.block("error")[-1, :3]) < 1e-3


@pytest.mark.parametrize(("plant", "drive"), [("analytic", "ideal"), ("mujoco", "velocity")])
def test_constant_disturbance_leaves_predicted_error(plant: str, drive: str) -> None:
    """The observer does not know the disturbance, so its angle lags by r, and so does its rate."""
    run = simulate(CONTROLLER, plant=plant, drive=drive)
    state, disturbance = run.block("state")[-1], 1.0
    lag = disturbance * PERIOD**2 / (1.0 - DECAY) ** 2
    rate = 0.5 * PERIOD * disturbance - GAIN[0, 0] * lag / PERIOD
    for joint, angle, start in ((0, 8, 1.0), (2, 6, 0.77)):
        surface = SWAY_SLOPE * rate / LAYER_POLE  # the value at which u is zero
        lean = state[angle] - DECAY**2 * lag
        expected = (SWAY_SLOPE * lean + surface) / SLOPE
        assert state[joint] - start == pytest.approx(expected, rel=2e-2)

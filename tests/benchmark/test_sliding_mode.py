"""Test `sliding-mode-observer`: time to reach its layer, poles in it, error of a constant disturbance."""

from math import exp, log, sqrt

import numpy as np
import pytest

from cranectl import open_controller
from cranectl.controllers.observer import EXPECTED
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.support.arrays import Array
from tests.benchmark.linear_loop import (
    GRAVITY,
    PERIOD,
    filtered,
    loop_matrix,
    regulated,
    relative_distances,
)
from tests.conftest import ROOT
from validation.benchmark.sliding_mode import MEMORY, SLIDING_MODE_OBSERVER

LAW = f"{ROOT / 'validation' / 'benchmark' / 'sliding_mode.py'}:SLIDING_MODE_OBSERVER"
LENGTH = 0.7
POLE = sqrt(GRAVITY / LENGTH)  # [1/s]
SLOPE, SWAY_SLOPE = 0.19245 * POLE, 1.5396 * POLE * LENGTH  # lambda [1/s], kappa [m/s]
REACH, SWITCH, LAYER = 2.0 * POLE, 0.05 * GRAVITY, 0.02 * POLE * LENGTH  # W [1/s], K [m/s²], phi [m/s]
INSIDE = REACH + SWITCH / LAYER  # [1/s]
DECAY = exp(-10.0 * POLE * PERIOD)  # of the observer's error over a sample
GAIN = np.array([[1.0 - DECAY**2], [(1.0 - DECAY) ** 2 / PERIOD]])


def run_of(*overrides: str, plant: str = "analytic", drive: str = "ideal") -> Run:
    scenario = load_scenario("fixed-position", overrides=overrides)
    return simulate_run(scenario, plant=plant, drive=drive, controller=open_controller(LAW))


def crane() -> tuple[Array, Array, Array]:
    """Return A and b of (e, e', b, b'), and the gain of the controller in its layer."""
    a = np.diag([1.0, 0.0, 1.0], 1)
    a[3, 2] = -GRAVITY / LENGTH
    gain = [INSIDE * SLOPE, SLOPE + INSIDE, -INSIDE * SWAY_SLOPE, -SWAY_SLOPE]
    return a, np.array([0.0, 1.0, 0.0, -1.0 / LENGTH]), np.array(gain)


def test_in_the_layer_the_poles_are_three_on_the_surface_and_that_of_the_layer() -> None:
    a, b, gain = crane()
    expected = np.poly([-POLE / sqrt(3.0)] * 3 + [-INSIDE])
    np.testing.assert_allclose(np.poly(a - np.outer(b, gain)), expected, rtol=1e-4)


def test_the_poles_of_the_loop_are_those_of_law_and_observer() -> None:
    a, b, gain = crane()
    drive, pendulum = np.diag([1.0], 1), np.array([[0.0, 1.0], [-GRAVITY / LENGTH, 0.0]])
    rope = regulated(drive, np.array([0.0, 1.0]), np.array([INSIDE * POLE, INSIDE + POLE]), PERIOD)
    axis = regulated(a, b, gain, PERIOD)
    observer = [filtered(chain, np.eye(2)[:1], GAIN, PERIOD) for chain in [drive] * 3 + [pendulum] * 2]
    np.testing.assert_allclose(observer[0], DECAY, rtol=1e-6)
    expected = np.concatenate([axis, axis, rope, *observer])
    poles = np.linalg.eigvals(loop_matrix(SLIDING_MODE_OBSERVER, LENGTH, MEMORY.begun, EXPECTED.disturbance))
    assert relative_distances(poles, expected).max() < 1e-2  # rounding splits multiple poles


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_the_layer_is_reached_in_finite_time_and_kept(plant: str) -> None:
    """Outside the layer s' = -W s - K for any angle, and inside s' = -(W + K/phi) s."""
    offset, at_rest = 0.4, SWITCH / REACH
    overrides = ["duration=10.0", "disturbances=[]", f"initial.load_offset=[{offset}, 0.0, 0.0]"]
    run = run_of(*overrides, plant=plant)
    surface, t = run.block("controller")[:, 0], run.time
    start = SLOPE * offset
    assert start > 2.0 * LAYER
    reached = log((start + at_rest) / (LAYER + at_rest)) / REACH
    outside = (start + at_rest) * np.exp(-REACH * t) - at_rest
    inside = LAYER * np.exp(-INSIDE * (t - reached))
    # Sampling every T changes a decay with rate k by a share of k T/2.
    limit = 0.5 * PERIOD * INSIDE * start
    np.testing.assert_allclose(surface, np.where(t < reached, outside, inside), atol=limit)
    assert np.linalg.norm(run.block("error")[-1, :3]) < 1e-3


@pytest.mark.parametrize(("plant", "drive"), [("analytic", "ideal"), ("mujoco", "velocity")])
def test_a_constant_disturbance_leaves_what_surface_and_observer_say(plant: str, drive: str) -> None:
    """The observer does not know the disturbance: its angle is late by r, and its rate accordingly."""
    run = run_of(plant=plant, drive=drive)
    state, push = run.block("state")[-1], 1.0
    late = push * PERIOD**2 / (1.0 - DECAY) ** 2
    rate = 0.5 * PERIOD * push - GAIN[0, 0] * late / PERIOD
    for joint, angle, start in ((0, 8, 1.0), (2, 6, 0.77)):
        surface = SWAY_SLOPE * rate / INSIDE  # the value at which u is zero
        lean = state[angle] - DECAY**2 * late
        expected = (SWAY_SLOPE * lean + surface) / SLOPE
        assert state[joint] - start == pytest.approx(expected, rel=2e-2)

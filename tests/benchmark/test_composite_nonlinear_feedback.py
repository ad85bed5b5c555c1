"""Test `cnf`: its Lyapunov function falls, damping rises near the target, and overshoot shrinks."""

from math import exp, sqrt

import numpy as np
import pytest

from cranectl.simulate import Run
from cranectl.support.arrays import Array
from tests.benchmark.runs import simulate
from validation.benchmark.composite_nonlinear_feedback import WEIGHTS, linear_part

CONTROLLER = "composite_nonlinear_feedback.py:CNF"
FREQUENCY, RATIO, STRENGTH, SHARPNESS = 0.4, 0.3, 0.8, 2.0  # its defaults
MAX_RHO = STRENGTH * (1.0 - exp(-SHARPNESS))
GRAVITY, LENGTH, STEP = 9.81, 0.7, 0.7
FREQUENCY_UNIT = sqrt(GRAVITY / LENGTH)  # [1/s]
LIMIT = 4.0 / GRAVITY  # of the laboratory's drives


def point_to_point(*overrides: str, plant: str = "analytic") -> Run:
    """Simulate a move from rest to a set-point along x, with a rope of constant length."""
    rest = ["duration=15.0", "disturbances=[]", f"initial.load_offset=[{-STEP}, 0.0, 0.0]"]
    return simulate(CONTROLLER, *rest, *overrides, plant=plant)


def axis_states(run: Run) -> Array:
    """Return states (N, 4) of the x axis relative to the set-point, in units of l and sqrt(l/g)."""
    state = run.block("state")
    units = [LENGTH, LENGTH * FREQUENCY_UNIT, 1.0, FREQUENCY_UNIT]
    return (state[:, [0, 1, 8, 9]] - [1.0, 0.0, 0.0, 0.0]) / units


@pytest.mark.parametrize(("frequency", "ratio"), [(0.4, 0.3), (0.2, 0.2), (1.0, 0.9)])
def test_linear_part_has_its_poles_and_a_lyapunov_function(frequency: float, ratio: float) -> None:
    closed, _, _, cost = linear_part(frequency, ratio)
    slow, fast = [1.0, 2.0 * ratio * frequency, frequency**2], [1.0, 1.4, 1.0]
    np.testing.assert_allclose(np.poly(closed), np.polymul(slow, fast), rtol=1e-9)
    np.testing.assert_allclose(
        closed.T @ cost + cost @ closed, -np.diag(WEIGHTS), atol=1e-9 * np.abs(cost).max()
    )
    assert np.linalg.eigvalsh(cost).min() > 0.0


def test_damping_rises_as_rho_falls() -> None:
    closed, b, _, cost = linear_part(FREQUENCY, RATIO)

    def least_damping(rho: float) -> float:
        poles = np.linalg.eigvals(closed + rho * np.outer(b, b @ cost))
        return float((-poles.real / np.abs(poles)).min())

    ratios = np.array([least_damping(-rho) for rho in np.linspace(0.0, MAX_RHO, 30)])
    assert ratios[0] == pytest.approx(RATIO)
    assert np.diff(ratios).min() > 0.0
    assert ratios[-1] > 0.7


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_rho_stays_in_its_bounds_while_lyapunov_function_falls(plant: str) -> None:
    run = point_to_point(plant=plant)
    rho, states = run.block("controller")[:, 0], axis_states(run)
    assert rho[0] == pytest.approx(0.0, abs=1e-12)
    assert rho[-1] == pytest.approx(-MAX_RHO, rel=1e-2)
    assert -MAX_RHO <= rho.min() <= rho.max() <= 0.0
    _, _, gain, cost = linear_part(FREQUENCY, RATIO)
    assert np.abs(states @ gain).max() < LIMIT
    function = np.einsum("ki,ij,kj->k", states, cost, states)
    moving = function > 1e-4 * function[0]
    assert np.diff(function)[moving[:-1]].max() < 0.0
    assert not moving[-1]


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_overshoot_is_smaller_than_that_of_linear_part(plant: str) -> None:
    small = "rig.effects.limits.acceleration=[0.8, 0.8, 6.0]"
    runs = [point_to_point(small, *more, plant=plant) for more in ((), ("controller.cnf.strength=0.0",))]
    overshoots = [(-run.block("error")[:, 0]).max() for run in runs]
    for run in runs:
        assert np.abs(run.block("input")[:, 0]).max() == pytest.approx(0.8)
    assert overshoots[1] > 0.1 * STEP
    assert overshoots[0] < 0.5 * overshoots[1]


def test_constant_disturbance_leaves_predicted_error() -> None:
    """The crane rests where F x + rho B'P x is zero, with the rope's lean in x."""
    run = simulate(CONTROLLER)
    _, b, gain, cost = linear_part(FREQUENCY, RATIO)
    rho, state = run.block("controller")[-1, 0], axis_states(run)[-1]
    row = gain + rho * (b @ cost)
    assert state[2] == pytest.approx(np.arcsin(LENGTH / GRAVITY), rel=1e-2)
    assert state[0] == pytest.approx(-row[2] / row[0] * state[2], rel=1e-2)
    assert abs(state[0] + state[2]) > 0.1

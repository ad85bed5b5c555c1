"""Test `model-reference`: its error to the model falls and stays bounded; errors of disturbances."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.support.arrays import Array
from cranectl.support.jit import jit
from tests.benchmark.runs import simulate
from tests.controllers.own_controllers import known
from validation.benchmark.model_reference import MODEL_REFERENCE, model_and_cost, step

CONTROLLER = "model_reference.py:MODEL_REFERENCE"
POLE, BOUND, LAYER = 0.7, 0.05, 0.05  # its defaults
GRAVITY, LENGTH = 9.81, 0.7
FREQUENCY_UNIT = sqrt(GRAVITY / LENGTH)  # [1/s]
UNITS = np.array([LENGTH, LENGTH * FREQUENCY_UNIT, 1.0, FREQUENCY_UNIT])  # of the model's four numbers
DISTURBANCE = 0.3  # [m/s²] of the bridge

_step = jit(step)


def disturbed_step(parameters, measured, reference, memory, command):  # type: ignore[no-untyped-def]
    """Compute the controller's step, and add DISTURBANCE to the acceleration of the bridge."""
    status = _step(parameters, measured, reference, memory, command)
    command[0] += DISTURBANCE
    return status


def error_at_rest(drive_disturbance: float, load_disturbance: float) -> Array:
    """Return the error (4,) at rest under constant disturbances of drive [g] and angle [g/l]."""
    _, b, gain, cost = model_and_cost(POLE)

    def residual(drive: float) -> tuple[float, Array]:
        error = np.array([drive, 0.0, load_disturbance, 0.0])
        sigma = b @ cost @ error
        return drive_disturbance - gain @ error - BOUND * sigma / (abs(sigma) + LAYER), error

    return residual(brentq(lambda drive: residual(drive)[0], -5.0, 5.0, xtol=1e-12))[1]


@pytest.mark.parametrize("pole", [0.3, 0.7, 2.0])
def test_model_has_its_poles_and_a_lyapunov_function(pole: float) -> None:
    closed, _, _, cost = model_and_cost(pole)
    np.testing.assert_allclose(np.poly(closed), np.poly([-pole] * 4), rtol=1e-12)
    np.testing.assert_allclose(closed.T @ cost + cost @ closed, -np.eye(4), atol=1e-9 * np.abs(cost).max())
    assert np.linalg.eigvalsh(cost).min() > 0.0


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_undisturbed_crane_moves_as_the_model(plant: str) -> None:
    offset = 1e-2
    overrides = ["duration=4.0", "disturbances=[]", f"initial.load_offset=[{offset}, 0.0, 0.0]"]
    run = simulate(CONTROLLER, *overrides, plant=plant)
    closed, start = model_and_cost(POLE)[0], np.array([offset / LENGTH, 0.0, 0.0, 0.0])
    for k in (0, 300, 1000, 3000):
        expected = expm(FREQUENCY_UNIT * run.time[k] * closed) @ start
        deviation = (run.block("state")[k, [0, 1, 8, 9]] - [1.0, 0.0, 0.0, 0.0]) / UNITS
        np.testing.assert_allclose(deviation, expected, atol=5e-3 * start[0])
    assert np.abs(run.block("controller")[:, :4] / UNITS).max() < 1e-3 * start[0]


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_lyapunov_function_falls_after_a_pulse_down_to_its_bound(plant: str) -> None:
    pulse = '[{joint="beta", start=0.5, end=0.7, magnitude=4.0}]'
    run = simulate(CONTROLLER, "duration=8.0", f"disturbances={pulse}", plant=plant)
    cost = model_and_cost(POLE)[3]
    error = run.block("controller")[:, :4] / UNITS
    function = np.einsum("ki,ij,kj->k", error, cost, error)
    outside = (error**2).sum(axis=1) > 2.0 * BOUND * LAYER
    after = run.time > 0.71
    assert np.count_nonzero(outside & after) > 100
    assert np.diff(function)[(outside & after)[:-1]].max() < 0.0
    assert function[-1] < 1e-3 * function[after].max()


def test_matched_disturbance_leaves_predicted_error_within_bound() -> None:
    scenario = load_scenario("fixed-position", overrides=["disturbances=[]"])
    with known(replace(MODEL_REFERENCE, name="disturbed", step=disturbed_step)) as name:
        run = simulate_run(scenario, plant="analytic", drive="ideal", controller=name)
    error = run.block("controller")[:, :4] / UNITS
    expected = error_at_rest(DISTURBANCE / GRAVITY, 0.0)
    np.testing.assert_allclose(error[-1], expected, atol=1e-3 * abs(expected[0]))
    cost = model_and_cost(POLE)[3]
    function = np.einsum("ki,ij,kj->k", error, cost, error)
    assert DISTURBANCE / GRAVITY < BOUND
    assert function.max() < 2.0 * BOUND * LAYER * np.linalg.eigvalsh(cost).max()
    # Without the robust term, the error would be twice this limit.
    assert abs(expected[0]) < 0.5 * DISTURBANCE / GRAVITY / POLE**4


@pytest.mark.parametrize(("plant", "drive"), [("analytic", "ideal"), ("mujoco", "velocity")])
def test_constant_disturbance_of_load_leaves_predicted_error(plant: str, drive: str) -> None:
    run = simulate(CONTROLLER, plant=plant, drive=drive)
    error = run.block("controller")[-1, :4] / UNITS
    expected = error_at_rest(0.0, np.arcsin(LENGTH / GRAVITY))
    np.testing.assert_allclose(error, expected, atol=2e-2 * abs(expected[0]))
    assert abs(expected[0] + expected[2]) > 0.01, "an error of the load remains"

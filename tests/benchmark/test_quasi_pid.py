"""Test `quasi-pid`: bound of its force, rate of its Lyapunov function, error of a constant disturbance."""

import numpy as np
import pytest

from tests.benchmark.mechanics import energy_above_rest, integral
from tests.benchmark.runs import simulate

CONTROLLER = "quasi_pid.py:QUASI_PID"
RECORD = "workspace.on_exit='record'"
MOVE = "reference.segments=[{kind='line', to=[1.6, 1.2, -0.7], duration=2.0}]"
DRIVES, LENGTH, GRAVITY = [0, 2], 0.7, 9.81  # indices of bridge and trolley in the state
FREQUENCY_UNIT = np.sqrt(GRAVITY / LENGTH)
WEIGHT = GRAVITY * np.array([9.5, 3.5])  # [N] of bridge, trolley and load, and of trolley and load


@pytest.mark.parametrize("integral_gain", [0.0, 0.01])
@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_lyapunov_function_has_derived_rate_and_falls_without_integral(
    plant: str, integral_gain: float
) -> None:
    setting = f"controller.quasi-pid.integral={integral_gain}"
    run = simulate(CONTROLLER, RECORD, "disturbances=[]", MOVE, setting, plant=plant, drive="force")
    numbers, state, summed = run.design.parameters, run.block("state"), run.block("controller")[:, :2]
    error, rate = (state[:, DRIVES] - [1.6, 1.2]) / LENGTH, state[:, [1, 3]] / (FREQUENCY_UNIT * LENGTH)
    cross = numbers["cross"]
    summed = np.vstack([[0.0, 0.0], summed[:-1]])  # a step logs the sum for the next sample
    integral_term = cross * (cross * error + summed)
    potential = numbers["spring"] * np.log(np.cosh(error)) + integral_gain / cross**2 * np.log(
        np.cosh(integral_term)
    )
    v = energy_above_rest(run, state[:, 1::2]) + LENGTH * potential @ WEIGHT
    damper = numbers["damper"] + numbers["swing"] * np.tanh(state[:, [9, 7]] / FREQUENCY_UNIT) ** 2
    power = damper * rate * np.tanh(rate) - integral_gain / cross * np.tanh(integral_term) * np.tanh(error)
    dissipated = integral(run, FREQUENCY_UNIT * LENGTH * power @ WEIGHT)
    assert np.abs(v + dissipated - v[0]).max() < 5e-3 * v[0]
    assert np.abs(state[:, [6, 8]]).max() > 0.1, "the load swings"
    if integral_gain == 0.0:
        assert np.diff(v).max() < 1e-9 * v[0]


def test_force_is_bounded_for_any_target() -> None:
    far = "reference.segments=[{kind='line', to=[100.0, -50.0, -0.7], duration=20.0}]"
    ranges = ["rig.bridge_range=[-2000.0, 2000.0]", "rig.trolley_range=[-2000.0, 2000.0]"]
    run = simulate(CONTROLLER, RECORD, "duration=20.0", "disturbances=[]", far, *ranges, drive="force")
    numbers = run.design.parameters
    bound = sum(numbers[name] for name in ("spring", "damper", "swing", "integral")) * WEIGHT
    force = np.abs(run.block("command")[:, :2])
    assert (force < bound).all()
    assert (force.max(axis=0) > 0.1 * WEIGHT).all()


def test_constant_disturbance_leaves_no_error_of_drive() -> None:
    """The leaning rope pulls with 0.7 N, and the integral can hold 5.6 and 2.1 N."""
    run = simulate(CONTROLLER, RECORD, "duration=200.0", "controller.quasi-pid.integral=0.06")
    state = run.block("state")
    assert np.abs(run.block("disturbance")[-1]).max() > 0.1
    assert np.abs(state[-1, DRIVES] - [1.0, 0.77]).max() < 1e-2

"""Test `lqg`: poles are those of regulator and filter, and a constant disturbance leaves no error."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from cranectl.metrics import run_metrics
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError
from cranectl.support.jit import jit
from tests.benchmark.linear_loop import (
    GRAVITY,
    PERIOD,
    filter_poles,
    loop_matrix,
    nominal_at,
    regulator_poles,
    relative_distances,
)
from tests.benchmark.runs import FOLDER, at_rest, simulate
from tests.controllers.own_controllers import known
from validation.benchmark.lqg import LQG, MEMORY, kalman, prepare, regulator, step

CONTROLLER = "lqg.py:LQG"

_step = jit(step)


def disturbed_step(parameters, measured, reference, memory, command):  # type: ignore[no-untyped-def]
    """Compute the controller's step, and add a constant acceleration of the drives [m/s²]."""
    status = _step(parameters, measured, reference, memory, command)
    command[0] += 0.3
    command[1] -= 0.2
    command[2] += 0.1
    return status


@pytest.mark.parametrize("length", [0.2, 0.725, 1.4])
def test_loop_poles_are_those_of_regulator_and_filter(length: float) -> None:
    period = PERIOD * sqrt(GRAVITY / length)  # in units of sqrt(l/g)
    gain, rope_gain = regulator(5.0, 0.7)
    a, c, filter_gain, rope_filter = kalman(5.0, 2.0)

    drive = np.array([0.0, 1.0, 0.0, -1.0])
    axis = [
        regulator_poles(a[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])], drive, gain, period),
        filter_poles(a, c, period * filter_gain, period),
    ]
    rope = [
        regulator_poles(np.diag([1.0], 1), drive[:2], rope_gain, period),
        filter_poles(np.diag([1.0, 1.0], 1), np.eye(3)[:1], period * rope_filter[:, np.newaxis], period),
    ]
    expected = np.concatenate([*axis, *axis, *rope])
    poles = np.linalg.eigvals(loop_matrix(LQG, length, MEMORY.begun, MEMORY.flat))
    # The filter predicts by a method of order 2.
    assert relative_distances(poles, expected).max() < 1e-4
    assert np.abs(expected).max() < 1.0


def test_rope_filter_has_poles_of_chosen_modulus() -> None:
    """For q''' = noise the poles form a Butterworth pattern."""
    rope = kalman(7.0, 5.0)[3]
    poles = np.linalg.eigvals(np.diag([1.0, 1.0], 1) - np.outer(rope, [1.0, 0.0, 0.0]))
    np.testing.assert_allclose(np.sort_complex(poles), 7.0 * np.exp(2j * np.pi / 6 * np.array([3, 4, 2])))


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_motion_near_rest_agrees_with_loop(plant: str) -> None:
    offset = 1e-3
    run = simulate(CONTROLLER, *at_rest(0.7, offset, 3.0), plant=plant)
    deviation = np.zeros(25)
    deviation[0] = deviation[10] = offset
    matrix, state = loop_matrix(LQG, 0.7, MEMORY.begun, MEMORY.flat), run.block("state")
    for k in (300, 1000, 2500):
        expected = np.linalg.matrix_power(matrix, k) @ deviation
        assert state[k, 0] - 1.0 == pytest.approx(expected[0], abs=2e-3 * offset)
        assert state[k, 8] == pytest.approx(expected[8], abs=2e-3 * offset)


@pytest.mark.parametrize(
    ("plant", "drive", "effects"),
    [("analytic", "ideal", []), ("mujoco", "velocity", []), ("mujoco", "velocity", ["effects.sensing={}"])],
)
def test_constant_disturbance_leaves_no_error(plant: str, drive: str, effects: list[str]) -> None:
    run = simulate(CONTROLLER, *effects, plant=plant, drive=drive)
    late = run.time > 22.0
    assert np.abs(run.block("disturbance")[-1]).min() > 0.1
    limit = 1e-4 if effects else 1e-6  # encoders read angles in steps
    assert np.abs(run.block("error")[late, :3].mean(axis=0)).max() < limit
    np.testing.assert_allclose(run.block("controller")[late, :2].mean(axis=0), [1.0, 1.0], rtol=1e-2)


def test_constant_disturbance_of_drives_leaves_no_error() -> None:
    scenario = load_scenario("fixed-position", overrides=["disturbances=[]", "duration=15.0"])
    with known(replace(LQG, name="disturbed", step=disturbed_step)) as name:
        run = simulate_run(scenario, plant="analytic", drive="ideal", controller=name)
    error = np.linalg.norm(run.block("error")[:, :3], axis=1)
    assert error.max() > 1e-3
    assert error[-1] < 1e-6


def test_filter_too_fast_for_the_period_is_refused() -> None:
    with pytest.raises(InputError, match="'lqg' is unstable when sampled"):
        prepare(nominal_at(LQG, 0.7, drive_filter=500.0))


@pytest.mark.parametrize(
    ("sway_filter", "effects", "is_settled"),
    [("5.026", (), True), ("5.026", ("body",), False), ("2.0", ("body",), True)],
)
def test_fast_filter_excites_a_load_that_turns(
    sway_filter: str, effects: tuple[str, ...], is_settled: bool
) -> None:
    """As docs/reference/standings.md explains the failures of the tuned numbers at the harbour."""
    numbers = {"error_weight": "2.614", "rate_weight": "0.376", "drive_filter": "5.383"}
    settings = {**numbers, "sway_filter": sway_filter}
    numbers = [f"controller.lqg.{name}={value}" for name, value in settings.items()]
    shown = [f"effects.{effect}={{}}" for effect in ("limits", "sensing", "rope", "delay", *effects)]
    harbour = str(FOLDER / "scenarios" / "harbour.toml")
    run = simulate(
        CONTROLLER, "duration=60", *numbers, *shown, scenario=harbour, plant="mujoco", drive="velocity"
    )
    assert (run_metrics(run).settling_time_s is not None) is is_settled

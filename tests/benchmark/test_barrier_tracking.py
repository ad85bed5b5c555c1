"""Test `barrier-tracking`: its Lyapunov function changes as derived, and errors stay within the bound."""

import numpy as np
import pytest

from cranectl.simulate import Run
from tests.benchmark.mechanics import energy_above_rest, integral, rope_directions
from tests.benchmark.runs import SHORT_STEPS, simulate
from validation.benchmark.barrier_tracking import barrier_force

CONTROLLER = "barrier_tracking.py:BARRIER_TRACKING"
SIGN = np.array([1.0, 1.0, -1.0])  # the desired rope length is minus the desired height of the load


def bound_of(run: Run) -> float:
    return run.design.parameters["bound"] * run.block("state")[0, 4]


def errors(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of the drives and their rates, (N, 3) each."""
    state = run.block("state")
    return (state[:, 0:6:2] - SIGN * run.reference[:, 0:3], state[:, 1:6:2] - SIGN * run.reference[:, 3:6])


def lyapunov(run: Run) -> np.ndarray:
    rig, numbers = run.scenario.rig, run.design.parameters
    e, e_rate = errors(run)
    stiffness = rig.driven_masses * numbers["frequency"] ** 2 * rig.gravity / run.block("state")[0, 4]
    bound = bound_of(run)
    barrier = 0.5 * numbers["barrier"] * bound**2 * e**2 / (bound**2 - e**2)
    rates = np.hstack([e_rate, run.block("state")[:, 7::2]])
    return energy_above_rest(run, rates) + (0.5 * e**2 + barrier) @ stiffness


def losses(run: Run) -> np.ndarray:
    """Return the power of the dampers [W]."""
    rig, numbers, length = run.scenario.rig, run.design.parameters, run.block("state")[0, 4]
    rate, pace = errors(run)[1], np.sqrt(rig.gravity / length)
    soft = 0.01 * np.sqrt(rig.gravity * length)
    viscous = 2.0 * numbers["damping"] * numbers["frequency"] * pace * rate**2
    return (viscous + numbers["friction"] * rig.gravity * rate * np.tanh(rate / soft)) @ rig.driven_masses


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_lyapunov_function_has_derived_rate_while_hoisting(plant: str) -> None:
    offsets = ["initial.load_offset=[0.1, -0.1, 0.0]", "initial.alpha_offset=0.4", "initial.beta_offset=-0.3"]
    steps = [*SHORT_STEPS, "workspace.on_exit='record'"]
    scenario = {"scenario": "fast-diagonal", "plant": plant, "drive": "force"}
    run = simulate(CONTROLLER, "disturbances=[]", *offsets, *steps, **scenario)
    rig, (n, n_rate), length = run.scenario.rig, rope_directions(run), run.block("state")[:, 4]
    pay_out, path = -run.reference[:, 5], run.reference[:, 6:8]
    hoisted = pay_out * (rig.gravity * (1.0 + n[:, 2]) - length * (n_rate**2).sum(axis=1))
    power = rig.load_mass * (hoisted - length * (n_rate[:, :2] * path).sum(axis=1))
    v = lyapunov(run)
    assert np.abs(v - v[0] - integral(run, power - losses(run))).max() < 1e-3 * v[0]
    assert integral(run, np.abs(power))[-1] > 0.1 * v[0], "the path supplies power"
    assert np.diff(v[run.time > 3.0]).max() < 0.0
    assert np.abs(errors(run)[0]).max() < bound_of(run)


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_barrier_keeps_error_within_bound(plant: str) -> None:
    """Under this disturbance the spring alone would let the trolley move by more than the bound Z."""
    disturbances = (
        "disturbances=[{joint='alpha', start=1.0, magnitude=4.0}, {joint='beta', start=1.0, magnitude=4.0}]"
    )
    settings = [f"controller.barrier-tracking.{setting}" for setting in ("frequency=0.4", "bound=0.1")]
    for barrier in (0.0, 0.3):
        share = f"controller.barrier-tracking.barrier={barrier}"
        run = simulate(
            CONTROLLER, "duration=8.0", disturbances, *settings, share, plant=plant, drive="velocity"
        )
        largest = np.abs(errors(run)[0]).max(axis=0)
        assert (largest[1] > bound_of(run)) == (barrier == 0.0)


def test_constant_disturbance_leaves_predicted_error() -> None:
    run = simulate(CONTROLLER, "duration=80.0")
    late = run.time > 70.0
    rig, numbers, n = run.scenario.rig, run.design.parameters, rope_directions(run)[0][late]
    tension = -rig.weight * n[:, 2]
    pull = np.column_stack([tension * n[:, 0], tension * n[:, 1], tension - rig.weight]).mean(axis=0)
    error = errors(run)[0][late].mean(axis=0)
    stiffness = rig.driven_masses * numbers["frequency"] ** 2 * rig.gravity / run.block("state")[0, 4]
    barrier = [
        -barrier_force(numbers["barrier"] * k, bound_of(run), e)
        for k, e in zip(stiffness, error, strict=True)
    ]
    np.testing.assert_allclose(stiffness * error + barrier, pull, rtol=1e-2)
    assert np.abs(error[:2]).max() > 0.01

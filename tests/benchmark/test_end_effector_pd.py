"""Test `end-effector-pd`: its function falls by the damper's work; error of a constant disturbance."""

import numpy as np
import pytest

from cranectl.simulate import Run
from tests.benchmark.mechanics import energy_above_rest, integral, rope_directions
from tests.benchmark.runs import simulate

CONTROLLER = "end_effector_pd.py:END_EFFECTOR_PD"
MOVE = "reference.segments=[{kind='line', to=[1.6, 1.2, -0.7], duration=2.0}]"


def gains(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return k_p, k_d and k of x and y from the descriptions of the parameters."""
    rig, numbers, length = run.scenario.rig, run.design.parameters, run.block("state")[0, 4]
    masses = rig.driven_masses[:2] + rig.load_mass
    frequency = numbers["frequency"] * np.sqrt(rig.gravity / length)
    return (
        frequency**2 * masses,
        2.0 * numbers["damping"] * frequency * masses,
        numbers["lead"] * length * masses[1] / masses,
    )


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_lyapunov_function_falls_by_damping(plant: str) -> None:
    run = simulate(CONTROLLER, "disturbances=[]", MOVE, plant=plant, drive="force")
    rig, state, length = run.scenario.rig, run.block("state"), 0.7
    stiffness, damping, lead = gains(run)
    n, n_rate = rope_directions(run)
    common = lead * (rig.driven_masses[:2] + rig.load_mass)
    np.testing.assert_allclose(common, common[0], rtol=1e-12)
    swing = 0.5 * length * (n_rate**2).sum(axis=1) + rig.gravity * (1.0 + n[:, 2])
    coupled = state[:, [0, 2]] - [1.6, 1.2] - lead * n[:, :2]
    v = energy_above_rest(run, state[:, 1::2]) + common[0] * swing
    v += 0.5 * (coupled**2 @ stiffness - rig.load_mass * length * n_rate[:, :2] ** 2 @ lead)
    dissipated = integral(run, (state[:, [1, 3]] - lead * n_rate[:, :2]) ** 2 @ damping)
    assert np.abs(state[:, 4] - length).max() < 1e-4
    assert np.abs(v + dissipated - v[0]).max() < 2e-3 * v[0]
    assert np.diff(v).max() < 1e-9 * v[0]
    assert v[-1] < 1e-3 * v[0]
    assert np.abs(state[:, [6, 8]]).max() > 0.05, "the load swings"


def test_constant_disturbance_leaves_predicted_error() -> None:
    run = simulate(CONTROLLER, "duration=40.0")
    stiffness, _, lead = gains(run)
    n, _ = rope_directions(run)
    tension = run.scenario.rig.weight * -n[-1, 2]
    error = run.block("state")[-1, [0, 2]] - [1.0, 0.77]
    assert np.abs(error).min() > 0.05
    np.testing.assert_allclose(error, (lead + tension / stiffness) * n[-1, :2], rtol=1e-3)

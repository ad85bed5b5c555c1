"""Test `energy-coupling` and `kinetic-energy-coupling`: functions that fall, error of a disturbance."""

import numpy as np
import pytest

from cranectl.simulate import Run
from tests.benchmark.mechanics import energy_above_rest, integral, rope_directions
from tests.benchmark.runs import simulate

CONTROLLERS = ("energy_coupling.py:ENERGY_COUPLING", "energy_coupling.py:KINETIC_ENERGY_COUPLING")


def gains(run: Run) -> tuple[np.ndarray, np.ndarray, float]:
    """Return K_p, K_d and k_E from the descriptions of the parameters."""
    rig, numbers, length = run.scenario.rig, run.design.parameters, run.block("state")[0, 4]
    frequency = numbers["frequency"] * np.sqrt(rig.gravity / length)
    unit = rig.weight * length if run.design.name == "energy-coupling" else 1.0
    stiffness = frequency**2 * rig.driven_masses
    return stiffness, 2.0 * numbers["damping"] * frequency * rig.driven_masses, numbers["coupling"] / unit


def lyapunov(run: Run, target: np.ndarray) -> np.ndarray:
    stiffness, _, coupling = gains(run)
    state = run.block("state")
    energy = energy_above_rest(run, state[:, 1::2])
    storage = energy**2 / 2.0 if run.design.name == "energy-coupling" else energy
    kinetic = state[:, 1:6:2] ** 2 @ run.scenario.rig.driven_masses
    return coupling * storage + 0.5 * (kinetic + (state[:, 0:6:2] - target) ** 2 @ stiffness)


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_lyapunov_function_falls_by_damping_while_hoisting(controller: str, plant: str) -> None:
    initial_swing = ["initial.alpha_offset=0.6", "initial.beta_offset=-0.5", "workspace.on_exit='record'"]
    run = simulate(
        controller, "disturbances=[]", *initial_swing, scenario="fast-diagonal", plant=plant, drive="force"
    )
    v = lyapunov(run, np.array([1.7, 1.25, 0.5]))
    dissipated = integral(run, run.block("state")[:, 1:6:2] ** 2 @ gains(run)[1])
    assert np.abs(v + dissipated - v[0]).max() < 1e-3 * v[0]
    assert np.diff(v).max() < 1e-9 * v[0]


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_constant_disturbance_leaves_predicted_error(controller: str) -> None:
    """K_p e = -s (w + W), with w + W = S (n - plumb) for a tension S; s is k_E m g l (1 + n_z), or k_E."""
    from_start = [f"disturbances.{k}.start=0.0" for k in range(2)]
    lean = ["initial.alpha_offset=0.0712", "initial.beta_offset=0.0716"]  # a small swing decays too slowly
    run = simulate(controller, "duration=60.0", *from_start, *lean)
    stiffness, _, coupling = gains(run)
    rig, late = run.scenario.rig, run.time > 40.0
    state, n = run.block("state")[late], rope_directions(run)[0][late]
    energy = rig.weight * state[:, 4] * (1.0 + n[:, 2])
    s = coupling * (energy if run.design.name == "energy-coupling" else np.ones(len(n)))
    tension = -rig.weight * n[:, 2]
    pull = np.column_stack([tension * n[:, 0], tension * n[:, 1], tension - rig.weight])
    error = state[:, 0:6:2] - [1.0, 0.77, 0.7]
    np.testing.assert_allclose(
        error.mean(axis=0), (s[:, np.newaxis] * pull).mean(axis=0) / stiffness, rtol=1e-2
    )
    assert np.abs(error[:, :2]).max() > (1e-3 if run.design.name == "energy-coupling" else 0.04)

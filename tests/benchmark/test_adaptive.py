"""Test `adaptive`: its Lyapunov function falls by the work of the damper, for any initial masses."""

import numpy as np
import pytest

from cranectl.model.dynamics import axis_masses, mass_matrix
from cranectl.planning import load_scenario
from cranectl.simulate import Run
from tests.benchmark.mechanics import integral
from tests.benchmark.runs import SHORT_STEPS, simulate

CONTROLLER = "adaptive.py:ADAPTIVE"
WRONG_MASSES = ["rig.bridge_mass=4.0", "rig.trolley_mass=3.5", "rig.load_mass=0.6", "rig.winch_mass=0.5"]


def reduced_mass(state: np.ndarray, run: Run) -> np.ndarray:
    """Return the mass matrix (3, 3) of the drives after the swing is eliminated."""
    mass = mass_matrix(state[0::2], run.scenario.rig)
    return mass[:3, :3] - mass[:3, 3:] @ np.linalg.solve(mass[3:, 3:], mass[3:, :3])


def lyapunov(run: Run, gamma: np.ndarray) -> np.ndarray:
    signals = run.block("controller")
    s, masses = signals[:, 4:7], signals[:, :4]
    kinetic = [
        rate @ reduced_mass(state, run) @ rate for rate, state in zip(s, run.block("state"), strict=True)
    ]
    errors = masses - axis_masses(run.scenario.rig)[:4]
    return 0.5 * (np.array(kinetic) + (errors**2 / gamma).sum(axis=1))


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
@pytest.mark.parametrize("assumed", [WRONG_MASSES, []])
def test_lyapunov_function_falls_by_damping_for_any_initial_masses(plant: str, assumed: list[str]) -> None:
    initial_swing = ["initial.alpha_offset=0.3", "initial.beta_offset=-0.25", "workspace.on_exit='record'"]
    run = simulate(
        CONTROLLER,
        "disturbances=[]",
        *initial_swing,
        *SHORT_STEPS,
        scenario="fast-diagonal",
        assumed=assumed,
        plant=plant,
        drive="force",
    )
    rig = load_scenario("fast-diagonal", overrides=assumed).rig
    numbers, length = run.design.parameters, run.block("state")[0, 4]
    initial_masses = np.array(axis_masses(rig)[:4])
    gamma = numbers["adaptation"] * initial_masses / (rig.gravity * length)
    v = lyapunov(run, gamma)
    s = run.block("controller")[:, 4:7]
    dissipated = integral(run, s**2 @ rig.driven_masses * numbers["gain"] * np.sqrt(rig.gravity / length))
    assert np.abs(v + dissipated - v[0]).max() < 2e-3 * v[0]
    assert np.diff(v).max() < 0.0
    assert run.block("controller")[-1, 3] == pytest.approx(run.scenario.rig.load_mass, rel=1e-3)

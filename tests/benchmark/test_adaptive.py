"""Test `adaptive`: its Lyapunov function falls by the work of the damper, for any initial masses."""

import numpy as np
import pytest

from cranectl import open_controller
from cranectl.model.dynamics import axis_masses, mass_matrix
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from tests.benchmark.mechanics import integral
from tests.conftest import ROOT

CONTROLLER = f"{ROOT / 'validation' / 'benchmark' / 'adaptive.py'}:ADAPTIVE"
WRONG_MASSES = ["rig.bridge_mass=4.0", "rig.trolley_mass=3.5", "rig.load_mass=0.6", "rig.winch_mass=0.5"]


def simulate(scenario: str, *overrides: str, assumed: list[str], plant: str, drive: str = "force") -> Run:
    """Simulate a run whose controller assumes a rig with the settings `assumed`."""
    controller = open_controller(CONTROLLER)
    actual = load_scenario(scenario, overrides=overrides)
    nominal = load_scenario(scenario, overrides=[*overrides, *assumed])
    return simulate_run(actual, nominal=nominal, plant=plant, drive=drive, controller=controller)


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
    short_steps = ["control.period=0.00025", "control.physics_step=0.00025"]
    run = simulate(
        "fast-diagonal", "disturbances=[]", *initial_swing, *short_steps, assumed=assumed, plant=plant
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


def test_constant_disturbance_leaves_predicted_error() -> None:
    run = simulate("fixed-position", "duration=30.0", assumed=[], plant="analytic", drive="ideal")
    state = run.block("state")[-1]
    assert np.abs(run.block("disturbance")[-1]).max() > 0.1
    for joint, angle, start in ((0, 8, 1.0), (2, 6, 0.77)):
        assert state[joint] - start == pytest.approx(8.0 * state[4] * state[angle], rel=1e-2)

"""Test `adaptive`: its Lyapunov function falls by the work of the damper, for any initial masses."""

import numpy as np
import pytest

from cranectl import open_controller
from cranectl.model.dynamics import axis_masses, mass_matrix
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from tests.benchmark.mechanics import integral
from tests.conftest import ROOT

LAW = f"{ROOT / 'validation' / 'benchmark' / 'adaptive.py'}:ADAPTIVE"
WRONG = ["rig.bridge_mass=4.0", "rig.trolley_mass=3.5", "rig.load_mass=0.6", "rig.winch_mass=0.5"]


def run_of(scenario: str, *overrides: str, believed: list[str], plant: str, drive: str = "force") -> Run:
    controller = open_controller(LAW)
    real = load_scenario(scenario, overrides=overrides)
    nominal = load_scenario(scenario, overrides=[*overrides, *believed])
    return simulate_run(real, nominal=nominal, plant=plant, drive=drive, controller=controller)


def reduced_mass(state: np.ndarray, run: Run) -> np.ndarray:
    """Return the mass matrix (3, 3) of the drives after the swing is eliminated."""
    mass = mass_matrix(state[0::2], run.scenario.rig)
    return mass[:3, :3] - mass[:3, 3:] @ np.linalg.solve(mass[3:, 3:], mass[3:, :3])


def lyapunov(run: Run, gamma: np.ndarray) -> np.ndarray:
    signals = run.block("controller")
    s, masses = signals[:, 4:7], signals[:, :4]
    moving = [
        rate @ reduced_mass(state, run) @ rate for rate, state in zip(s, run.block("state"), strict=True)
    ]
    off = masses - axis_masses(run.scenario.rig)[:4]
    return 0.5 * (np.array(moving) + (off**2 / gamma).sum(axis=1))


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
@pytest.mark.parametrize("wrong", [WRONG, []])
def test_its_function_falls_by_what_the_damper_takes_from_any_masses(plant: str, wrong: list[str]) -> None:
    swung = ["initial.alpha_offset=0.3", "initial.beta_offset=-0.25", "workspace.on_exit='record'"]
    often = ["control.period=0.00025", "control.physics_step=0.00025"]
    run = run_of("fast-diagonal", "disturbances=[]", *swung, *often, believed=wrong, plant=plant)
    rig = load_scenario("fast-diagonal", overrides=wrong).rig
    numbers, length = run.design.parameters, run.block("state")[0, 4]
    believed = np.array(axis_masses(rig)[:4])
    gamma = numbers["adaptation"] * believed / (rig.gravity * length)
    v = lyapunov(run, gamma)
    s = run.block("controller")[:, 4:7]
    taken = integral(run, s**2 @ rig.driven_masses * numbers["gain"] * np.sqrt(rig.gravity / length))
    assert np.abs(v + taken - v[0]).max() < 2e-3 * v[0]
    assert np.diff(v).max() < 0.0
    assert run.block("controller")[-1, 3] == pytest.approx(run.scenario.rig.load_mass, rel=1e-3)


def test_a_constant_disturbance_leaves_what_the_surface_says() -> None:
    run = run_of("fixed-position", "duration=30.0", believed=[], plant="analytic", drive="ideal")
    state = run.block("state")[-1]
    assert np.abs(run.block("disturbance")[-1]).max() > 0.1
    for joint, angle, start in ((0, 8, 1.0), (2, 6, 0.77)):
        assert state[joint] - start == pytest.approx(8.0 * state[4] * state[angle], rel=1e-2)

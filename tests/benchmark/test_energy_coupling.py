"""Test `energy-coupling` and `kinetic-energy-coupling`: functions that fall, error of a disturbance."""

import numpy as np
import pytest

from cranectl import open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from tests.benchmark.mechanics import energy_above_rest, integral, rope_directions
from tests.conftest import ROOT

FILE = ROOT / "validation" / "benchmark" / "energy_coupling.py"
LAWS = ("ENERGY_COUPLING", "KINETIC_ENERGY_COUPLING")


def run_of(symbol: str, scenario: str, *overrides: str, plant: str, drive: str) -> Run:
    controller = open_controller(f"{FILE}:{symbol}")
    loaded = load_scenario(scenario, overrides=overrides)
    return simulate_run(loaded, plant=plant, drive=drive, controller=controller)


def gains(run: Run) -> tuple[np.ndarray, np.ndarray, float]:
    """Return K_p, K_d and k_E from the descriptions of the parameters."""
    rig, numbers, length = run.scenario.rig, run.design.parameters, run.block("state")[0, 4]
    pace = numbers["frequency"] * np.sqrt(rig.gravity / length)
    per_energy = rig.weight * length if run.design.name == "energy-coupling" else 1.0
    stiffness = pace**2 * rig.driven_masses
    return stiffness, 2.0 * numbers["damping"] * pace * rig.driven_masses, numbers["coupling"] / per_energy


def lyapunov(run: Run, target: np.ndarray) -> np.ndarray:
    stiffness, _, coupling = gains(run)
    state = run.block("state")
    energy = energy_above_rest(run, state[:, 1::2])
    stored = energy**2 / 2.0 if run.design.name == "energy-coupling" else energy
    moving = state[:, 1:6:2] ** 2 @ run.scenario.rig.driven_masses
    return coupling * stored + 0.5 * (moving + (state[:, 0:6:2] - target) ** 2 @ stiffness)


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
@pytest.mark.parametrize("symbol", LAWS)
def test_its_function_falls_by_what_the_damper_takes_while_hoisting_too(symbol: str, plant: str) -> None:
    swung = ["initial.alpha_offset=0.6", "initial.beta_offset=-0.5", "workspace.on_exit='record'"]
    run = run_of(symbol, "fast-diagonal", "disturbances=[]", *swung, plant=plant, drive="force")
    v = lyapunov(run, np.array([1.7, 1.25, 0.5]))
    taken = integral(run, run.block("state")[:, 1:6:2] ** 2 @ gains(run)[1])
    assert np.abs(v + taken - v[0]).max() < 1e-3 * v[0]
    assert np.diff(v).max() < 1e-9 * v[0]


@pytest.mark.parametrize("symbol", LAWS)
def test_a_constant_disturbance_leaves_what_the_lean_says(symbol: str) -> None:
    """K_p e = -s (w + W), with w + W = S (n - plumb) for a tension S; s is k_E m g l (1 + n_z), or k_E."""
    begun = [f"disturbances.{k}.start=0.0" for k in range(2)]
    leaning = ["initial.alpha_offset=0.0712", "initial.beta_offset=0.0716"]  # a small swing decays too slowly
    run = run_of(symbol, "fixed-position", "duration=60.0", *begun, *leaning, plant="analytic", drive="ideal")
    stiffness, _, coupling = gains(run)
    rig, late = run.scenario.rig, run.time > 40.0
    state, n = run.block("state")[late], rope_directions(run)[0][late]
    energy = rig.weight * state[:, 4] * (1.0 + n[:, 2])
    s = coupling * (energy if symbol == "ENERGY_COUPLING" else np.ones(len(n)))
    hung = -rig.weight * n[:, 2]
    pull = np.column_stack([hung * n[:, 0], hung * n[:, 1], hung - rig.weight])
    off = state[:, 0:6:2] - [1.0, 0.77, 0.7]
    np.testing.assert_allclose(
        off.mean(axis=0), (s[:, np.newaxis] * pull).mean(axis=0) / stiffness, rtol=1e-2
    )
    assert np.abs(off[:, :2]).max() > (1e-3 if symbol == "ENERGY_COUPLING" else 0.04)

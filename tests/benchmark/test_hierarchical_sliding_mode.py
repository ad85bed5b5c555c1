"""Test `hierarchical-sliding-mode`: poles on its surface, time to reach it, error of a disturbance."""

from math import log, sqrt

import numpy as np
import pytest

from cranectl import open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from tests.conftest import ROOT
from validation.benchmark.hierarchical_sliding_mode import surface_numbers

LAW = f"{ROOT / 'validation' / 'benchmark' / 'hierarchical_sliding_mode.py'}:HIERARCHICAL"
GRAVITY, SHARE = 9.81, 0.3  # the default share


def run_of(scenario: str, *overrides: str, plant: str) -> Run:
    controller = open_controller(LAW)
    loaded = load_scenario(scenario, overrides=["workspace.on_exit='record'", *overrides])
    return simulate_run(loaded, plant=plant, drive="ideal", controller=controller)


def on_surface(rope: float, length: float, share: float) -> np.ndarray:
    """Return the polynomial of a crane with rope length `rope` on S = 0, for a surface made for `length`."""
    forgets, swings = surface_numbers(length, GRAVITY, share)
    crane = np.polymul([rope, 0.0, GRAVITY], [1.0, forgets])
    return np.polyadd(crane, share * length * np.array([1.0, swings, 0.0, 0.0]))


@pytest.mark.parametrize("share", [0.05, 0.3, 3.0])
@pytest.mark.parametrize("length", [0.05, 0.7, 40.0])
def test_on_its_surface_all_three_poles_are_one(length: float, share: float) -> None:
    pole = sqrt(GRAVITY / (3.0 * length * (1.0 + share)))
    polynomial = on_surface(length, length, share)
    np.testing.assert_allclose(polynomial / polynomial[0], np.poly([-pole] * 3), rtol=1e-12)
    for rope in (0.05 * length, 0.5 * length, 20.0 * length):
        assert np.roots(on_surface(rope, length, share)).real.max() < 0.0, "and at other lengths it is stable"


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_the_surface_falls_as_it_says_while_hoisting_too_and_stays_zero(plant: str) -> None:
    moved = ["initial.load_offset=[0.1, -0.08, 0.05]", "initial.alpha_offset=-0.3", "initial.beta_offset=0.4"]
    often = ["control.period=0.00025", "control.physics_step=0.00025"]
    run = run_of("fast-diagonal", "disturbances=[]", *moved, *often, plant=plant)
    surface, numbers = run.block("controller")[:, :3], run.design.parameters
    # The rope length is that of the path, not that of the start beside it.
    k, r = numbers["decay"] * sqrt(GRAVITY / -run.reference[0, 2]), numbers["reach"] * GRAVITY
    for axis in range(3):
        first = abs(surface[0, axis])
        ends = log(1.0 + k * first / r) / k
        assert ends > 0.05
        before, after = run.time < 0.98 * ends, run.time > 1.05 * ends + 0.01
        rate = np.gradient(surface[:, axis], run.time)[before]
        expected = -k * surface[before, axis] - r * np.sign(surface[0, axis])
        assert np.abs(rate - expected).max() < 3e-3 * (k * first + r)
        assert np.abs(surface[after, axis]).max() < 1e-5 * first


def test_a_constant_disturbance_leaves_what_the_surface_says() -> None:
    """It changes S by a g b = 0.2 m/s², which is less than r = 0.3 m/s²."""
    run = run_of("fixed-position", "duration=30.0", plant="analytic")
    state = run.block("state")[-1]
    assert np.abs(run.block("disturbance")[-1]).max() > 0.1
    for joint, angle, start in ((0, 8, 1.0), (2, 6, 0.77)):
        off = (8.0 + 9.0 * SHARE) * 0.7 * state[angle]
        assert state[joint] - start == pytest.approx(off, rel=1e-2)

"""Test `hierarchical-sliding-mode`: poles on its surface, time to reach it, error of a disturbance."""

from math import log, sqrt

import numpy as np
import pytest

from tests.benchmark.runs import FOLDER, SHORT_STEPS, simulate
from validation.benchmark.hierarchical_sliding_mode import surface_numbers

CONTROLLER = "hierarchical_sliding_mode.py:HIERARCHICAL"
RECORD = "workspace.on_exit='record'"
GRAVITY, SHARE = 9.81, 0.3  # the default share


def surface_polynomial(rope: float, length: float, share: float) -> np.ndarray:
    """Return the polynomial of a crane with rope length `rope` on S = 0, if S is designed for `length`."""
    c_1, c_2 = surface_numbers(length, GRAVITY, share)
    crane = np.polymul([rope, 0.0, GRAVITY], [1.0, c_1])
    return np.polyadd(crane, share * length * np.array([1.0, c_2, 0.0, 0.0]))


@pytest.mark.parametrize("share", [0.05, 0.3, 3.0])
@pytest.mark.parametrize("length", [0.05, 0.7, 40.0])
def test_poles_on_surface_are_equal(length: float, share: float) -> None:
    pole = sqrt(GRAVITY / (3.0 * length * (1.0 + share)))
    polynomial = surface_polynomial(length, length, share)
    np.testing.assert_allclose(polynomial / polynomial[0], np.poly([-pole] * 3), rtol=1e-12)
    for rope in (0.05 * length, 0.5 * length, 20.0 * length):
        assert np.roots(surface_polynomial(rope, length, share)).real.max() < 0.0, "stable at other lengths"


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_surface_reaches_zero_as_predicted_while_hoisting(plant: str) -> None:
    offsets = ["initial.alpha_offset=-0.3", "initial.beta_offset=0.4"]
    offsets += ["initial.load_offset=[0.1, -0.08, 0.05]", *SHORT_STEPS, RECORD]
    run = simulate(CONTROLLER, "disturbances=[]", *offsets, scenario="fast-diagonal", plant=plant)
    surface, numbers = run.block("controller")[:, :3], run.design.parameters
    # The design uses the rope length of the path, not that of the initial state.
    k, r = numbers["decay"] * sqrt(GRAVITY / -run.reference[0, 2]), numbers["reach"] * GRAVITY
    for axis in range(3):
        first = abs(surface[0, axis])
        end = log(1.0 + k * first / r) / k  # time at which S is zero
        assert end > 0.05
        before, after = run.time < 0.98 * end, run.time > 1.05 * end + 0.01
        rate = np.gradient(surface[:, axis], run.time)[before]
        expected = -k * surface[before, axis] - r * np.sign(surface[0, axis])
        assert np.abs(rate - expected).max() < 3e-3 * (k * first + r)
        assert np.abs(surface[after, axis]).max() < 1e-5 * first


def test_disturbance_beyond_the_reach_leaves_the_surface_where_decay_balances_it() -> None:
    """As docs/reference/standings.md explains the failures of the tuned numbers."""
    name, lean, decay, reach = "controller.hierarchical-sliding-mode", 0.08, 0.15, 0.003
    settings = [f"{name}.decay={decay}", f"{name}.reach={reach}", "duration=30"]
    force = lean * GRAVITY
    settings.append(f"disturbances=[{{force=[{force}, 0.0, 0.0], start=1.0}}]")
    standing_push = str(FOLDER / "scenarios" / "standing-push.toml")
    run = simulate(CONTROLLER, "rig.load_mass=1.0", *settings, RECORD, scenario=standing_push)
    length = run.scenario.reference.start[2]
    rate = decay * sqrt(GRAVITY / -length)
    expected = -(SHARE * lean - reach) * GRAVITY / rate
    assert run.signal("controller.surface_x")[-1] == pytest.approx(expected, rel=0.02)
    assert SHARE * lean > 2.0 * reach

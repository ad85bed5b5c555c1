"""Test `super-twisting`: poles on its surface, finite time to reach it, error of a constant disturbance."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.support.jit import jit
from tests.benchmark.runs import at_rest, simulate
from tests.controllers.own_controllers import known
from validation.benchmark.super_twisting import SUPER_TWISTING, slopes, step

HOLD = at_rest(0.7, 0.0, 8.0)
DISTURBANCE = 0.3  # [m/s²] of the bridge

_step = jit(step)


@pytest.mark.parametrize("length", [0.05, 0.7, 1.4, 40.0])
def test_poles_on_surface_are_equal(length: float) -> None:
    """While s is zero, the loop is e'' = -lambda e' + kappa b' with l b'' = -g b - e''."""
    g, pole = 9.81, sqrt(9.81 / (3.0 * length))
    lambda_, kappa = slopes(length, g)
    polynomial = np.polyadd(np.polymul([length, 0.0, g], [1.0, lambda_]), [kappa, 0.0, 0.0])
    np.testing.assert_allclose(polynomial / length, np.poly([-pole] * 3), rtol=1e-12)


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_surface_is_reached_in_finite_time_and_kept(plant: str) -> None:
    offset = "initial.load_offset=[0.05, -0.03, 0.02]"
    run = simulate("super_twisting.py:SUPER_TWISTING", *HOLD, offset, plant=plant)
    surface = np.abs(run.block("controller")[:, :3])
    assert surface[0].min() > 0.02
    # With samples every T = 1 ms, the step k_1 |s|^(1/2) T overshoots zero below |s| = k_1² T².
    assert surface[run.time > 0.5].max() < (1.5e-3) ** 2
    # On the surface deviations decay as (1 + pt + (pt)²/2) e^-pt, the slowest decay with three poles at -p.
    late = np.linalg.norm(run.block("error")[:, :3], axis=1)[run.time >= 6.0]
    assert late.max() < 1e-4


def disturbed_step(parameters, measured, reference, memory, command):  # type: ignore[no-untyped-def]
    """Compute the controller's step, and add DISTURBANCE to the acceleration of the bridge."""
    status = _step(parameters, measured, reference, memory, command)
    command[0] += DISTURBANCE
    return status


@pytest.mark.parametrize("twist_gain", [1.1, 1e-6])
def test_integral_rejects_constant_disturbance_of_drives(twist_gain: float) -> None:
    """Without the integral, -k_1 |s|^(1/2) balances the disturbance at s = (DISTURBANCE/k_1)²."""
    number = f"controller.disturbed.twist_gain={twist_gain}"
    scenario = load_scenario("fixed-position", overrides=[*HOLD, number])
    with known(replace(SUPER_TWISTING, name="disturbed", step=disturbed_step)) as name:
        run = simulate_run(scenario, plant="analytic", drive="ideal", controller=name)
    surface = np.abs(run.block("controller")[run.time > 4.0, 0])
    if twist_gain == 1.1:
        assert surface.max() < (1.5e-3) ** 2
    else:
        assert surface[-1] == pytest.approx((DISTURBANCE / 1.5) ** 2, rel=1e-3)

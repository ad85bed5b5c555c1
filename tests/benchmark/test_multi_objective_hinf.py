"""Test `multi-objective-hinf`: four norms within their bounds, also sampled; error of a disturbance."""

from math import sqrt

import control
import numpy as np
import pytest

from tests.benchmark.runs import at_rest, simulate
from validation.benchmark.multi_objective_hinf import BACK_OFF, MULTI_OBJECTIVE_HINF, ORDER, controller

CONTROLLER = "multi_objective_hinf.py:MULTI_OBJECTIVE_HINF"
DEFAULT = tuple(float(parameter.default) for parameter in MULTI_OBJECTIVE_HINF.parameters[:3])
CRANE = control.ss([[0, 1, 0], [-1, 0, 1], [0, 0, 0]], [[0], [0], [1]], [[1, 0, 0]], 0.0)
OMEGA = np.sort(np.concatenate([np.logspace(-5, 4, 40_001), np.linspace(0.5, 2.0, 20_001)]))


def norms(k: np.ndarray, crane: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return |S|, |S/s|, |K S| and |dx/dd| of the crane x = (v/s + d)/(s² + 1), from a frequency sweep."""
    sensitivity = 1.0 / (1.0 + k * crane)
    loops = (sensitivity, sensitivity / s, k * sensitivity, sensitivity / (s**2 + 1.0))
    return np.array([np.abs(loop).max() for loop in loops])


@pytest.mark.parametrize("bounds", [DEFAULT, (1.0, 0.2, 0.5), (10.0, 5.0, 0.5), (2.0, 0.2, 5.0)])
def test_norms_are_within_their_bounds(bounds: tuple[float, float, float]) -> None:
    k, gamma = controller(*bounds)
    s = 1j * OMEGA
    ratios = norms(k(s), 1.0 / (s * (s**2 + 1.0)), s) / (gamma * np.array([1.0, *bounds]))
    assert ratios.max() <= BACK_OFF
    assert ratios.max() > 0.6, "one common Lyapunov function is not too conservative"
    assert control.feedback(CRANE * k, 1.0).poles().real.max() < 0.0


@pytest.mark.parametrize("period", [0.001, 0.01, 0.1])
def test_sampled_controller_keeps_bounds_with_order_two(period: float) -> None:
    """The period is in units of sqrt(l/g), and the crane is discretised for an input held over it."""
    k, gamma = controller(*DEFAULT)
    assert k.nstates == ORDER == 2
    sampled = control.sample_system(k, period, "tustin")
    crane = control.sample_system(CRANE, period, "zoh")
    assert np.abs(control.feedback(crane * sampled, 1.0).poles()).max() < 1.0
    below = OMEGA[period * OMEGA < 0.9 * np.pi]
    z, s = np.exp(1j * period * below), 1j * below
    values = norms(sampled(z), crane(z), s)
    assert (values <= (1.0 + period) * BACK_OFF * gamma * np.array([1.0, *DEFAULT])).all()


@pytest.mark.parametrize(("plant", "drive"), [("analytic", "ideal"), ("mujoco", "velocity")])
@pytest.mark.parametrize("length", [0.4, 1.2])
def test_motion_near_rest_agrees_with_loop(plant: str, drive: str, length: float) -> None:
    """The load has an initial error, and the drives lag between set-point and velocity."""
    offset, w, lag = 1e-4, sqrt(9.81 / length), 0.02
    run = simulate(CONTROLLER, *at_rest(length, offset, 4.0), plant=plant, drive=drive)
    lagging = control.ss([[-1.0 / (w * lag)]], [[1.0 / (w * lag)]], [[1.0]], 0.0)
    loop = controller(*DEFAULT)[0] * lagging * CRANE
    expected = control.step_response(control.feedback(1.0, loop), w * run.time).outputs
    deviation = -run.block("error")[:, 0] / offset
    assert deviation[0] == pytest.approx(1.0)
    np.testing.assert_allclose(deviation, expected, atol=0.02)

"""Test `swing-damping-servo`: four equal poles at every length, on plants that do not use its model."""

from math import comb, exp

import pytest

from tests.benchmark.runs import at_rest, simulate
from validation.benchmark.swing_damping_servo import gains

POLE = 2.5  # [1/s], its default


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
@pytest.mark.parametrize("length", [0.4, 0.725, 1.2])
def test_motion_near_rest_agrees_with_poles(plant: str, length: float) -> None:
    """The error e starts at e_0 at rest with a plumb rope, and follows from the polynomial (r + p)⁴."""
    offset, g = 1e-4, 9.81
    run = simulate("swing_damping_servo.py:SWING_DAMPING_SERVO", *at_rest(length, offset, 4.0), plant=plant)
    k_p, k_d, k_b, k_w = gains(length, g, POLE)
    # e and its derivatives at 0 follow from the equations; e(t) = (c0 + c1 t + c2 t² + c3 t³) e^-pt.
    e = [offset, 0.0, -k_p * offset]
    tilt = k_p * offset / length  # b'' at the start
    e.append(-k_d * e[2] + k_w * tilt)
    shifted = [sum(comb(n, k) * POLE ** (n - k) * e[k] for k in range(n + 1)) for n in range(4)]
    c = [shifted[0], shifted[1], shifted[2] / 2.0, shifted[3] / 6.0]
    for k in (200, 700, 1500, 3000):
        t = run.time[k]
        expected = (c[0] + t * (c[1] + t * (c[2] + t * c[3]))) * exp(-POLE * t)
        assert run.block("state")[k, 0] - 1.0 == pytest.approx(expected, abs=5e-3 * offset)
    assert k_b != 0.0

"""Test `lmi-regions`: poles in their region, a bounded and least norm, error of a constant disturbance."""

from math import sqrt

import control
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are

from cranectl.design.linear_systems import hinf_norm
from cranectl.support.errors import InputError
from tests.benchmark.runs import at_rest, simulate
from validation.benchmark.lmi_regions import BACK_OFF, LMI_REGIONS, PUSH, SEEN, A, B, gains

DEFAULT = tuple(float(parameter.default) for parameter in LMI_REGIONS.parameters[:4])
NO_REGION = (0.0, 1e3, 0.0)


@pytest.mark.parametrize(
    "region", [DEFAULT[:3], (0.2, 10.0, 0.2), (1.5, 4.0, 0.95), (0.5, 1.2, 0.6), (0.1, 3.0, 0.99)]
)
@pytest.mark.parametrize("effort", [0.1, 1.0, 10.0])
def test_poles_are_in_region_and_norm_is_bounded(region: tuple[float, float, float], effort: float) -> None:
    decay, radius, damping = region
    k, gamma = gains(*region, effort)
    closed = A - B @ k[np.newaxis]
    poles = np.linalg.eigvals(closed)
    assert poles.real.max() < -decay
    assert np.abs(poles).max() < radius
    assert (-poles.real / np.abs(poles)).min() > damping
    seen = SEEN - np.array([[0.0], [effort]]) @ k[np.newaxis]
    assert hinf_norm(control.ss(closed, PUSH, seen, np.zeros((2, 1)))) < gamma


@pytest.mark.parametrize("effort", [0.3, 1.0, 3.0])
def test_bound_without_region_is_near_least_norm(effort: float) -> None:
    """The Riccati equation of this problem has a stabilising solution only above the least norm."""

    def solvable(gamma: float) -> bool:
        both = np.hstack([B, PUSH])
        try:
            cost = solve_continuous_are(A, both, SEEN.T @ SEEN, np.diag([effort**2, -(gamma**2)]))
        except np.linalg.LinAlgError:
            return False
        return bool(np.linalg.eigvalsh(cost).min() > -1e-9)

    _, gamma = gains(*NO_REGION, effort)
    assert solvable(1.01 * gamma / BACK_OFF)
    assert not solvable(0.99 * gamma / BACK_OFF)


def test_empty_region_is_reported() -> None:
    with pytest.raises(InputError, match="without a solution"):
        gains(2.0, 1.5, 0.5, 1.0)
    with pytest.raises(InputError, match="without"):
        gains(1.0, 1.0, 0.6, 1.0)  # the region is a point


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
@pytest.mark.parametrize("length", [0.4, 1.2])
def test_motion_near_rest_agrees_with_poles(plant: str, length: float) -> None:
    offset, w = 1e-4, sqrt(9.81 / length)
    run = simulate("lmi_regions.py:LMI_REGIONS", *at_rest(length, offset, 3.0), plant=plant)
    closed = A - B @ gains(*DEFAULT)[0][np.newaxis]
    for k in (200, 700, 1500, 3000):
        drive, _, angle, _ = expm(closed * w * run.time[k])[:, 0] * offset
        assert run.block("state")[k, 0] - 1.0 == pytest.approx(drive, abs=5e-3 * offset)
        assert length * run.block("state")[k, 8] == pytest.approx(angle, abs=5e-3 * offset)

"""Test `lmi-regions`: poles in their region, a bounded and least norm, error of a constant disturbance."""

from math import sqrt

import control
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are

from cranectl import open_controller
from cranectl.design.linear_systems import hinf_norm
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError
from tests.conftest import ROOT
from validation.benchmark.lmi_regions import BACK_OFF, LMI_REGIONS, PUSH, SEEN, A, B, gains

CONTROLLER = f"{ROOT / 'validation' / 'benchmark' / 'lmi_regions.py'}:LMI_REGIONS"
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
    rest = ["disturbances=[]", f"reference.start=[1.0, 0.77, {-length}]", "reference.segments=[]"]
    overrides = ["duration=3.0", *rest, f"initial.load_offset=[{offset}, 0.0, 0.0]"]
    scenario = load_scenario("fixed-position", overrides=overrides)
    run = simulate_run(scenario, plant=plant, drive="ideal", controller=open_controller(CONTROLLER))
    closed = A - B @ gains(*DEFAULT)[0][np.newaxis]
    for k in (200, 700, 1500, 3000):
        drive, _, angle, _ = expm(closed * w * run.time[k])[:, 0] * offset
        assert run.block("state")[k, 0] - 1.0 == pytest.approx(drive, abs=5e-3 * offset)
        assert length * run.block("state")[k, 8] == pytest.approx(angle, abs=5e-3 * offset)


def test_constant_disturbance_leaves_predicted_error() -> None:
    run = simulate_run(
        load_scenario("fixed-position", overrides=["duration=25.0"]),
        plant="analytic",
        drive="ideal",
        controller=open_controller(CONTROLLER),
    )
    state, k = run.block("state")[-1], gains(*DEFAULT)[0]
    assert np.abs(run.block("disturbance")[-1]).max() > 0.1
    for joint, angle, start in ((0, 8, 1.0), (2, 6, 0.77)):
        assert abs(state[angle]) > 0.01
        assert state[joint] - start == pytest.approx(-state[4] * state[angle] * k[2] / k[0], rel=1e-3)

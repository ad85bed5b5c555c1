"""Test `two-degree-of-freedom`: norm, tracking of its model, error of a constant disturbance."""

from math import sqrt

import control
import numpy as np
import pytest

from tests.benchmark.runs import at_rest, simulate
from validation.benchmark.two_degree_of_freedom import BACK_OFF, TWO_DOF, controller, model

GAIN, SPEED, RHO = (float(parameter.default) for parameter in TWO_DOF.parameters[:3])
CRANE = control.ss([[0, 1, 0], [-1, 0, 1], [0, 0, 0]], [[0], [0], [1]], [[1, 0, 0]], 0.0)
OMEGA = np.logspace(-3, 4, 20_001)


def frequency_responses() -> tuple[np.ndarray, ...]:
    """Return the shaped plant, K_1 and K_2 from SB10AD, and the model, over all frequencies."""
    s = 1j * OMEGA
    k = controller(GAIN, SPEED, RHO)[1].controller(s)
    return GAIN / (s * (s**2 + 1.0)), k[0, 0], k[0, 1], (SPEED / (s + SPEED)) ** 3


def test_norm_agrees_with_synthesis() -> None:
    """The sweep is from (r, phi) to (u, x, rho (x - rho T_ref r)), normalised by |M|² = 1/(1 + |G|²)."""
    g, k_1, k_2, model = frequency_responses()
    synthesis = controller(GAIN, SPEED, RHO)[1]
    sensitivity, m = 1.0 / (1.0 - g * k_2), 1.0 / np.sqrt(1.0 + np.abs(g) ** 2)
    followed = g * sensitivity * k_1 * RHO
    matrix = np.array(
        [
            [RHO * k_1 * sensitivity, k_2 * sensitivity / m],
            [followed, sensitivity / m],
            [RHO * (followed - RHO * model), RHO * sensitivity / m],
        ]
    )
    norm = np.linalg.svd(matrix.transpose(2, 0, 1), compute_uv=False)[:, 0].max()
    assert norm == pytest.approx(synthesis.gamma, rel=1e-3)
    assert synthesis.gamma_min <= synthesis.gamma <= BACK_OFF * synthesis.gamma_min * (1.0 + 1e-4)
    # 1/norm is the margin against errors of the coprime factors; the book requires 0.25.
    assert 1.0 / norm > 0.25


def closed_loop(speed: float, rho: float, lag: float = 0.0) -> control.StateSpace:
    """Return the loop from r to x with lagging drives, in units of sqrt(l/g) and l."""
    k, _ = controller(GAIN, speed, rho)
    driven = control.ss([[-1.0 / lag]], [[1.0 / lag]], [[1.0]], 0.0) * CRANE if lag else CRANE
    return control.feedback(driven, -k[0, 1]) * k[0, 0]


@pytest.mark.parametrize("speed", [0.5, 0.7, 1.0])
def test_larger_weight_gives_closer_tracking_of_model(speed: float) -> None:
    time = np.linspace(0.0, 20.0, 2001)
    desired = control.step_response(model(speed), time).outputs
    errors = []
    for rho in (0.3, 1.0, 3.0):
        loop = closed_loop(speed, rho)
        assert loop.poles().real.max() < -0.05
        assert loop.dcgain() == pytest.approx(1.0, abs=1e-9)
        errors.append(np.abs(control.step_response(loop, time).outputs - desired).max())
    assert errors[0] > errors[1] > errors[2]
    assert errors[1] < 0.2


# The load's pull displaces the engine's velocity drives by up to 0.1 mm of 20 mm.
@pytest.mark.parametrize(
    ("plant", "drive", "tolerance"), [("analytic", "ideal", 2e-5), ("mujoco", "velocity", 1.2e-4)]
)
@pytest.mark.parametrize("length", [0.4, 1.2])
def test_motion_on_a_path_agrees_with_loop(plant: str, drive: str, tolerance: float, length: float) -> None:
    """The request is T_ref⁻¹ of a short path, and the drives lag between set-point and velocity."""
    w, lag = sqrt(9.81 / length), 0.02
    path = f"reference.segments=[{{kind='line', to=[1.02, 0.77, {-length}], duration=2.0}}]"
    settings = [*at_rest(length, 0.0, 6.0), path]
    run = simulate("two_degree_of_freedom.py:TWO_DOF", *settings, plant=plant, drive=drive)
    pole, rows = w * SPEED, run.reference[:, 0::3] - [1.0, 0.0, 0.0, 0.0, 0.0]
    requested = rows[:, :4] @ [1.0, 3.0 / pole, 3.0 / pole**2, 1.0 / pole**3]
    expected = control.forced_response(closed_loop(SPEED, RHO, w * lag), w * run.time, requested).outputs
    load = rows[:, 0] - run.block("error")[:, 0]
    assert np.abs(load - rows[:, 0]).max() > 5e-4, "the loop does not follow the path exactly"
    np.testing.assert_allclose(load, expected, atol=tolerance)

"""Test `coupling-tracking`: its coupled error falls for any swing; effect of a constant disturbance."""

import numpy as np
import pytest

from tests.benchmark.runs import simulate

CONTROLLER = "coupling_tracking.py:COUPLING_TRACKING"
COUPLING = 2.0  # [m/s], its default; damping 4, stiffness 4: two poles at -2


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_coupled_error_decays_for_any_load_motion(plant: str) -> None:
    """The solution of zeta' = -4 zeta - 4 integral of zeta, from an integral of e_0, is -4 e_0 t e^-2t."""
    offset = np.array([0.1, -0.05])
    overrides = [f"initial.load_offset=[{offset[0]}, {offset[1]}, 0.0]", "workspace.on_exit='record'"]
    run = simulate(CONTROLLER, "disturbances=[]", *overrides, scenario="fast-diagonal", plant=plant)
    coupled_error, t = run.block("controller")[:, :2], run.time[:, None]
    assert np.abs(run.block("state")[:, [6, 8]]).max() > 0.1, "the load swings"
    # Sampling every T = 1 ms causes an error of about T times the acceleration that the swing requires.
    np.testing.assert_allclose(coupled_error, -4.0 * offset * t * np.exp(-2.0 * t), atol=1e-3)


def test_constant_disturbance_causes_predicted_drift() -> None:
    run = simulate(CONTROLLER, "workspace.on_exit='record'")
    late = run.time > run.time[-1] - 2.0
    assert np.abs(run.block("disturbance")[-1]).max() > 0.1
    for rate, angle in ((1, 8), (3, 6)):
        state = run.block("state")[late]
        assert state[:, rate].mean() == pytest.approx(COUPLING * np.sin(state[:, angle]).mean(), rel=1e-2)
        assert abs(state[:, rate].mean()) > 0.1

"""The rig's velocity drives: servos that feel the load, the same on all plants."""

import numpy as np
import pytest

from cranectl.metrics import run_metrics
from cranectl.status import RunStatus
from tests.conftest import ALL_CONTROLLERS, PLANTS, closed_loop

UNDISTURBED = "disturbances=[]"


@pytest.mark.parametrize("controller", ALL_CONTROLLERS)
@pytest.mark.parametrize("plant", PLANTS)
def test_a_run_at_rest_stays_at_rest(plant: str, controller: str) -> None:
    """The winch drive holds the weight; without that the load would sink with g tau, 0.14 m/s."""
    run = closed_loop("fixed-position", controller, plant, "velocity", UNDISTURBED, "duration=5")
    assert run.status == RunStatus.COMPLETED
    assert np.abs(run.block("state")[:, 1::2]).max() < 1e-9
    assert np.abs(run.load_position - [1.0, 0.77, -0.7]).max() < 1e-9
    assert run.signal("load.rope_tension") == pytest.approx(9.81, abs=1e-6)


@pytest.mark.parametrize("plant", PLANTS)
def test_lag_compensation_brings_tracking_near_to_ideal_drives(plant: str) -> None:
    """On a path without disturbances, a fifth of the error at most."""
    path = "fast-diagonal", "lqr", plant, "velocity", UNDISTURBED
    runs = [closed_loop(*path, f"control.lag_compensation={flag}") for flag in ("true", "false")]
    compensated, plain = (run_metrics(run).max_error_m for run in runs)
    assert compensated < 0.2 * plain

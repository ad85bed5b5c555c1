"""The rig's velocity drives: servos that feel the load, the same on all plants."""

import numpy as np
import pytest

from cranectl.metrics import run_metrics
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from tests.conftest import ALL_CONTROLLERS, PLANTS


def undisturbed(scenario: str, plant: str, *overrides: str, controller: str = "lqr") -> Run:
    loaded = load_scenario(scenario, overrides=["disturbances=[]", *overrides])
    return simulate_run(loaded, plant=plant, drive="velocity", controller=controller)


@pytest.mark.parametrize("controller", ALL_CONTROLLERS)
@pytest.mark.parametrize("plant", PLANTS)
def test_a_run_at_rest_stays_at_rest(plant: str, controller: str) -> None:
    """The winch drive holds the weight; without that the load would sink with g tau, 0.14 m/s."""
    run = undisturbed("fixed-position", plant, "duration=5", controller=controller)
    assert run.status == RunStatus.COMPLETED
    assert np.abs(run.block("state")[:, 1::2]).max() < 1e-9
    assert np.abs(run.load_position - [1.0, 0.77, -0.7]).max() < 1e-9
    assert run.signal("load.rope_tension") == pytest.approx(9.81, abs=1e-6)


@pytest.mark.parametrize("plant", PLANTS)
def test_lag_compensation_brings_tracking_near_to_ideal_drives(plant: str) -> None:
    """On a path without disturbances, a fifth of the error at most."""
    errors = [
        run_metrics(undisturbed("fast-diagonal", plant, f"control.lag_compensation={flag}")).max_error_m
        for flag in ("true", "false")
    ]
    assert errors[0] < 0.2 * errors[1]

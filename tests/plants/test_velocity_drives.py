"""The rig's velocity drives: servos that feel the load, the same on all plants."""

import numpy as np
import pytest

from cranectl.compare.agreement import judge
from cranectl.metrics import run_metrics
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from tests.conftest import ALL_CONTROLLERS, PAIR, PLANTS


def undisturbed(scenario: str, plant: str, *overrides: str, controller: str = "lqr") -> Run:
    loaded = load_scenario(scenario, overrides=["disturbances=[]", *overrides])
    return simulate_run(loaded, plant=plant, drive="velocity", controller=controller)


@pytest.mark.parametrize(
    "overrides",
    [
        ["rig.load_mass=4.0"],
        ["rig.bridge_mass=0.5", "rig.trolley_mass=0.2", "rig.winch_mass=0.1", "rig.load_mass=5.0"],
        ["rig.bridge_time_constant=0.2", "rig.trolley_time_constant=0.005", "rig.winch_time_constant=0.1"],
        ["effects.wind={}", "effects.installation={tilt=[0.01,-0.02]}"],
        ["effects.friction={coulomb=[0,0,0],viscous=[0,0,0],pivot_coulomb=0,pivot_viscous=1e-3}"],
        ["control.lag_compensation=false"],
    ],
)
def test_they_agree_on_any_rig(overrides: list[str]) -> None:
    scenario = load_scenario("fixed-position", overrides=["duration=16.0", *overrides])
    runs = [simulate_run(scenario, plant=plant, drive="velocity", controller="lqr") for plant in PAIR]
    assert judge(*runs).passed


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

"""The rig's velocity drives: servos that feel the load, the same on all plants."""

import numpy as np
import pytest

from cranectl.compare.agreement import judge
from cranectl.metrics import run_metrics
from cranectl.planning import load_scenario
from cranectl.plants.registry import plant_entry
from cranectl.scenario.effects import NO_EFFECTS
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from tests.conftest import ALL_CONTROLLERS, PAIR, PLANTS, STILL


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
def test_set_points_are_the_integral_of_the_accelerations_and_their_lead(plant: str) -> None:
    lags = ["rig.bridge_time_constant=0.01", "rig.trolley_time_constant=0.03", "duration=21"]
    run = undisturbed("settled-trajectory", plant, *lags)
    inputs = run.block("input")
    start = run.block("state")[0, 1:6:2]
    integral = start + np.vstack([np.zeros(3), np.cumsum(inputs[:-1, :3] * 1e-3, axis=0)])
    assert inputs[:, 3:] == pytest.approx(integral + inputs[:, :3] * [0.01, 0.03, 0.02], abs=1e-12)
    without = undisturbed("settled-trajectory", plant, *lags, "control.lag_compensation=false")
    inputs = without.block("input")
    integral = start + np.vstack([np.zeros(3), np.cumsum(inputs[:-1, :3] * 1e-3, axis=0)])
    assert inputs[:, 3:] == pytest.approx(integral, abs=1e-12)


@pytest.mark.parametrize("plant", PLANTS)
def test_lag_compensation_brings_tracking_near_to_ideal_drives(plant: str) -> None:
    """On a path without disturbances, a fifth of the error at most."""
    errors = [
        run_metrics(undisturbed("fast-diagonal", plant, f"control.lag_compensation={flag}")).max_error_m
        for flag in ("true", "false")
    ]
    assert errors[0] < 0.2 * errors[1]


@pytest.mark.parametrize("name", PLANTS)
def test_the_servo_yields_to_the_load_by_force_over_gain(name: str) -> None:
    """A load held 0.2 rad aside pulls on the trolley with S sin(alpha): the servo creeps by that over kv.

    Looked at when its own lag has settled.
    """
    rig = RigParameters(
        trolley_mass=250.0, bridge_mass=600.0, winch_mass=400.0, load_mass=10.0, trolley_time_constant=0.002
    )
    plant = plant_entry(name).load()(rig, drive="velocity", step=1e-4, substeps=1, effects=NO_EFFECTS)
    state, load = np.zeros(10), np.zeros(7)
    plant.reset(np.array([1.0, 0, 0.7, 0, 1.0, 0, 0.2, 0, 0, 0]))
    for _ in range(200):
        plant.advance(np.zeros(3), np.zeros(2), STILL, load)
    plant.measure(state)
    pull = load[6] * np.sin(state[6])
    assert state[3] == pytest.approx(pull / rig.velocity_gains[1], rel=0.03)

"""Effects that both plants show: the plants agree, and each effect changes the run."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cranectl.compare.runs import compare_runs
from cranectl.planning import load_scenario
from cranectl.plants.surroundings import air_velocity
from cranectl.scenario.effects import Wind
from cranectl.simulate import Run, simulate_run

STILL_AIR = "effects.wind.gust=0.0"
BREEZE = ["effects.wind.mean=[2.0,-1.0,0.3]", "effects.wind.gust=0.5", "effects.wind.drag_area=0.03"]
FORCES = ["disturbances=[{force=[0.3,-0.2,0.5],start=2.0,end=4.0},{force=[0.0,0.4,-0.3],start=3.0}]"]
GREASE = [
    "effects.friction.coulomb=[0.0,0.0,0.0]",
    "effects.friction.viscous=[0.0,0.0,0.0]",
    "effects.friction.pivot_coulomb=0.0",
    "effects.friction.pivot_viscous=0.02",
]


def run(plant: str, *overrides: str) -> Run:
    scenario = load_scenario("settled-trajectory", overrides=["duration=20.0", *overrides])
    return simulate_run(scenario, plant=plant, controller="lqr")


@pytest.mark.parametrize(
    ("overrides", "apart"),
    [(BREEZE, 1e-8), (GREASE, 1e-4), (FORCES, 1e-9), ([*FORCES, "effects.wind={}"], 1e-8)],
    ids=["wind", "viscous joint", "forces", "forces and gusts"],
)
def test_both_plants_agree(overrides: list[str], apart: float) -> None:
    """They differ by a small part of the effect only."""
    analytic, mujoco = (run(plant, *overrides) for plant in ("analytic", "mujoco"))
    plain = run("analytic")
    comparison = compare_runs(analytic, mujoco)
    effect = compare_runs(plain, analytic).max_load_error_m
    assert effect > 1e-3
    assert mujoco.status == analytic.status == plain.status
    assert comparison.max_load_error_m < apart * effect
    tension = next(row for row in comparison.signals if row.signal == "load.rope_tension")
    assert tension.max_abs < 2e-3


@pytest.mark.parametrize("plant", ["analytic", "elastic", "mujoco"])
def test_a_vertical_force_alone_acts(plant: str) -> None:
    """It takes its part of the weight off the rope."""
    held = ["reference.segments=[]", "reference.start=[1.0,0.77,-0.7]", "duration=0.1"]
    still, lifted = (
        run(plant, *held, f"disturbances=[{force}]").signal("load.rope_tension")
        for force in ("", "{force=[0.0,0.0,2.0],start=0.0}")
    )
    assert_allclose(still[1:] - lifted[1:], 2.0, rtol=1e-6)


def test_air_at_rest_slows_the_load() -> None:
    """Drag is quadratic: four times the area, four times the loss, as long as that is small."""
    swing = ["initial.alpha_offset=0.3", "disturbances=[]", STILL_AIR]
    rows = [run("analytic", *swing, f"effects.wind.drag_area={area}") for area in (0.0, 0.01, 0.04)]
    loads = [row.load_position[:3000] for row in rows]
    small, large = (np.linalg.norm(load - loads[0], axis=1).max() for load in loads[1:])
    assert small > 1e-5
    assert_allclose(large / small, 4.0, rtol=0.05)


def test_gusts_have_the_deviation_and_the_correlation_that_they_are_given() -> None:
    wind = Wind(mean=(1.0, 0.0, -0.5), gust=0.7, gust_time=0.5, seed=3)
    period = 0.01
    velocity = air_velocity(wind, 400_000, period)
    assert_allclose(velocity.mean(axis=0), [1.0, 0.0, -0.5], atol=0.05)
    assert_allclose(velocity.std(axis=0), [0.7, 0.7, 0.0], rtol=0.03)
    gusts = velocity[:, 0] - velocity[:, 0].mean()
    lag = round(wind.gust_time / period)
    assert_allclose(np.mean(gusts[lag:] * gusts[:-lag]) / gusts.var(), np.exp(-1.0), atol=0.03)
    assert abs(np.corrcoef(velocity[:, 0], velocity[:, 1])[0, 1]) < 0.05


def test_the_same_seed_is_the_same_wind_however_long() -> None:
    short, long = (air_velocity(Wind(), samples, 1e-3) for samples in (100, 1000))
    assert_allclose(long[:100], short, rtol=0, atol=0)
    assert not air_velocity(None, 10, 1e-3).any()

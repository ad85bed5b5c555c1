"""The limits of level 3: what the error budget predicts for the shipped scenarios."""

import runpy
from dataclasses import replace

import numpy as np
import pytest

from cranectl.analysis.budget.predicted_limits import predict_plant_difference, predicted_limits
from cranectl.compare.agreement import Limits, agreement_limits, judge
from cranectl.design import design_controller
from cranectl.reference import load_scenario
from cranectl.simulate import simulate_run
from tests.conftest import PAIR, ROOT

SCRIPT = runpy.run_path(str(ROOT / "validation" / "level_3.py"))
WIDEST = ("near-slack", "lqr+hinf")
LAGS = {"bridge": 0.06, "trolley": 0.05, "winch": 0.04}


def test_the_limits_are_the_largest_bounds_rounded_up() -> None:
    """Of the case that sets both; `python validation/level_3.py`, which CI runs, goes through all of them."""
    scenario, controller = WIDEST
    found = predict_plant_difference(load_scenario(scenario), controller)
    limits = agreement_limits("velocity")
    assert SCRIPT["rounded_up"](found.load_bound_m) == limits.load_m
    assert SCRIPT["rounded_up"](found.angle_bound_rad) == limits.angle_rad


@pytest.mark.parametrize(
    ("value", "rounded"), [(6.06e-3, 6.1e-3), (0.0308, 0.031), (0.031, 0.031), (9.91, 10.0), (1.0, 1.0)]
)
def test_rounding_up_keeps_two_digits_and_never_rounds_down(value: float, rounded: float) -> None:
    assert SCRIPT["rounded_up"](value) == rounded


RIGS = {
    "heavy-load": ["rig.load_mass=8.0"],
    "slow-drives": [f"rig.{axis}_time_constant={lag}" for axis, lag in LAGS.items()],
    "crane-of-45-m": [
        "rig={rated_load=2e4, load_mass=2e4, bridge_mass=6e5, trolley_mass=4e4, winch_mass=2e4, "
        "bridge_range=[0,80], trolley_range=[0,20], rope_range=[1,45], bridge_time_constant=0.3, "
        "trolley_time_constant=0.3, winch_time_constant=0.2}",
        "reference={start=[10,5,-40], segments=[{kind='line', to=[11,6,-39.5], duration=4.0}]}",
    ],
}


@pytest.mark.parametrize("rig", RIGS)
def test_another_rig_keeps_its_own_limits(rig: str) -> None:
    """The plants differ as predicted, within limits nothing like those of the lab rig."""
    scenario = load_scenario("fast-diagonal", overrides=["duration=4.0", "disturbances=[]", *RIGS[rig]])
    design = design_controller("lqr", scenario.design)
    predicted, limits = predict_plant_difference(scenario, "lqr"), predicted_limits(scenario, design)
    assert isinstance(limits, Limits)
    assert (limits.load_m, limits.angle_rad) == (predicted.load_bound_m, predicted.angle_bound_rad)
    runs = [simulate_run(scenario, plant=plant, drive="velocity", design=design) for plant in PAIR]
    found = judge(*runs, limits=limits)
    assert found.passed
    assert found.limits == limits.source != Limits.source
    assert found.max_load_error_m == pytest.approx(predicted.load_m, rel=0.05)
    assert found.max_angle_error_rad == pytest.approx(predicted.angle_rad, rel=0.05)
    assert abs(np.log(limits.load_m / agreement_limits("velocity").load_m)) > 0.1
    assert not judge(*runs, limits=replace(limits, load_m=0.5 * limits.load_m)).passed

"""The limits of level 3: what the error budget predicts for the shipped scenarios."""

import runpy

import pytest

from cranectl.analysis.budget.level_3 import predict_plant_difference
from cranectl.compare import agreement_limits
from cranectl.scenario import load_scenario
from tests.conftest import ROOT

SCRIPT = runpy.run_path(str(ROOT / "validation" / "level_3.py"))
WIDEST = ("near-slack", "lqr+hinf")


def test_the_limits_are_the_largest_bounds_rounded_up() -> None:
    """Of the case that sets both; `python validation/level_3.py`, which CI runs, goes through all of them."""
    found, limits = (
        predict_plant_difference(load_scenario(WIDEST[0]), WIDEST[1]),
        agreement_limits("velocity"),
    )
    assert SCRIPT["rounded_up"](found.load_bound_m) == limits.load_m
    assert SCRIPT["rounded_up"](found.angle_bound_rad) == limits.angle_rad


@pytest.mark.parametrize(
    ("value", "rounded"), [(6.138e-3, 6.2e-3), (0.0308, 0.031), (0.031, 0.031), (9.91, 10.0), (1.0, 1.0)]
)
def test_rounding_up_keeps_two_digits_and_never_rounds_down(value: float, rounded: float) -> None:
    assert SCRIPT["rounded_up"](value) == rounded

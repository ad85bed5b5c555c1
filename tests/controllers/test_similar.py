"""Defaults of controllers on a crane of another size: the same motion, slower by the root of the length."""

import numpy as np
import pytest

from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from tests.conftest import closed_loop

HARBOUR = 40.0 / 1.4  # longest rope over the laboratory's


def test_defaults_go_by_their_powers_and_what_is_given_stays() -> None:
    overrides = ["controller.pid.integral=0.5"]
    pid = ALL_CONTROLLERS.design("pid", load_scenario("ship-to-shore", overrides=overrides)).parameters
    assert pid["proportional"] == pytest.approx(4.0 / np.sqrt(HARBOUR), rel=5e-3)
    assert pid["integral"] == 0.5
    assert ALL_CONTROLLERS.design("pid", load_scenario("fast-diagonal")).parameters["proportional"] == 4.0


@pytest.mark.parametrize("controller", ["pid", "lqr-integral", "lqr-offset-free", "flat-velocity"])
def test_a_similar_crane_moves_as_the_small_one_does(controller: str) -> None:
    """A crane 25 times as large moves five times as slowly, and every position is 25 times as large."""
    small = "initial.load_offset=[0.1, -0.05, 0.0]", "duration=4.0"
    large = (
        "rig={rated_load=2, rope_range=[1.25, 35], bridge_range=[0, 50], trolley_range=[0, 38.5]}",
        "reference.start=[7.5, 6.25, -30.0]",
        "reference.segments=[{kind='line', to=[42.5, 31.25, -12.5], duration=15.0}]",
        "initial.load_offset=[2.5, -1.25, 0.0]",
        "duration=20.0",
        "control={period=0.005, physics_step=0.005}",
    )
    runs = (
        closed_loop("fast-diagonal", controller, "analytic", "ideal", "disturbances=[]", *crane)
        for crane in (small, large)
    )
    positions = [run.block("state")[:4001, :6:2] for run in runs]
    # Defaults on the larger one are rounded to three digits.
    assert np.ptp(positions[0], axis=0).min() > 0.5
    np.testing.assert_allclose(positions[1] / 25.0, positions[0], atol=2e-3)

"""Wind, and forces on the load without wind."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cranectl.scenario.effects import Wind
from tests.conftest import PLANTS, closed_loop


@pytest.mark.parametrize("plant", PLANTS)
def test_a_vertical_force_alone_acts(plant: str) -> None:
    """It takes its part of the weight off the rope."""
    held = ["reference.segments=[]", "reference.start=[1.0,0.77,-0.7]", "duration=0.1"]
    still, lifted = (
        closed_loop("settled-trajectory", "lqr", plant, "ideal", *held, f"disturbances=[{force}]").tension
        for force in ("", "{force=[0.0,0.0,2.0],start=0.0}")
    )
    assert_allclose(still[1:] - lifted[1:], 2.0, rtol=1e-6)


def test_gusts_have_the_deviation_and_the_correlation_that_they_are_given() -> None:
    wind = Wind(mean=(1.0, 0.0, -0.5), gust=0.7, gust_time=0.5, seed=3)
    period = 0.01
    velocity = wind.velocity(400_000, period)
    assert_allclose(velocity.mean(axis=0), [1.0, 0.0, -0.5], atol=0.05)
    assert_allclose(velocity.std(axis=0), [0.7, 0.7, 0.0], rtol=0.03)
    gusts = velocity[:, 0] - velocity[:, 0].mean()
    lag = round(wind.gust_time / period)
    assert_allclose(np.mean(gusts[lag:] * gusts[:-lag]) / gusts.var(), np.exp(-1.0), atol=0.03)
    assert abs(np.corrcoef(velocity[:, 0], velocity[:, 1])[0, 1]) < 0.05


def test_the_same_seed_is_the_same_wind_however_long() -> None:
    short, long = (Wind().velocity(samples, 1e-3) for samples in (100, 1000))
    assert_allclose(long[:100], short, rtol=0, atol=0)

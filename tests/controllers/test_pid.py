"""PID with input shaping."""

import numpy as np
import pytest

from cranectl.controllers.pid import impulses
from cranectl.metrics import run_metrics
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run


def point_to_point(shaper: str, rope: float = 0.7) -> tuple[float, float]:
    """Return largest swing after arrival [rad] and final error [m], of 1 m in 4 s with a constant rope."""
    scenario = load_scenario(
        "fixed-position",
        overrides=[
            "duration=14.0",
            "disturbances=[]",
            f"reference.start=[0.5, 0.5, {-rope}]",
            f"reference.segments=[{{kind='line', to=[1.5, 0.5, {-rope}], duration=4.0}}]",
            f"controller.pid.shaper={shaper}",
        ],
    )
    run = simulate_run(scenario, plant="mujoco", drive="velocity", controller="pid")
    assert run.status.label == "completed"
    return float(np.abs(run.angles[8000:, 1]).max()), run_metrics(run).final_error_m


def test_shaping_leaves_no_swing_at_the_length_it_is_made_for() -> None:
    swings = {shaper: point_to_point(shaper)[0] for shaper in ("none", "zv", "zvd")}
    assert swings["none"] > 0.02
    assert swings["zv"] < 0.1 * swings["none"]
    assert swings["zvd"] < 0.1 * swings["none"]
    assert point_to_point("zvd")[1] < 2e-3, "the integral brings it there"


@pytest.mark.parametrize(("shaper", "published"), [("zv", 0.06), ("zvd", 0.286), ("ei", 0.399)])
def test_shapers_bear_as_wrong_a_frequency_as_published(shaper: str, published: float) -> None:
    """Width of the band of frequencies, over that of the design, in which 5 % of the swing is left at most.

    Singhose, Int. J. Precision Eng. Manufacturing 10 (2009), for undamped ones.
    """
    amplitudes, times = impulses(shaper, 2.0 * np.pi)
    frequency = np.linspace(0.5, 1.5, 100_001)
    left = np.abs(np.exp(1j * np.outer(frequency, times)) @ amplitudes)
    assert np.ptp(frequency[left <= 0.05 + 1e-12]) == pytest.approx(published, abs=0.004)


def test_it_needs_the_encoders_of_the_drives_only() -> None:
    """With the coarsest encoders of the angles its commands stay the same to the bit."""
    fine, coarse = (
        simulate_run(
            load_scenario("fast-diagonal", overrides=[f"effects.sensing.angle_resolution={step}"]),
            plant="analytic",
            drive="velocity",
            controller="pid",
        )
        for step in (0.0001, 0.5)
    )
    assert np.array_equal(fine.block("input")[:, 3:], coarse.block("input")[:, 3:])
    assert not np.array_equal(fine.block("measurement"), coarse.block("measurement"))

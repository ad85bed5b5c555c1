"""PID with input shaping."""

import numpy as np

from cranectl.metrics import run_metrics
from tests.conftest import closed_loop


def point_to_point(shaper: str) -> tuple[float, float]:
    """Return largest swing after arrival [rad] and final error [m], of 1 m in 4 s on 0.7 m of rope."""
    run = closed_loop(
        "fixed-position", "pid", "mujoco", "velocity", "duration=14.0", "disturbances=[]",
        "reference.start=[0.5, 0.5, -0.7]", f"controller.pid.shaper={shaper}",
        "reference.segments=[{kind='line', to=[1.5, 0.5, -0.7], duration=4.0}]",
    )  # fmt: skip
    assert run.status.label == "completed"
    return float(np.abs(run.angles[8000:, 1]).max()), run_metrics(run).final_error_m


def test_shaping_leaves_no_swing_at_the_length_it_is_made_for() -> None:
    swings = {shaper: point_to_point(shaper)[0] for shaper in ("none", "zv", "zvd")}
    assert swings["none"] > 0.02
    assert swings["zv"] < 0.1 * swings["none"]
    assert swings["zvd"] < 0.1 * swings["none"]
    assert point_to_point("zvd")[1] < 2e-3, "the integral brings it there"


def test_it_needs_the_encoders_of_the_drives_only() -> None:
    """With the coarsest encoders of the angles its commands stay the same to the bit."""
    fine, coarse = (
        closed_loop(
            "fast-diagonal", "pid", "analytic", "velocity", f"effects.sensing.angle_resolution={step}"
        )
        for step in (0.0001, 0.5)
    )
    assert np.array_equal(fine.block("input")[:, 3:], coarse.block("input")[:, 3:])
    assert not np.array_equal(fine.block("measurement"), coarse.block("measurement"))

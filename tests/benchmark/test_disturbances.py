"""A constant disturbance of the load leaves the predicted error, and a strong one no windup of observers."""

import numpy as np
import pytest

from cranectl.metrics import run_metrics
from tests.benchmark.runs import FOLDER, simulate
from validation.benchmark.lmi_regions import LMI_REGIONS, gains
from validation.benchmark.partial_linearisation import LINEARISATION

LMI_GAINS = gains(*(float(parameter.default) for parameter in LMI_REGIONS.parameters[:4]))[0]
POSITION, SWING, SHARE = (float(parameter.default) for parameter in LINEARISATION.parameters)
LINEARISED_FACTOR = SHARE * (SWING**2 - 1.0) / POSITION**2


@pytest.mark.parametrize(
    ("controller", "factor", "duration", "tolerance", "plant", "drive"),
    [
        ("adaptive.py:ADAPTIVE", 8.0, 30.0, 1e-2, "analytic", "ideal"),
        ("hierarchical_sliding_mode.py:HIERARCHICAL", 8.0 + 9.0 * 0.3, 30.0, 1e-2, "analytic", "ideal"),
        ("super_twisting.py:SUPER_TWISTING", 8.0, 20.0, 1e-3, "analytic", "ideal"),
        ("lmi_regions.py:LMI_REGIONS", -LMI_GAINS[2] / LMI_GAINS[0], 25.0, 1e-3, "analytic", "ideal"),
        ("partial_linearisation.py:LINEARISATION", LINEARISED_FACTOR, 25.0, 1e-3, "analytic", "ideal"),
        ("partial_linearisation.py:LINEARISATION", LINEARISED_FACTOR, 25.0, 1e-3, "mujoco", "velocity"),
    ],
)
def test_drives_rest_where_the_lean_of_the_rope_balances_the_error(
    controller: str, factor: float, duration: float, tolerance: float, plant: str, drive: str
) -> None:
    """Their error is a factor times the horizontal distance of the load from its drive."""
    settings = [f"duration={duration}", "workspace.on_exit='record'"]
    run = simulate(controller, *settings, plant=plant, drive=drive)
    assert np.abs(run.block("disturbance")[-1]).max() > 0.1
    state = run.block("state")[-1]
    for joint, angle, start in ((0, 8, 1.0), (2, 6, 0.77)):
        assert abs(state[angle]) > 0.05
        assert state[joint] - start == pytest.approx(factor * state[4] * state[angle], rel=tolerance)


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
@pytest.mark.parametrize(
    ("controller", "limit"),
    [("multi_objective_hinf.py:MULTI_OBJECTIVE_HINF", 1e-5), ("two_degree_of_freedom.py:TWO_DOF", 1e-4)],
)
def test_controller_with_integral_leaves_no_error(controller: str, limit: float, plant: str) -> None:
    run = simulate(controller, plant=plant, drive="velocity")
    assert np.abs(run.block("state")[-1, [6, 8]]).min() > 0.05, "the rope leans both ways"
    assert np.abs(run.block("error")[-1, :2]).max() < limit


@pytest.mark.parametrize(
    ("reference", "settings"),
    [("lqg.py:LQG", []), ("adrc.py:ADRC", ["controller.adrc.bandwidth=1.0", "controller.adrc.observer=6.0"])],
)
def test_strong_disturbance_causes_no_windup_of_observer(reference: str, settings: list[str]) -> None:
    """An observer that ignores limits would estimate a growing disturbance, and commands would grow."""
    effects = [f"effects.{effect}={{}}" for effect in ("limits", "sensing", "rope", "body", "delay")]
    strong = ["disturbances.0.force=[3.0,-2.25,0.0]", "rig.load_mass=0.8"]
    pulse = str(FOLDER / "scenarios" / "pulse.toml")
    run = simulate(reference, *strong, *settings, *effects, scenario=pulse, plant="mujoco", drive="velocity")
    assert run.block("command")[:, 3:5].any(), "a limit acts"
    assert run.status.label == "completed"
    assert run_metrics(run).final_error_m < 0.05

"""Controllers with their own observer stay stable when the limits of drives act."""

import pytest

from cranectl import open_controller
from cranectl.metrics import run_metrics
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from tests.conftest import ROOT

BENCHMARK = ROOT / "validation" / "benchmark"


@pytest.mark.parametrize(
    ("reference", "settings"),
    [("lqg.py:LQG", []), ("adrc.py:ADRC", ["controller.adrc.bandwidth=1.0", "controller.adrc.observer=6.0"])],
)
def test_strong_disturbance_causes_no_windup_of_observer(reference: str, settings: list[str]) -> None:
    """An observer that ignores limits would estimate a growing disturbance, and commands would grow."""
    scenario = load_scenario(
        str(BENCHMARK / "scenarios" / "pulse.toml"),
        overrides=[
            "disturbances.0.force=[3.0,-2.25,0.0]", "rig.load_mass=0.8", *settings,
            *(f"effects.{effect}={{}}" for effect in ("limits", "sensing", "rope", "body", "delay")),
        ],
    )  # fmt: skip
    run = simulate_run(
        scenario, plant="mujoco", drive="velocity", controller=open_controller(str(BENCHMARK / reference))
    )
    assert run.block("command")[:, 3:5].any(), "a limit acts"
    assert run.status.label == "completed"
    assert run_metrics(run).final_error_m < 0.05

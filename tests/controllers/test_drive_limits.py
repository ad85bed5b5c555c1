"""Planning, controllers and viewers use the same limits of the drives."""

import json

import numpy as np
import pytest

from cranectl import open_controller
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.planning.limits import limits_of
from cranectl.report.viewer_layouts import layout_json
from cranectl.scenario import Scenario
from cranectl.simulate import PlannedReference
from cranectl.simulate.prepared import nominal_crane
from tests.conftest import ROOT, closed_loop

NUMBERS = {"velocity": [0.5, 0.4, 0.3], "acceleration": [0.2, 0.15, 6.0], "force": [60.0, 40.0, 30.0]}
OF_RUN = [f"effects.limits.{name}={value}" for name, value in NUMBERS.items()]
OF_RIG = [*(f"rig.{setting}" for setting in OF_RUN), "effects.limits={}"]
LAWS = [
    "lqr-offset-free",
    *(
        str(ROOT / "validation" / "benchmark" / law)
        for law in ("lqg.py:LQG", "adrc.py:ADRC", "composite_nonlinear_feedback.py:CNF")
    ),
]


def scenario(settings: list[str]) -> Scenario:
    return load_scenario("fixed-position", overrides=["duration=1.0", "disturbances=[]", *settings])


def parameters(law: str, settings: list[str]) -> np.ndarray:
    name = law if law == "lqr-offset-free" else open_controller(law)
    chosen_scenario = scenario(settings)
    design = ALL_CONTROLLERS.design(name, chosen_scenario)
    controller = ALL_CONTROLLERS.of_design(design)
    nominal = nominal_crane(
        chosen_scenario, design, controller, "velocity", PlannedReference.of(chosen_scenario)
    )
    return controller.prepare(nominal)[0]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.rpartition("/")[2])
def test_a_controller_receives_the_limits_of_the_run(law: str) -> None:
    stated = parameters(law, OF_RUN)
    assert np.isin(NUMBERS["acceleration"][:2], stated).all()
    assert np.array_equal(stated, parameters(law, OF_RIG))
    assert not np.array_equal(stated, parameters(law, ["effects.limits={}"]))


def test_a_run_is_the_same_whether_the_scenario_or_its_rig_states_them() -> None:
    push = "duration=1.0", "disturbances=[{force=[3.0, -2.0, 0.0], start=0.1, end=0.4}]"
    stated, of_rig, free = (
        closed_loop("fixed-position", "lqr-offset-free", "elastic", "velocity", *settings, *push)
        for settings in (OF_RUN, OF_RIG, ["effects.limits={}"])
    )
    assert np.abs(stated.block("state") - free.block("state")).max() > 1e-3, "limits act"
    assert np.array_equal(stated.block("state"), of_rig.block("state"))


def test_planning_and_the_panels_that_drive_by_hand_take_the_same() -> None:
    stated, of_rig = scenario(OF_RUN), scenario(OF_RIG)
    assert stated.drive_limits == of_rig.drive_limits == stated.limited_rig.effects.limits
    assert np.array_equal(limits_of(stated).velocity, limits_of(of_rig).velocity)
    panels = json.loads(layout_json("live", rig=stated.limited_rig))["configById"].values()
    wishes = [abs(panel["upButton"]["value"]) for panel in panels if "upButton" in panel]
    assert wishes
    assert max(wishes) <= max(NUMBERS["velocity"])
    assert scenario([]).limited_rig is not None
    assert scenario([]).drive_limits == scenario([]).rig.effects.limits

"""At both ends of every number of planning, rig and segments a motion keeps its limits or is refused.

The cases come from the schemas, so that new keys are tried too (`tests.ranges`).
"""

from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from cranectl.planning import load_scenario
from cranectl.reference import Trajectory
from cranectl.scenario.along_path import Arc, Line
from cranectl.scenario.effects import DriveLimits
from cranectl.scenario.planning import PlanningSettings
from cranectl.scenario.recorded import Driven
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.segments import Hold, Move, WayPoints
from cranectl.support.errors import InputError
from tests.ranges import changes, ends, put, result_or_refusal, share_of
from tests.reference.recordings import inline, largest_excess

SHARE = 24
START = [0.5, 0.5, -0.7]
TABLES: dict[str, Any] = {
    "planning": {
        **PlanningSettings().model_dump(mode="json"),
        "share": 0.9,
        "jerk": [50.0, 50.0, 50.0],
        "load_box": [[0.0, 2.0], [0.0, 1.54], [-1.4, 0.0]],
    },
    "rig": RigParameters().model_dump(mode="json", exclude={"effects"}) | {"trolley_motor_mass": 0.0},
    "effects": {"limits": DriveLimits().model_dump(mode="json")},
}
POINTS = [START, [0.8, 0.8, -0.7], [1.2, 0.9, -0.9]]
SEGMENTS: dict[str, tuple[type[BaseModel], dict[str, Any]]] = {
    "move": (Move, {"kind": "move", "to": POINTS[2], "via": [POINTS[1]], "duration": "shortest"}),
    "line": (Line, {"kind": "line", "to": POINTS[2], "duration": "shortest"}),
    "arc": (Arc, {"kind": "arc", "centre": [0.9, 0.7], "angle": 1.0, "duration": "shortest"}),
    "timed": (WayPoints, {"kind": "waypoints", "points": POINTS, "times": [0.0, 3.0, 6.0]}),
    "with speeds": (WayPoints, {"kind": "waypoints", "points": POINTS, "speed": [0.1, 0.2, 0.1]}),
    "with a speed": (WayPoints, {"kind": "waypoints", "points": POINTS, "speed": 0.1}),
    "hold": (Hold, {"kind": "hold", "duration": 1.0}),
    "driven": (
        Driven,
        {
            "kind": "driven",
            "duration": 8.0,
            "period": 0.001,
            "bandwidth": 8.0,
            "speed": [0.3, 0.3, 0.2],
            "low": [0.1, 0.1, -1.2],
            "high": [1.8, 1.4, -0.2],
            "wishes": [[0.1, 0.2, 0.1, 0.0], [0.5, 0.0, 0.0, 0.0]],
        },
    ),
}


def cases() -> list[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Return names of changes, each with the tables of the scenario and its segment."""
    variants = {}
    for table, model in (
        ("planning", PlanningSettings),
        ("rig", RigParameters),
        ("effects.limits", DriveLimits),
    ):
        for key, value in ends(model):
            if key[0] != "effects":  # of a rig: they are tried below `effects`
                whole = (*table.split("."), *key)
                name = f"{'.'.join(map(str, whole))}={value!r}"
                variants[name] = (name, put(TABLES, whole, value), SEGMENTS["move"][1])
    for segment, (model, table) in SEGMENTS.items():
        for name, changed in changes(model, table):
            variants[f"{segment}: {name}"] = (f"{segment}: {name}", TABLES, changed)
    return list(variants.values())


CASES = cases()
# Always tried: these once ended in a traceback, a warning of NumPy, out of memory, or an unclear error.
ALWAYS_TRIED = ("planning.lean", "planning.jerk.0", "hold: duration", "driven: period", "driven: wishes")


def overrides(tables: dict[str, Any], segment: dict[str, Any]) -> list[str]:
    assignments = [f"{name}={inline(table)}" for name, table in tables.items()]
    return [*assignments, "disturbances=[]", "duration=600", f"reference.start={START}",
            f"reference.segments=[{inline(segment)}]"]  # fmt: skip


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", share_of(CASES, SHARE, ALWAYS_TRIED), ids=lambda case: case[0])
def test_a_motion_keeps_its_limits_or_is_refused_with_a_remedy(
    case: tuple[str, dict[str, Any], dict[str, Any]],
) -> None:
    _, tables, segment = case
    changes = overrides(tables, segment)
    scenario = result_or_refusal(lambda: load_scenario("fixed-position", overrides=changes))
    if isinstance(scenario, InputError):
        assert scenario.found
        assert scenario.remedy
        return
    trajectory = Trajectory.of(scenario.reference)
    assert trajectory.jumps() == []
    time = np.linspace(0.0, trajectory.joints[-1], 2001)
    assert np.isfinite(trajectory.sample(time)).all()
    reached = trajectory.sample(np.array([0.0, trajectory.joints[-1]]))[:, :3]
    assert reached[0] == pytest.approx(START, abs=1e-12)
    if end := segment.get("to") or segment.get("points", [None])[-1]:
        assert reached[1] == pytest.approx(end, rel=1e-12)
    if segment.get("duration") == "shortest":
        assert largest_excess(scenario, 1001) <= 1e-8


def test_every_number_is_tried_at_both_ends() -> None:
    names = {name.rpartition("=")[0] for name, *_ in CASES}
    assert {"planning.lean", "rig.gravity", "rig.load_mass", "effects.limits.force.2", "arc: angle"} <= names
    assert {"move: to.2", "move: via.0.1", "timed: times.2", "with a speed: speed", "driven: low.0"} <= names
    assert len(CASES) > 150

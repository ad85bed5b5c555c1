"""Every setting of a segment and of its planning changes the motion, or is refused or reported."""

import json
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.reference import Trajectory
from cranectl.scenario.along_path import Arc, BlendedPath, Line
from cranectl.scenario.load import ScenarioFile
from cranectl.scenario.planning import PlanningSettings
from cranectl.scenario.recorded import Driven
from cranectl.scenario.segments import Hold, Move, Samples, Spline, WayPoints
from cranectl.simulate.idle_settings import RunKind
from cranectl.support.errors import InputError
from tests.reference.recordings import inline

RUN_KIND = RunKind("analytic", "velocity", "lqr")
START = [0.5, 0.5, -0.7]
BASE = [
    "disturbances=[]", "duration=60", f"reference.start={START}",
    "planning.jerk=[20.0,20.0,20.0]",
]  # fmt: skip
TO = [0.62, 0.56, -0.66]
POINTS = [START, [0.6, 0.55, -0.68], TO]
SI = {"time": "s", "length": "m"}
SEGMENTS: dict[str, dict[str, Any]] = {
    "line": {"kind": "line", "to": TO, "duration": 2.0},
    "shortest": {"kind": "line", "to": TO, "duration": "shortest"},
    "quickest": {"kind": "line", "to": TO, "time_law": "minimum-time"},
    "arc": {"kind": "arc", "centre": [0.6, 0.6], "angle": 1.0, "duration": 3.0},
    "hold": {"kind": "hold", "duration": 1.0},
    "move": {"kind": "move", "to": [0.62, 0.5, -0.7]},
    "short move": {"kind": "move", "to": [0.62, 0.5, -0.7], "duration": "shortest"},
    "timed": {"kind": "waypoints", "points": POINTS, "times": [0.0, 1.5, 3.0]},
    "at a speed": {"kind": "waypoints", "points": POINTS, "speed": 0.05},
    "file": {"kind": "waypoints", "file": "points.csv", "units": SI, "offset": [0.0, 0.0, 0.0]},
    "samples": {"kind": "samples", "file": "samples.csv", "units": SI, "spans": 8},
    "spline": {"kind": "spline", "degree": 9, "breaks": [0.0, 2.0], "coefficients": [START] * 5 + [TO] * 5},
    "driven": {
        "kind": "driven", "duration": 12.0, "period": 0.001, "bandwidth": 8.0, "speed": [0.3, 0.3, 0.2],
        "low": [0.45, 0.45, -0.75], "high": [0.55, 0.55, -0.65],
        "wishes": [[0.1, 0.2, 0.1, 0.1], [0.8, -0.3, -0.2, -0.1], [1.5, 0.0, 0.0, 0.0], [6.0, 0.0, 0.0, 0.0]],
        "goals": [[2.0, 0.5, 0.5, -0.7]],
    },
}  # fmt: skip
CHANGES: list[tuple[str, str, Any]] = [
    ("line", "to", [0.62, 0.56, -0.6]), ("line", "duration", 2.5), ("line", "time_law", "degree-5"),
    ("line", "blend", 0.01), ("quickest", "blend", 0.01), ("arc", "blend", 0.01),
    ("arc", "centre", [0.6, 0.7]), ("arc", "angle", 0.5), ("arc", "duration", 2.5),
    ("arc", "time_law", "degree-5"),
    ("hold", "duration", 2.0),
    ("move", "to", [0.6, 0.5, -0.7]), ("move", "via", [[0.55, 0.52, -0.7]]), ("move", "plane", True),
    ("move", "constant_rope", True), ("move", "duration", "shortest"),
    ("short move", "plane", True), ("short move", "constant_rope", True),
    ("short move", "via", [[0.55, 0.52, -0.7]]),
    ("timed", "points", [START, [0.6, 0.6, -0.68], TO]), ("timed", "times", [0.0, 1.4, 3.0]),
    ("timed", "time_law", "minimum-time"), ("timed", "offset", [0.01, 0.0, 0.0]),
    ("timed", "signs", [1, 1, -1]),
    ("timed", "topic", "mujoco/load"), ("timed", "units", {"time": "ms"}), ("timed", "columns", {"x": "X"}),
    ("at a speed", "speed", 0.06),
    *((of, key, value) for of in ("file", "samples") for key, value in (
        ("file", "other.csv"), ("columns", {"x": "y"}), ("units", {"time": "s", "length": "cm"}),
        ("units", {"time": "ms", "length": "m"}), ("topic", "mujoco/load"), ("signs", [1, 1, -1]),
        ("offset", [0.01, 0.0, 0.0]),
    )),
    ("file", "columns", {"speed": "v"}), ("file", "units", {**SI, "speed": "m/s"}),
    ("file", "times", [0.0, 1.0, 3.0]), ("file", "speed", 0.05),
    ("samples", "spans", 6),
    ("spline", "degree", 7), ("spline", "breaks", [0.0, 3.0]),
    ("spline", "coefficients", [START] * 5 + [POINTS[1]] * 5),
    ("spline", "time_law", "minimum-time"), ("spline", "lasts", 3.0),
    ("driven", "duration", 13.0), ("driven", "period", 0.002), ("driven", "bandwidth", 7.0),
    ("driven", "speed", [0.1, 0.3, 0.2]), ("driven", "low", [0.49, 0.45, -0.75]),
    ("driven", "high", [0.51, 0.55, -0.65]),
    ("driven", "wishes", [[0.1, 0.1, 0.1, 0.1], [1.5, 0.0, 0.0, 0.0], [6.0, 0.0, 0.0, 0.0]]),
    ("driven", "goals", [[2.0, 0.52, 0.5, -0.7]]),
]  # fmt: skip
# Keys that a user does not set, each with the reason.
NOT_TRIED = {
    "kind": "it selects the kind of segment",
    "made_from": "written into logs with a plan",
    "source": "written into logs with a plan",
    "fit": "written into logs with a plan",
    "taken": "computed with a plan",
    "parts": "the segments themselves",
}
OTHER_PLAN: dict[str, Any] = {
    "share": 0.5, "lean": 0.02, "tension": [0.97, 1.02], "jerk": [0.5, 0.5, 0.5], "clearance": 0.68,
    "load_box": [[0.45, 0.65], [0.45, 0.61], [-0.75, -0.699]], "refinement": 2,
}  # fmt: skip


def sampled_reference(overrides: list[str]) -> bytes:
    """Return the reference at 101 times, and these times, as bytes."""
    trajectory = Trajectory.of(load_scenario("fixed-position", overrides=overrides).reference)
    times = np.linspace(0.0, trajectory.joints[-1], 101)
    return trajectory.sample(times).tobytes() + times.tobytes()


def as_override(segment: dict[str, Any]) -> str:
    return f"reference.segments=[{inline(segment)}]"


def with_path(segment: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the segment with its file in `folder`."""
    return {**segment, "file": str(folder / segment["file"])} if "file" in segment else segment


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("files")
    for name, shift in (("points", 0.0), ("other", 0.02)):
        rows = [(1.5 * k, *point[:2], point[2] + shift * (k == 1)) for k, point in enumerate(POINTS)]
        (directory / f"{name}.csv").write_text(
            "time,x,y,z\n" + "".join(f"{','.join(map(str, row))}\n" for row in rows)
        )
    time = np.linspace(0.0, 4.0, 81)
    s = np.clip((time - 0.5) / 3.0, 0.0, 1.0)
    bump = 0.1 * s**5 * (126.0 - 420.0 * s + 540.0 * s**2 - 315.0 * s**3 + 70.0 * s**4)
    columns = np.column_stack([time, START[0] + bump, START[1] + 0.5 * bump, START[2] + 0.2 * bump])
    np.savetxt(directory / "samples.csv", columns, delimiter=",", header="time,x,y,z", comments="")
    return directory


# Planning a move in minimum time takes seconds; short moves and quickest lines try most of the same keys.
SLOW = ("move", "quickest-refinement")


def cases(changes: Sequence[tuple[Any, ...]]) -> list[Any]:
    """Return the parameters of tests, marked as slow where they are."""
    slow = [change[0] in SLOW or f"{change[0]}-{change[1]}" in SLOW for change in changes]
    marks = [[pytest.mark.slow] * is_slow for is_slow in slow]
    return [pytest.param(*change, marks=each) for change, each in zip(changes, marks, strict=True)]


@pytest.mark.parametrize(("name", "key", "value"), cases(CHANGES), ids=lambda part: str(part)[:20])
def test_a_setting_of_a_segment_changes_the_motion_or_is_refused(
    name: str, key: str, value: Any, folder: Path
) -> None:
    original = with_path(SEGMENTS[name], folder)
    changed = with_path({**SEGMENTS[name], key: value}, folder)
    before = sampled_reference([*BASE, as_override(original)])
    try:
        assert sampled_reference([*BASE, as_override(changed)]) != before
    except InputError as error:
        assert error.found  # noqa: PT017 - an empty error is no refusal


@pytest.mark.parametrize(
    ("name", "key"), cases([*product(("line", "shortest", "quickest"), PlanningSettings.model_fields)])
)
def test_a_setting_of_planning_changes_the_motion_or_is_reported(name: str, key: str) -> None:
    before = sampled_reference([*BASE, as_override(SEGMENTS[name])])
    overrides = [*BASE, as_override(SEGMENTS[name]), f"planning.{key}={json.dumps(OTHER_PLAN[key])}"]
    read = ScenarioFile.read("fixed-position", overrides=overrides)
    try:
        changed = sampled_reference(overrides) != before
    except InputError as error:
        assert error.remedy  # noqa: PT017
        return
    planned = load_scenario("fixed-position", overrides=overrides)
    assert bool(RunKind.find_idle_settings(planned, read, [f"planning.{key}"], [RUN_KIND])) != changed


def test_a_load_box_replaces_the_clearance_from_the_ends_of_the_rig() -> None:
    overrides = [
        *BASE,
        as_override(SEGMENTS["shortest"]),
        "planning.load_box=[[0.4,0.7],[0.4,0.7],[-0.8,-0.6]]",
    ]
    more = [*overrides, "planning.clearance=0.3"]
    assert sampled_reference(more) == sampled_reference(overrides)
    read = ScenarioFile.read("fixed-position", overrides=more)
    assert RunKind.find_idle_settings(
        load_scenario("fixed-position", overrides=more), read, ["planning.clearance"], [RUN_KIND]
    )


def test_every_setting_of_every_segment_is_tried() -> None:
    kinds = (Line, Arc, BlendedPath, Hold, Move, WayPoints, Samples, Spline, Driven)
    fields = {
        (kind.model_fields["kind"].annotation.__args__[0], key) for kind in kinds for key in kind.model_fields
    }
    tried = {(SEGMENTS[name]["kind"], key) for name, key, _ in CHANGES}
    left = {(kind, key) for kind, key in fields - tried if key not in NOT_TRIED}
    assert left == {("path", "duration"), ("path", "time_law")}  # as of a line, once it is planned


@pytest.mark.slow
def test_a_move_that_needs_a_varying_rope_is_refused_with_constant_rope() -> None:
    """Along straight lines, with which a plan begins, the rope's length varies."""
    tight = [*BASE[:-1], "planning.tension=[0.995,1.01]", "planning.share=0.9"]
    move = {"kind": "move", "to": [0.6, 0.5, -0.7], "constant_rope": True}
    with pytest.raises(InputError, match="no motion with constant_rope") as raised:
        sampled_reference([*tight, as_override(move)])
    assert raised.value.remedy.startswith("leave constant_rope out")
    sampled_reference([*tight, as_override({**move, "constant_rope": False})])

"""Scenarios that can be run: as they are read, with what is to be planned planned."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cranectl.reference.given import samples, way_points
from cranectl.reference.planning.given_path import check_follower, path_with_blends
from cranectl.reference.planning.limits import share_of
from cranectl.reference.trajectory import end_point
from cranectl.scenario import Scenario, Segment, read_scenario, scenario_file
from cranectl.scenario.along_path import AlongPath, Arc, Line
from cranectl.scenario.segments import Move, Samples, Spline, WayPoints, is_planned, seconds
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError


def load_scenario(
    name_or_path: str | Path, *, rig: str | Path | None = None, overrides: Sequence[str] = ()
) -> Scenario:
    """Load a scenario by name or from a TOML file, as `read_scenario` does, and plan it."""
    scenario = read_scenario(name_or_path, rig=rig, overrides=overrides)
    return planned(scenario, scenario_file(name_or_path).parent)


def planned(scenario: Scenario, directory: Path = Path()) -> Scenario:
    """The scenario with segments that say when the load is where, in place of those that do not.

    `directory`: where the scenario's file is, to which files that it names are relative. Raises InputError
    for what cannot be planned.
    """
    if scenario.reference.planned:
        return scenario
    segments: list[Segment] = []
    here = np.array(scenario.reference.start)
    blended: list[Line | Arc] = []  # with what follows
    asked = scenario.reference.segments
    for index, segment in enumerate(asked):
        if isinstance(segment, Line | Arc) and segment.blend:
            follower = asked[index + 1] if index + 1 < len(asked) else None
            check_follower(follower, f"reference.segments.{index}")
            blended.append(segment)
            continue
        where = f"reference.segments.{index - len(blended)}"
        if blended and isinstance(segment, Line | Arc):
            segment, blended = path_with_blends([*blended, segment], here, where), []
        for ready in (
            [segment] if is_planned(segment) else _planned(segment, here, scenario, directory, where)
        ):
            segments.append(ready)
            here = end_point(ready, here)
    _check_length(sum(map(seconds, segments)), scenario)
    reference = scenario.reference.model_copy(update={"segments": tuple(segments)})
    # What the plan was made with stays, whatever effects are added to a run of it.
    planning = scenario.planning.model_copy(update={"share": share_of(scenario)})
    return scenario.model_copy(update={"reference": reference, "planning": planning})


def _check_length(length: float, scenario: Scenario) -> None:
    if length > scenario.duration * (1.0 + 1e-12):
        raise InputError(
            f"{scenario.name}: the segments last {length:.6g} s, longer than its {scenario.duration:g} s",
            allowed="a run that its reference fits into",
            remedy=f"duration = {np.ceil(length):g}, or more to see the load come to rest",
        )


def _planned(
    segment: Segment, start: Array, scenario: Scenario, directory: Path, where: str
) -> Sequence[Segment]:
    if isinstance(segment, WayPoints):
        segment = way_points(segment, start, scenario, directory, where)
        if is_planned(segment):
            return [segment]
    if isinstance(segment, Samples):
        return [samples(segment, start, scenario, directory, where)]
    from cranectl.reference.planning.plan import planned_segment  # its solver is loaded where it is needed

    assert isinstance(segment, AlongPath | Spline | Move)
    return planned_segment(segment, start, scenario, where)

"""Plan the segments of a scenario, one after the other."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cranectl.planning.blends import check_follower, path_with_blends
from cranectl.planning.limits import share_of
from cranectl.planning.plan import planned_segment
from cranectl.reference.given import samples, way_points
from cranectl.reference.sanity import check_length
from cranectl.reference.trajectory import end_point
from cranectl.scenario import Scenario, Segment
from cranectl.scenario.along_path import AlongPath, Arc, Line
from cranectl.scenario.segments import Move, Samples, Spline, WayPoints, is_planned, seconds
from cranectl.support.arrays import Array


def with_planned_segments(scenario: Scenario, directory: Path) -> Scenario:
    """Plan the segments of a scenario and read those that are in files; the counterpart of `planned`."""
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
    length = sum(map(seconds, segments))
    check_length(length, scenario, f"{scenario.name}: the segments last", "leave segments out")
    reference = scenario.reference.model_copy(update={"segments": tuple(segments)})
    # What the plan was made with stays, whatever effects are added to a run of it.
    planning = scenario.planning.model_copy(update={"share": share_of(scenario)})
    return scenario.model_copy(update={"reference": reference, "planning": planning})


def _planned(
    segment: Segment, start: Array, scenario: Scenario, directory: Path, where: str
) -> Sequence[Segment]:
    if isinstance(segment, WayPoints):
        found = way_points(segment, start, scenario, directory, where)
        if all(map(is_planned, found)):
            return found
        (segment,) = found
    if isinstance(segment, Samples):
        return [samples(segment, start, scenario, directory, where)]
    assert isinstance(segment, AlongPath | Spline | Move)
    return planned_segment(segment, start, scenario, where)

"""The cases of `bang_bang` as tasks of the planner, or a share of many cases."""

import itertools
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from cranectl.planning import load_scenario
from cranectl.planning.limits import Limits, limits_of
from cranectl.planning.plan import RANGE_SCALE, free_motion
from cranectl.planning.problem import Task
from cranectl.planning.route import add_stops
from cranectl.planning.shortest import find_shortest_duration
from cranectl.reference.geometry import Straight
from cranectl.scenario import Scenario
from cranectl.scenario.planning import Obstacle
from cranectl.scenario.segments import Move
from tests.planning.bang_bang import CASES, Along
from tests.planning.bang_bang import Move as Ends

WALL = Obstacle(name="wall", low=(0.8, -1.0, -1.4), high=(1.2, 3.0, -0.6))  # wider than the rig
CASES_OF_1000 = int(os.environ.get("PLAN_CASES", 1000))
LIMIT_SHARE = 0.98  # of plans that are compared with bounds


def share(cases: list[Any]) -> list[Any]:
    """Return the first of `cases`: with PLAN_CASES=200 a fifth of them."""
    return cases[: -(-len(cases) * CASES_OF_1000 // 1000)]


def scenario(lag: bool = True, share: float = LIMIT_SHARE, obstacles: Sequence[Obstacle] = ()) -> Scenario:
    """Return a scenario of the laboratory's rig without a motion."""
    overrides = [f"planning.share={share}", f"control.lag_compensation={str(lag).lower()}", "duration=60.0"]
    empty = load_scenario("fixed-position", overrides=["disturbances=[]", *overrides])
    return empty.model_copy(update={"obstacles": tuple(obstacles)})


def limits_for(points: Sequence[np.ndarray], of: Scenario) -> Limits:
    """Return the planner's limits for a motion through `points`."""
    size = sum(float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(points))
    return limits_of(of)._replace(size=RANGE_SCALE * size)


def move(name: str, of: Scenario | None = None, lag: bool = True, **options) -> Task:  # type: ignore[no-untyped-def]
    """Return the task of a case, with its wall; options are those of a segment."""
    case = CASES[name]
    assert not isinstance(case, Along)
    of = of or scenario(lag, obstacles=[WALL] if case.wall else [])
    return task(case, of, **options)


def task(ends: Ends, of: Scenario, **options) -> Task:  # type: ignore[no-untyped-def]
    """Return the task of a move between two points."""
    segment = Move(kind="move", to=ends.end, **options)
    points = [np.array(point) for point in (ends.start, *segment.via, ends.end)]
    limits = limits_for(points, of)
    corners = add_stops(points, limits, "")
    longest = sum(find_shortest_duration(Straight(a, b), limits, "") for a, b in itertools.pairwise(corners))
    return free_motion(segment, points, corners, limits, longest)

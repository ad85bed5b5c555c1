"""Plan the segments of a scenario in minimum time, or in the shortest duration of the law of degree 9."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from cranectl.planning.blends import check_follower, path_with_blends
from cranectl.planning.checks import check_count, check_duration, check_least_time, check_point
from cranectl.planning.limits import Limits, key_of, limits_of, share_of
from cranectl.planning.minimum_time import (
    SPANS,
    FastestMotion,
    FreeCoordinates,
    along_parts,
    along_path,
    minimum_time,
)
from cranectl.planning.problem import Task
from cranectl.planning.proof import PROOF_MARGIN
from cranectl.planning.review import claim_for
from cranectl.planning.route import add_stops, find_passages, round_corners
from cranectl.planning.shortest import (
    estimate_shortest_duration,
    find_limiting_constraint,
    find_shortest_duration,
)
from cranectl.reference import Geometry, TimeLaw, Trajectory, spline_segments
from cranectl.scenario import (
    Along,
    Arc,
    BlendedPath,
    FromFile,
    Line,
    Move,
    RigParameters,
    Scenario,
    Segment,
    Spline,
)
from cranectl.support import Array, InputError, kept

GUESS_OFFSET = 0.1  # of a move's length, by which the first guess bulges aside and up
MIN_MOVE = 1e-6  # [m] from one point of a move to the next
RANGE_SCALE = 0.1  # of a motion's length, the unit of excesses over ranges
POSITION_ROUNDING = 128.0 * float(np.finfo(float).eps)  # of enclosed positions, relative to the ranges
_PLANS: TypeAdapter[list[tuple[Segment, str]]] = TypeAdapter(list[tuple[Segment, str]])  # with claims
_SEGMENTS: dict[str, list[Segment]] = {}


def plan_segments(scenario: Scenario, directory: Path) -> Scenario:
    """Return the scenario with every segment planned or read from its file, and blended lines joined."""
    check_count(scenario)
    segments: list[Segment] = []
    point = np.array(scenario.reference.start)
    to_blend: list[Line | Arc] = []  # into the next segment
    requested = scenario.reference.segments
    for index, segment in enumerate(requested):
        if isinstance(segment, Line | Arc) and segment.blend:
            follower = requested[index + 1] if index + 1 < len(requested) else None
            check_follower(follower, f"reference.segments.{index}")
            to_blend.append(segment)
            continue
        where = f"reference.segments.{index - len(to_blend)}"
        if to_blend and isinstance(segment, Line | Arc):
            segment, to_blend = path_with_blends([*to_blend, segment], point, where), []
        ready = [segment] if segment.is_planned else _prepare(segment, point, scenario, directory, where)
        for planned in ready:
            segments.append(planned)
            point = Trajectory.end_of(planned, point)
    length = sum(segment.seconds for segment in segments)
    scenario.check_reference_fits(length, f"{scenario.name}: the segments last", "leave segments out")
    reference = scenario.reference.model_copy(update={"segments": tuple(segments)})
    # The share of the plan stays, even if a run adds effects.
    planning = scenario.planning.model_copy(update={"share": share_of(scenario)})
    return scenario.model_copy(update={"reference": reference, "planning": planning})


def _prepare(
    segment: Segment, start: Array, scenario: Scenario, directory: Path, where: str
) -> Sequence[Segment]:
    if isinstance(segment, FromFile):
        ready = spline_segments(segment, start, scenario, directory, where)
        if all(segment.is_planned for segment in ready):
            return ready
        (segment,) = ready
    assert isinstance(segment, Along | Spline | Move)
    return _plan_segment(segment, start, scenario, where)


def _plan_segment(
    segment: Along | Spline | Move, start: Array, scenario: Scenario, where: str
) -> list[Segment]:
    """Return the planned segment, or its replacements. Plans are stored on disk and used again."""
    key = key_of(segment, start, scenario)
    if key not in _SEGMENTS:
        arguments = segment, start, scenario, where
        # `kept` does not know of this solver, and another version may find another plan.
        text = kept("plans", [key, version("clarabel")], lambda: _plan_as_json(*arguments))
        plans = _PLANS.validate_json(text)
        _SEGMENTS[key] = [planned.claiming(claim) for planned, claim in plans]
    return [
        planned.holding(segment.held)
        if isinstance(planned, Spline) and isinstance(segment, Spline)
        else planned
        for planned in _SEGMENTS[key]
    ]


def _plan_as_json(segment: Along | Spline | Move, start: Array, scenario: Scenario, where: str) -> str:
    if isinstance(segment, Move):
        segments = plan_move(segment, start, scenario, where)
    elif isinstance(segment, BlendedPath) and segment.is_in_minimum_time:
        segments = plan_with_blends(segment, start, scenario, where)
    else:
        segments = [plan_along(segment, start, scenario, where)]
    plans = []
    for planned in segments:
        plans.append((planned, claim_for(planned, start, scenario)))
        start = Trajectory.end_of(planned, start)
    return _PLANS.dump_json(plans).decode()


def limits_for(length: float, scenario: Scenario) -> Limits:
    """Return the limits of a motion over `length` [m], whose scale of positions stays above rounding."""
    limits = limits_of(scenario)
    rounding = POSITION_ROUNDING * float(np.abs([limits.load, limits.axes]).max())
    return limits._replace(size=max(RANGE_SCALE * length, rounding / PROOF_MARGIN))


def plan_along(segment: Along | Spline, start: Array, scenario: Scenario, where: str) -> Along | Spline:
    """Plan a segment on a given path, by the law of degree 9 unless the search finds a faster one."""
    geometry = Geometry.of(segment, start, where)
    limits = limits_for(geometry.length, scenario)
    check_point(start, limits, f"{where}: its start")
    end = geometry.position(1.0)
    check_point(end, limits, f"{where}: its end")
    check_least_time(start, end, limits, where)
    quickest = np.inf
    if segment.is_in_minimum_time:
        guess = estimate_shortest_duration(geometry, limits, where)
        motion = _find_faster(along_path(geometry, limits, guess), scenario)
        if motion and motion.duration <= Scenario.MAX_SECONDS:
            return _set_time_law(segment, motion)
        quickest = motion.duration if motion else np.inf
    duration = find_shortest_duration(geometry, limits, where)
    constraint = find_limiting_constraint(geometry, limits, duration)
    check_duration(min(duration, quickest), constraint, limits, where)
    return segment.timed(duration, "degree-9")


def plan_with_blends(segment: BlendedPath, start: Array, scenario: Scenario, where: str) -> list[Segment]:
    """Plan one motion along all parts. Return the parts with a stop at each corner if that is as fast."""
    stopping: list[Along | Spline] = []
    parts = Geometry.parts_of(segment.parts, start, where)
    for index, (part, path) in enumerate(zip(segment.parts, parts, strict=True)):
        alone = part.model_copy(update={"blend": 0.0})
        stopping.append(plan_along(alone, path.start, scenario, f"{where}, part {index + 1}"))
    geometry = Geometry.of(segment, start, where)
    limits = limits_for(geometry.length, scenario)
    time_laws = [
        (TimeLaw.of(part), part.seconds, path.length) for part, path in zip(stopping, parts, strict=True)
    ]
    motion = _find_faster(along_parts(geometry, limits, time_laws), scenario)
    if motion and motion.duration <= Scenario.MAX_SECONDS:
        return [_set_time_law(segment, motion)]
    return list(stopping)


def _set_time_law(segment: Along | Spline, motion: FastestMotion) -> Along | Spline:
    # A time law in a scenario must lie within 0 and 1, which the solver may exceed by rounding.
    coefficients = tuple(np.clip(motion.coefficients[:, 0], 0.0, 1.0).tolist())
    return segment.timed(motion.duration, coefficients)


def plan_move(segment: Move, start: Array, scenario: Scenario, where: str) -> list[Segment]:
    """Plan a free motion: the fastest spline, else lines with stops unless `constant_rope` forbids them."""
    requested, rig = segment, scenario.rig
    # A crane with fewer axes moves as others do where these are asked not to move.
    plane, constant = segment.plane or rig.axes != "xy", segment.constant_rope or rig.rope == "fixed"
    segment = segment.model_copy(update={"plane": plane, "constant_rope": constant})
    points = _distinct_points(segment, start)
    size = float(sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(points)))
    limits = limits_for(size, scenario)
    _check_move(segment, points, limits, where)
    corners = add_stops(points, limits, where)
    lines = [Geometry.straight(begin, end) for begin, end in itertools.pairwise(corners)]
    durations = [find_shortest_duration(geometry, limits, where) for geometry in lines]
    quickest = longest = sum(durations)
    if segment.duration is None:
        motion = _find_faster(free_motion(segment, points, corners, limits, longest), scenario)
        if motion and motion.duration <= Scenario.MAX_SECONDS:
            return [_spline_segment(requested, motion)]
        quickest = motion.duration if motion else longest
    slowest = int(np.argmax(durations))
    constraint = find_limiting_constraint(lines[slowest], limits, durations[slowest])
    check_duration(quickest, constraint, limits, where)
    if segment.constant_rope:
        raise InputError(
            f"{where}: no motion with constant_rope is found that takes at most {longest:.4g} s, as straight "
            "lines with a varying rope do",
            allowed="limits of [planning] and of drives that leave room for it",
            remedy="leave constant_rope out, or " * (rig.rope == "hoisted")
            + "relax planning.tension and the other limits",
        )
    return [
        Line(kind="line", to=tuple(geometry.end.tolist()), duration=duration)
        for geometry, duration in zip(lines, durations, strict=True)
    ]


def _distinct_points(segment: Move, start: Array) -> list[Array]:
    """Return start, via points and end of a move, each (3,), without consecutive duplicates."""
    points = [start, *map(np.array, segment.via), np.array(segment.to)]
    distinct = [after for before, after in itertools.pairwise(points) if not np.array_equal(before, after)]
    return [start, *distinct]


def _spline_segment(segment: Move, motion: FastestMotion) -> Spline:
    breaks = np.linspace(0.0, motion.duration, len(motion.coefficients) - TimeLaw.DEGREE + 1)
    return Spline(
        kind="spline",
        degree=7,
        breaks=tuple(breaks.tolist()),
        coefficients=tuple(map(tuple, motion.coefficients.tolist())),
        made_from=segment.model_dump(mode="json", exclude_defaults=True),
    )


def _check_move(segment: Move, points: Sequence[Array], limits: Limits, where: str) -> None:
    """Raise InputError for a move that can be refused without planning it."""
    if len(points) == 1:
        raise InputError(
            f"{where} moves nowhere: the load is at {segment.to} already",
            allowed="a move to another place",
            remedy='to stay in place use kind = "hold"',
        )
    nearest = min(float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(points))
    if nearest < MIN_MOVE * (1.0 - 1e-6):  # rounding
        raise InputError(
            f"{where} moves by {nearest:.3g} m from one of its points to the next",
            allowed=f"at least {MIN_MOVE:g} m, since shorter moves take less than a control period",
            remedy="move the point away, or leave it out",
        )
    names = ["start", *["point in via"] * (len(points) - 2), "end"]
    for name, point in zip(names, points, strict=True):
        check_point(point, limits, f"{where}: its {name}")
    heights = [float(point[2]) for point in points]
    if segment.constant_rope and np.ptp(heights) > RigParameters.ROPE_TOLERANCE * abs(heights[0]):
        raise InputError(
            f"{where}: constant_rope with points at heights from {min(heights):g} to {max(heights):g} m",
            allowed="points of one height, where the load hangs at rest on one length of rope",
            remedy="leave constant_rope out, or make the heights equal",
        )
    x, y = travel = points[-1][:2] - points[0][:2]
    aside = [abs(float(x * (p - points[0])[1] - y * (p - points[0])[0])) for p in points[1:-1]]
    if segment.plane and max(aside, default=0.0) > 1e-9 * float(travel @ travel):
        raise InputError(
            f"{where}: plane = true with a point in via beside the plane through start and end",
            allowed="points in the vertical plane through start and end",
            remedy="leave plane out, or move the point",
        )
    check_least_time(points[0], points[-1], limits, where)


def free_motion(
    segment: Move, points: Sequence[Array], corners: list[Array], limits: Limits, duration: float
) -> Task:
    """Return the task of a move through `points`, first guessed along `corners`."""
    start, end = points[0], points[-1]
    if segment.constant_rope:
        rope = -start[2] * (1.0 + RigParameters.ROPE_TOLERANCE * np.array([-1.0, 1.0]))
        limits = limits._replace(axes=np.vstack([limits.axes[:2], rope]))
    guess = round_corners(corners)
    along = np.array([*(end - start)[:2], 0.0])
    along = along / np.linalg.norm(along) if along.any() else np.array([1.0, 0.0, 0.0])
    aside, up = np.array([-along[1], along[0], 0.0]), np.array([0.0, 0.0, 1.0])
    directions = np.array([along, up]) if segment.plane else np.eye(3)
    direction = aside * (not segment.plane) + up * (not segment.constant_rope)
    bump = GUESS_OFFSET * sum(float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(points)) * direction
    # The fourth power begins and ends with three derivatives at zero.
    guess += np.sin(np.pi * np.linspace(0.0, 1.0, len(guess)))[:, None] ** 4 * bump
    guess = np.clip(guess, *limits.load.T)
    via = points[1:-1]
    via_instants = [float(np.argmin(np.linalg.norm(guess - point, axis=1)) / len(guess)) for point in via]
    passages, instants = find_passages(guess, limits, len(via))
    return Task(
        start=np.zeros(len(directions)),
        end=directions @ (end - start),
        to_load=FreeCoordinates(start, end, directions),
        limits=limits,
        guess=(guess - start) @ directions.T,
        duration=duration,
        spans=SPANS,
        via=tuple(directions @ (point - start) for point in via),
        passages=passages,
        instants=(*via_instants, *instants),
    )


def _find_faster(task: Task, scenario: Scenario) -> FastestMotion | None:
    """Search with `planning.refinement` times the task's spans; return None if no motion is faster."""
    if not np.isfinite(task.duration):  # no finite guess exists
        return None
    refined = minimum_time(replace(task, spans=scenario.planning.refinement * task.spans))
    return refined if refined and refined.duration < task.duration else None

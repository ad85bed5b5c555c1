"""What a planned motion is worth: its proof, the limits that act and when, what no crane could be under."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.reference.planning.given_path import geometry_of, parts_of
from cranectl.reference.planning.limits import AXES, Limits, Quantity, key_of, limits_of, motion, quantities
from cranectl.reference.planning.problem import ToLoad, series_along
from cranectl.reference.planning.proof import Proof, prove
from cranectl.reference.planning.shortest import COEFFICIENTS, DEGREE
from cranectl.reference.time_laws import PLANNED_DEGREE, spline
from cranectl.reference.trajectory import end_point
from cranectl.scenario import Scenario, Segment
from cranectl.scenario.along_path import Arc, BlendedPath, Line, SplineLaw
from cranectl.scenario.segments import Spline, seconds
from cranectl.support.arrays import Array

ACTS = 0.98  # of a limit, from which on it counts as acting
SAMPLES = 501


class Curve(NamedTuple):
    """A segment as a spline of coordinates."""

    breaks: Array
    coefficients: Array
    degree: int
    to_load: ToLoad | None


class Acting(NamedTuple):
    """A limit, and from when to when a motion is at it [s] from the segment's start."""

    name: str
    start: float
    end: float


class Review(NamedTuple):
    """Of one planned segment."""

    segment: int
    planned: str  # what was asked for, in words
    start: float  # [s] in the run
    duration: float  # [s]
    least: float  # that the drives would need without a load [s]
    acting: tuple[Acting, ...]
    proof: Proof
    time: Array  # (N,) [s] from the segment's start
    shares: dict[str, Array]  # of each limit, (N,)
    path: Array  # (N, 3) of the load [m]
    asked: Array  # (M, 3) corners that are blended, or points that are passed, but for the ends [m]

    @property
    def tightest(self) -> tuple[str, float]:
        """The limit with the smallest slack that is proven, and the slack in parts of it."""
        return min(self.proof.slack.items(), key=lambda item: item[1])

    @property
    def by_limit(self) -> dict[str, list[Acting]]:
        """The limits that act, those that do so longest first."""
        found: dict[str, list[Acting]] = {}
        for each in self.acting:
            found.setdefault(each.name, []).append(each)
        lasting = {name: sum(each.end - each.start for each in times) for name, times in found.items()}
        return {name: found[name] for name in sorted(found, key=lambda name: -lasting[name])}

    @property
    def in_short(self) -> str:
        """A line."""
        name, slack = self.tightest
        at = ", ".join(
            f"{limit} for {sum(each.end - each.start for each in times):.2f} s"
            for limit, times in self.by_limit.items()
        )
        proven = f"proven on {self.proof.pieces} pieces, smallest slack {slack:.2g} of {name}"
        return (
            f"{self.planned}, {self.duration:.3f} s; {proven if self.proof.holds else 'NOT proven'}; at {at}"
        )


def reviews(scenario: Scenario) -> list[Review]:
    """Of all segments of a scenario that were planned; none of others."""
    found, here, begins = [], np.array(scenario.reference.start), 0.0
    for index, segment in enumerate(scenario.reference.segments):
        after = end_point(segment, here)
        if asked := in_words(segment):
            found.append(_review(scenario, index, asked, segment, here, begins))
        here, begins = after, begins + seconds(segment)
    return found


def in_words(segment: Segment) -> str:
    """How a segment was planned; nothing if it was not."""
    if isinstance(segment, Spline) and segment.made_from.get("kind") == "move":
        return "a move in minimum time"
    if not isinstance(getattr(segment, "time_law", None), SplineLaw):
        return ""
    if isinstance(segment, BlendedPath):
        return "a path with blended corners in minimum time"
    passed = isinstance(segment, Spline) and segment.made_from
    return f"{'way points' if passed else f'a given {segment.kind}'} in minimum time"


def curve_of(segment: Segment, start: Array) -> Curve:
    """A moving segment of the package's own kinds as a spline of coordinates."""
    if isinstance(segment, Spline) and segment.time_law is None:
        return Curve(np.array(segment.breaks), np.array(segment.coefficients), segment.degree, None)
    assert isinstance(segment, Line | Arc | BlendedPath | Spline)
    to_load = geometry_of(segment, start)
    duration = seconds(segment)
    if isinstance(segment.time_law, SplineLaw):
        coefficients = np.array(segment.time_law.coefficients)[:, None]
        spans = len(coefficients) - PLANNED_DEGREE
        return Curve(np.linspace(0.0, duration, spans + 1), coefficients, PLANNED_DEGREE, to_load)
    return Curve(np.array([0.0, duration]), COEFFICIENTS, DEGREE, to_load)


def sampled(curve: Curve, time: Array, limits: Limits) -> tuple[list[Quantity], Array]:
    """All limited quantities at `time` (N,), and the load's path (N, 3)."""
    series = series_along(curve.breaks, curve.coefficients, curve.degree, time)
    load = curve.to_load(series) if curve.to_load else series
    return quantities(motion(load, limits.gravity), limits), np.stack([axis[0] for axis in load], axis=1)


def _review(
    scenario: Scenario, index: int, asked: str, segment: Segment, start: Array, begins: float
) -> Review:
    limits, curve = limits_of(scenario), curve_of(segment, start)
    time = np.linspace(0.0, seconds(segment), SAMPLES)
    found, path = sampled(curve, time, limits)
    shares = {each.name: _share(each) for each in found}
    acting = [
        Acting(name, float(time[a]), float(time[b]))
        for name, share in shares.items()
        for a, b in _stretches(share >= ACTS)
    ]
    rest = np.array([[*end[:2], -end[2]] for end in (path[0], path[-1])])
    return Review(
        segment=index,
        planned=asked,
        start=begins,
        duration=seconds(segment),
        least=least_time(rest[1] - rest[0], limits),
        acting=tuple(sorted(acting, key=lambda each: each.start)),
        proof=_proven(key_of(segment, start, scenario), curve, limits),
        time=time,
        shares=shares,
        path=path,
        asked=_asked(segment, start),
    )


def _asked(segment: Segment, start: Array) -> Array:
    if isinstance(segment, BlendedPath):
        return np.array([part.start for part in parts_of(segment.parts, start)[1:]])
    if isinstance(segment, Spline) and segment.time_law is not None:
        breaks = np.array(segment.breaks)
        points: Array = spline(breaks, np.array(segment.coefficients), segment.degree)(breaks[1:-1])
        return points
    return np.zeros((0, 3))


_PROVEN: dict[str, Proof] = {}


def _proven(key: str, curve: Curve, limits: Limits) -> Proof:
    """Once in a process: log, report and screen ask for the same."""
    if key not in _PROVEN:
        _PROVEN[key] = prove(*curve[:3], limits, curve.to_load)
    return _PROVEN[key]


def _share(each: Quantity) -> Array:
    """Of a range, one at either end and none in its middle; of a one-sided limit, of it."""
    value: Array = each.series[0]
    if not np.isfinite(each.low):
        return value / each.high
    middle, half = 0.5 * (each.low + each.high), 0.5 * (each.high - each.low)
    share: Array = np.abs(value - middle) / half
    return share


def _stretches(acting: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], acting.astype(int), [0]])))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def least_time(way: Array, limits: Limits) -> float:
    """What drives without a load would need from rest to rest [s]; `way` (3,) of bridge, trolley, rope [m].

    No motion within the limits can take less: each axis goes its way under its set-points' limits alone.
    """
    times = []
    for i in range(len(AXES)):
        distance, speed, rate = abs(float(way[i])), float(limits.velocity[i]), float(limits.acceleration[i])
        ramp = distance < speed**2 / rate
        times.append(2.0 * sqrt(distance / rate) if ramp else distance / speed + speed / rate)
    return max(times)

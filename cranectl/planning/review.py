"""Review planned motions: proof, active limits over time, and lower bounds of the duration."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.planning.checks import least_times
from cranectl.planning.limits import Constraint, constraints, key_of, limits_of, motion
from cranectl.planning.motions import describe_planning, plan_motions
from cranectl.planning.problem import ToLoad, series_along
from cranectl.planning.proof import Proof, prove
from cranectl.planning.shortest import DEGREE_9_COEFFICIENTS, TIME_LAW_DEGREE
from cranectl.reference import Geometry, TimeLaw, Trajectory, spline
from cranectl.scenario import Arc, BlendedPath, Line, Scenario, Segment, Spline
from cranectl.support import Array, InconsistentError

ACTIVE_SHARE = 0.98  # of a limit, above which it counts as active
TIME_ROUNDING = 1e-3  # relative; a plan may exceed limits by the tolerance of its proof
REVIEW_SAMPLES = 501
_PROOFS: dict[str, Proof] = {}  # shared by log, report and screen


class SegmentCurve(NamedTuple):
    """A segment as a spline of coordinates."""

    breaks: Array
    coefficients: Array
    degree: int
    to_load: ToLoad | None


class ActiveLimit(NamedTuple):
    """A limit and the interval in which it is active [s], from the segment's start."""

    name: str
    start: float
    end: float


class Review(NamedTuple):
    """Review of one planned segment."""

    segment: int  # index in the reference
    description: str  # of the request, in words
    start: float  # in the run [s]
    duration: float  # [s]
    least: float  # duration that the drives would need without a load [s]
    active: tuple[ActiveLimit, ...]  # limits that the motion reaches
    proof: Proof  # that it keeps all of them
    time: Array  # (N,) [s] from the segment's start
    shares: dict[str, Array]  # of each limit, (N,)
    path: Array  # (N, 3) of the load [m]
    marked_points: Array  # (M, 3) blended corners or way points, without both ends [m]

    @property
    def tightest(self) -> tuple[str, float]:
        """The limit with the smallest proven slack, and the slack as a share of it."""
        return min(self.proof.slack.items(), key=lambda item: item[1])

    @property
    def active_by_limit(self) -> dict[str, list[ActiveLimit]]:
        """The active limits by name, in descending order of their total time."""
        by_name: dict[str, list[ActiveLimit]] = {}
        for active in self.active:
            by_name.setdefault(active.name, []).append(active)
        total = {name: sum(time.end - time.start for time in times) for name, times in by_name.items()}
        return {name: by_name[name] for name in sorted(by_name, key=lambda name: -total[name])}

    @property
    def summary(self) -> str:
        """The plan in one line."""
        name, slack = self.tightest
        active = ", ".join(
            f"{limit} for {sum(time.end - time.start for time in times):.2f} s"
            for limit, times in self.active_by_limit.items()
        )
        proven = f"proven on {self.proof.pieces} pieces, smallest slack {slack:.2g} of {name}"
        proven = proven if self.proof.is_valid else "NOT proven"
        return f"{self.description}, {self.duration:.3f} s; {proven}; at {active}"

    @staticmethod
    def of(scenario: Scenario) -> "list[Review]":
        """Review all planned segments of a scenario."""
        result, point, start_time = [], np.array(scenario.reference.start), 0.0
        for index, segment in enumerate(scenario.reference.segments):
            if request := describe_planning(segment):
                result.append(_review(scenario, index, request, segment, start=point, start_time=start_time))
            point, start_time = Trajectory.end_of(segment, point), start_time + segment.seconds
        return result

    @staticmethod
    def least_durations(plan: Scenario, requested: Scenario, directory: Path = Path()) -> tuple[float, ...]:
        """Estimate the least duration of each segment [s] with any knots, from the `plan` of `requested`.

        The duration T(n) of plans with n knot spans exceeds its limit by a term in 1/n, so the estimate is
        T(2n) - (T(n) - T(2n)), see docs/explanation/planning.md.
        """
        finer = requested.planning.model_copy(update={"refinement": 2 * requested.planning.refinement})
        plans = plan, plan_motions(requested.model_copy(update={"planning": finer}), directory)
        coarse, fine = ([segment.seconds for segment in plan.reference.segments] for plan in plans)
        if len(coarse) != len(fine):  # one of the plans has stops
            return (float("nan"),) * len(coarse)
        return tuple(2.0 * b - a for a, b in zip(coarse, fine, strict=True))


def claim_for(segment: Segment, start: Array, scenario: Scenario) -> str:
    """Return the summary of the review of a segment planned from `start` (3,) [m], else an empty text."""
    request = describe_planning(segment)
    return _review(scenario, 0, request, segment, start=start, start_time=0.0).summary if request else ""


def curve_of(segment: Segment, start: Array) -> SegmentCurve:
    """Return a segment with a motion, of a kind of the package, as a spline of coordinates."""
    if isinstance(segment, Spline) and segment.time_law is None:
        return SegmentCurve(np.array(segment.breaks), np.array(segment.coefficients), segment.degree, None)
    assert isinstance(segment, Line | Arc | BlendedPath | Spline)
    to_load = Geometry.of(segment, start)
    duration = segment.seconds
    if segment.planned_law is not None:
        coefficients = np.array(segment.planned_law)[:, None]
        spans = len(coefficients) - TimeLaw.DEGREE
        return SegmentCurve(np.linspace(0.0, duration, spans + 1), coefficients, TimeLaw.DEGREE, to_load)
    return SegmentCurve(np.array([0.0, duration]), DEGREE_9_COEFFICIENTS, TIME_LAW_DEGREE, to_load)


def _review(
    scenario: Scenario, index: int, request: str, segment: Segment, *, start: Array, start_time: float
) -> Review:
    limits, curve = limits_of(scenario), curve_of(segment, start)
    duration = segment.seconds
    time = np.linspace(0.0, duration, REVIEW_SAMPLES)
    series = series_along(*curve[:3], time)
    load = curve.to_load(series) if curve.to_load else series
    path = np.stack([axis[0] for axis in load], axis=1)
    shares = {
        constraint.name: _share(constraint)
        for constraint in constraints(motion(load, limits.gravity), limits)
    }
    active = [
        ActiveLimit(name, float(time[a]), float(time[b]))
        for name, share in shares.items()
        for a, b in _intervals(share >= ACTIVE_SHARE)
    ]
    least = float(max(least_times(path[0], path[-1], limits)))
    check_duration(least, duration, request)
    key = key_of(segment, start, scenario)
    if key not in _PROOFS:
        _PROOFS[key] = prove(*curve[:3], limits, curve.to_load)
    return Review(
        segment=index,
        description=request,
        start=start_time,
        duration=duration,
        least=least,
        active=tuple(sorted(active, key=lambda limit: limit.start)),
        proof=_PROOFS[key],
        time=time,
        shares=shares,
        path=path,
        marked_points=_marked_points(segment, start),
    )


def check_duration(least: float, duration: float, request: str) -> None:
    """Raise InconsistentError for a motion that is faster than the drives alone."""
    bound = ("the least time of the drives without a load", least)
    InconsistentError.check_ascending(
        bound, (f"the planned duration of {request}", duration), rounding=TIME_ROUNDING
    )


def _marked_points(segment: Segment, start: Array) -> Array:
    if isinstance(segment, BlendedPath):
        return np.array([part.start for part in Geometry.parts_of(segment.parts, start)[1:]])
    if isinstance(segment, Spline) and segment.time_law is not None:
        breaks = np.array(segment.breaks)
        points: Array = spline(breaks, np.array(segment.coefficients), segment.degree)(breaks[1:-1])
        return points
    return np.zeros((0, 3))


def _share(constraint: Constraint) -> Array:
    """Return the used share of a limit; of a range it is one at both ends and zero in the middle."""
    one_sided = not np.isfinite(constraint.low)
    middle, half = 0.5 * (constraint.low + constraint.high), 0.5 * (constraint.high - constraint.low)
    share: Array = (
        constraint.series[0] / constraint.high if one_sided else np.abs(constraint.series[0] - middle) / half
    )
    return share


def _intervals(active: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], active.astype(int), [0]])))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]

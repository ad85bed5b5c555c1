"""What a planned motion is worth: its proof, the limits that act and when, what no crane could be under."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.planning import planned
from cranectl.planning.checks import least_times
from cranectl.planning.limits import Constraint, constraints, key_of, limits_of, motion
from cranectl.planning.problem import ToLoad, series_along
from cranectl.planning.proof import Proof, prove
from cranectl.planning.shortest import COEFFICIENTS, GUESS_DEGREE
from cranectl.reference.geometry import geometry_of, parts_of
from cranectl.reference.time_laws import PLANNED_DEGREE, spline
from cranectl.reference.trajectory import end_point
from cranectl.scenario import Scenario, Segment
from cranectl.scenario.along_path import Arc, BlendedPath, Line, Plannable, SplineLaw
from cranectl.scenario.segments import Spline, seconds
from cranectl.support.arrays import Array
from cranectl.support.consistency import check_ascending

ACTS = 0.98  # of a limit, from which on it counts as acting
TIME_ROUNDING = 1e-3  # relative; a plan may exceed a limit by the tolerance of its proof
REVIEW_SAMPLES = 501
_PROOFS: dict[str, Proof] = {}  # each once in a process: log, report and screen ask for the same


class SegmentCurve(NamedTuple):
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
    marked: Array  # (M, 3) corners that are blended, or points that are passed, but for the ends [m]

    @property
    def tightest(self) -> tuple[str, float]:
        """Return the limit with the smallest slack that is proven, and the slack in parts of it."""
        return min(self.proof.slack.items(), key=lambda item: item[1])

    @property
    def by_limit(self) -> dict[str, list[Acting]]:
        """Return the limits that act, those that do so longest first."""
        by_name: dict[str, list[Acting]] = {}
        for acting in self.acting:
            by_name.setdefault(acting.name, []).append(acting)
        lasting = {name: sum(time.end - time.start for time in times) for name, times in by_name.items()}
        return {name: by_name[name] for name in sorted(by_name, key=lambda name: -lasting[name])}

    @property
    def in_short(self) -> str:
        """Return a line about the plan."""
        name, slack = self.tightest
        at = ", ".join(
            f"{limit} for {sum(stretch.end - stretch.start for stretch in times):.2f} s"
            for limit, times in self.by_limit.items()
        )
        proven = f"proven on {self.proof.pieces} pieces, smallest slack {slack:.2g} of {name}"
        proven = proven if self.proof.is_valid else "NOT proven"
        return f"{self.planned}, {self.duration:.3f} s; {proven}; at {at}"


def reviews(scenario: Scenario) -> list[Review]:
    """Review all segments of a scenario that were planned, and none of others."""
    result, here, begins = [], np.array(scenario.reference.start), 0.0
    for index, segment in enumerate(scenario.reference.segments):
        if request := in_words(segment):
            result.append(_review(scenario, index, request, segment, start=here, begins=begins))
        here, begins = end_point(segment, here), begins + seconds(segment)
    return result


def with_claims(scenario: Scenario) -> Scenario:
    """Return the scenario whose planned segments carry the reviews of today, in short."""
    segments = list(scenario.reference.segments)
    for review in reviews(scenario):
        segment = segments[review.segment]
        assert isinstance(segment, Plannable)
        segments[review.segment] = segment.claiming(review.in_short)
    reference = scenario.reference.model_copy(update={"segments": tuple(segments)})
    return scenario.model_copy(update={"reference": reference})


def claim_of(segment: Segment, start: Array, scenario: Scenario) -> str:
    """Return the review, in short, of a segment that was planned from `start` (3,) [m]; else nothing."""
    request = in_words(segment)
    return _review(scenario, 0, request, segment, start=start, begins=0.0).in_short if request else ""


def least_durations(plan: Scenario, requested: Scenario, directory: Path = Path()) -> tuple[float, ...]:
    """Estimate the least duration of each segment [s] with any knots, from the `plan` of `requested`.

    With T(n) of n knot spans it is T(2n) - (T(n) - T(2n)). What knots cost falls as 1/n, so this is near the
    shortest motion of all, whose drives' accelerations jump: measured 0.3 % above it, 1.5 % over an obstacle
    (docs/explanation/planning.md). An estimate, since each plan is the best near its guess. Raises InputError
    for what cannot be planned.
    """
    finer = requested.planning.model_copy(update={"refinement": 2 * requested.planning.refinement})
    plans = plan, planned(requested.model_copy(update={"planning": finer}), directory)
    coarse, fine = ([seconds(segment) for segment in plan.reference.segments] for plan in plans)
    if len(coarse) != len(fine):  # one of them stops on its way
        return (float("nan"),) * len(coarse)
    return tuple(2.0 * b - a for a, b in zip(coarse, fine, strict=True))


def in_words(segment: Segment) -> str:
    """Say how a segment was planned; nothing if it was not."""
    if isinstance(segment, Spline) and segment.made_from.get("kind") == "move":
        return "a move in minimum time"
    if not isinstance(getattr(segment, "time_law", None), SplineLaw):
        return ""
    if isinstance(segment, BlendedPath):
        return "a path with blended corners in minimum time"
    passed = isinstance(segment, Spline) and segment.made_from
    return f"{'way points' if passed else f'a given {segment.kind}'} in minimum time"


def curve_of(segment: Segment, start: Array) -> SegmentCurve:
    """Return a moving segment of the package's own kinds as a spline of coordinates."""
    if isinstance(segment, Spline) and segment.time_law is None:
        return SegmentCurve(np.array(segment.breaks), np.array(segment.coefficients), segment.degree, None)
    assert isinstance(segment, Line | Arc | BlendedPath | Spline)
    to_load = geometry_of(segment, start)
    duration = seconds(segment)
    if isinstance(segment.time_law, SplineLaw):
        coefficients = np.array(segment.time_law.coefficients)[:, None]
        spans = len(coefficients) - PLANNED_DEGREE
        return SegmentCurve(np.linspace(0.0, duration, spans + 1), coefficients, PLANNED_DEGREE, to_load)
    return SegmentCurve(np.array([0.0, duration]), COEFFICIENTS, GUESS_DEGREE, to_load)


def _review(
    scenario: Scenario, index: int, request: str, segment: Segment, *, start: Array, begins: float
) -> Review:
    limits, curve = limits_of(scenario), curve_of(segment, start)
    duration = seconds(segment)
    time = np.linspace(0.0, duration, REVIEW_SAMPLES)
    series = series_along(*curve[:3], time)
    load = curve.to_load(series) if curve.to_load else series
    path = np.stack([axis[0] for axis in load], axis=1)
    shares = {
        constraint.name: _share(constraint)
        for constraint in constraints(motion(load, limits.gravity), limits)
    }
    acting = [
        Acting(name, float(time[a]), float(time[b]))
        for name, share in shares.items()
        for a, b in _stretches(share >= ACTS)
    ]
    least = float(max(least_times(path[0], path[-1], limits)))
    check_duration(least, duration, request)
    key = key_of(segment, start, scenario)
    if key not in _PROOFS:
        _PROOFS[key] = prove(*curve[:3], limits, curve.to_load)
    return Review(
        segment=index,
        planned=request,
        start=begins,
        duration=duration,
        least=least,
        acting=tuple(sorted(acting, key=lambda stretch: stretch.start)),
        proof=_PROOFS[key],
        time=time,
        shares=shares,
        path=path,
        marked=_asked(segment, start),
    )


def check_duration(least: float, duration: float, request: str) -> None:
    """Raise InconsistentError for a motion that is quicker than the drives can be without a load."""
    bound = ("the least time of the drives without a load", least)
    check_ascending(bound, (f"the planned duration of {request}", duration), rounding=TIME_ROUNDING)


def _asked(segment: Segment, start: Array) -> Array:
    if isinstance(segment, BlendedPath):
        return np.array([part.start for part in parts_of(segment.parts, start)[1:]])
    if isinstance(segment, Spline) and segment.time_law is not None:
        breaks = np.array(segment.breaks)
        points: Array = spline(breaks, np.array(segment.coefficients), segment.degree)(breaks[1:-1])
        return points
    return np.zeros((0, 3))


def _share(constraint: Constraint) -> Array:
    """Return the share of a range, one at either end and none in its middle, or of a one-sided limit."""
    one_sided = not np.isfinite(constraint.low)
    middle, half = 0.5 * (constraint.low + constraint.high), 0.5 * (constraint.high - constraint.low)
    share: Array = (
        constraint.series[0] / constraint.high if one_sided else np.abs(constraint.series[0] - middle) / half
    )
    return share


def _stretches(acting: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], acting.astype(int), [0]])))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]

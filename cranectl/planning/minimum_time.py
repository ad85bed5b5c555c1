"""Find motions in minimum time: solve at samples, prove the limits in between, add samples where that fails.

A search along a path begins with the fastest motion by the time law of degree 9. The caller keeps that motion
if the search finds nothing faster.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cranectl.planning.edges import Edge, move_within
from cranectl.planning.limits import Limits, excesses, motion
from cranectl.planning.problem import (
    PASSAGE_SAMPLES,
    SAMPLES_PER_SPAN,
    Problem,
    Task,
    ToLoad,
    series_along,
)
from cranectl.planning.programs import PENALTIES, ProgramBudget, solve
from cranectl.planning.proof import PROOF_MARGIN, Proof, prove
from cranectl.planning.route import GUESS_POINTS
from cranectl.planning.shortest import NEAR_REST_DURATION, bisect_duration
from cranectl.reference import Geometry, Series, TimeLaw
from cranectl.support import Array

SPANS, SPANS_ALONG = 24, 40  # of free motions, of motions along a path
BLEND_SAMPLES_PER_SPAN = 16  # at first, for paths with blends, where limits vary more within a span
CHECK_SAMPLES_PER_SPAN = 40  # at which a solution is checked before its proof
LIMIT_TIGHTENING = 0.004  # share of limits that is kept for excesses between samples
SMOOTHING_WEIGHTS = (1.0, 10.0, 100.0)  # of fifth differences of a guess's coefficients; the best is taken
VIA_POINT_WEIGHT = 1e3  # of a guess's distances from via points
ALLOWED_EXCESS = 0.02  # of a guess over its excess at rest, as a share of the limit
RETRY_SLOWDOWN = 1.5  # of the second guess, which begins with the largest penalty
ADDED_OFFSETS = np.array([-1.0, 0.0, 1.0])  # of samples added at a violation, in steps of checked samples
MAX_REFINEMENTS = 10  # of the samples
MAX_PASSAGE_SAMPLES = 8 * PASSAGE_SAMPLES


@dataclass(frozen=True)
class FreeCoordinates:
    """Coordinates of a free motion: distances [m] from `start` along `directions` (d, 3), unit vectors."""

    start: Array
    end: Array
    directions: Array

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the series of x, y, z from the series of the coordinates."""
        load = []
        for origin, factors in zip(self.start.tolist(), self.directions.T.tolist(), strict=True):
            series = coordinates[0] * factors[0]
            for coordinate, factor in zip(coordinates[1:], factors[1:], strict=True):
                if factor:
                    series = series + coordinate * factor
            load.append(series + origin)
        return load

    def points(self, coordinates: Array) -> Array:
        """Return the points (N, 3) [m] of coordinates (N, d). Those equal to the last are exactly `end`."""
        points = self.start + coordinates @ self.directions
        points[(coordinates == coordinates[-1]).all(axis=1)] = self.end
        return points


class FastestMotion(NamedTuple):
    """A proven motion of least time, as a spline of the path coordinate, or of a free load's position."""

    duration: float  # [s]
    coefficients: Array  # (spans + degree, d); of a free motion in space, d = 3
    proof: Proof


def along_path(geometry: Geometry, limits: Limits, duration: float) -> Task:
    """Return the task of a motion along a path, whose motion by the law of degree 9 lasts `duration` [s]."""
    guess = TimeLaw().sample(np.linspace(0.0, 1.0, GUESS_POINTS))[0][:, None]
    ends = np.zeros(1), np.ones(1)
    return Task(*ends, geometry, limits, guess, duration, SPANS_ALONG, is_monotone=True)


def along_parts(geometry: Geometry, limits: Limits, stopping: Sequence[tuple[TimeLaw, float, float]]) -> Task:
    """Return the task along blended parts, from law, duration [s] and length [m] of each part with stops."""
    durations, lengths = (np.array([part[k] for part in stopping]) for k in (1, 2))
    begins = np.cumsum(durations) - durations
    time = np.linspace(0.0, durations.sum(), GUESS_POINTS)
    guess = sum(
        length / lengths.sum() * stop_law.sample(np.clip((time - begin) / duration, 0.0, 1.0), 1)[0]
        for (stop_law, duration, length), begin in zip(stopping, begins, strict=True)
    )
    ends = np.zeros(1), np.ones(1)
    return Task(
        *ends,
        geometry,
        limits,
        guess[:, None],
        float(durations.sum()),
        SPANS_ALONG,
        is_monotone=True,
        samples_per_span=BLEND_SAMPLES_PER_SPAN,
    )


def minimum_time(task: Task) -> FastestMotion | None:
    """Find and prove the motion of least time, or return None if no guess leads to one.

    Work and memory are bounded: by a budget of programs, and by the samples that a refinement may add.
    """
    budget = ProgramBudget()
    return _minimum_time(task, budget=budget) or _minimum_time(
        task, RETRY_SLOWDOWN, PENALTIES[-1], budget=budget
    )


def _minimum_time(
    task: Task, slowdown: float = 1.0, penalty: float = PENALTIES[0], budget: ProgramBudget | None = None
) -> FastestMotion | None:
    budget = budget or ProgramBudget()
    fractions = np.linspace(0.0, 1.0, task.spans * task.samples_per_span + 1)
    tightened, passage_samples = tighten_limits(task), PASSAGE_SAMPLES
    problem = Problem(tightened, fractions)
    first_duration, coefficients = _choose_guess(problem)
    x = problem.unknowns(coefficients, slowdown * first_duration)
    size = 0.3 * float(np.abs(task.guess - task.start).max())
    sizes = np.concatenate(
        [np.full(problem.width, size), [0.5 * first_duration], np.full(len(task.instants), 0.3)]
    )
    obstacles = {box.key for box in task.limits.obstacles}
    for _ in range(MAX_REFINEMENTS):
        x, solved, penalty = solve(problem, x, sizes, budget, penalty)
        if not solved:
            return None
        duration, coefficients = problem.duration(x), move_within(tightened.edges, problem.coefficients(x))
        excess_by_limit = _excesses(task, duration, coefficients, CHECK_SAMPLES_PER_SPAN)
        violated = {name for name, excess in excess_by_limit.items() if (excess > PROOF_MARGIN).any()}
        worst = np.max(list(excess_by_limit.values()), axis=0)
        violated_at = np.linspace(0.0, 1.0, task.spans * CHECK_SAMPLES_PER_SPAN + 1)[worst > PROOF_MARGIN]
        if not violated:
            to_load: ToLoad | None = task.to_load
            if isinstance(task.to_load, FreeCoordinates):  # prove the very spline that is returned
                coefficients, to_load = task.to_load.points(coefficients), None
            breaks = np.linspace(0.0, duration, task.spans + 1)
            proof = prove(breaks, coefficients, TimeLaw.DEGREE, task.limits, to_load)
            if proof.is_valid:
                return FastestMotion(duration, coefficients, proof)
            if not any(violation.certain for violation in proof.violations):
                return None  # undecided by rounding, which more samples do not change
            violated = {violation.name for violation in proof.violations}
            violated_at = np.array(
                [0.5 * (violation.start + violation.end) / duration for violation in proof.violations]
            )
        violated_at = _thin(np.unique(violated_at), task.spans * task.samples_per_span)
        added = (violated_at[:, None] + ADDED_OFFSETS / (task.spans * CHECK_SAMPLES_PER_SPAN)).ravel()
        fractions = np.unique(np.clip(np.concatenate([fractions, added]), 0.0, 1.0))
        passage_samples = min(passage_samples * (1 + bool(violated & obstacles)), MAX_PASSAGE_SAMPLES)
        problem = Problem(tightened, fractions, passage_samples)
    return None


def _thin(places: Array, most: int) -> Array:
    """Return at most `most` of the places (N,), evenly over them."""
    return places if len(places) <= most else places[np.linspace(0, len(places) - 1, most).astype(int)]


def _excesses(task: Task, duration: float, coefficients: Array, samples_per_span: int) -> dict[str, Array]:
    """Return the excess over each limit, as a share of it, at `samples_per_span`."""
    breaks = np.linspace(0.0, duration, task.spans + 1)
    time = np.linspace(0.0, duration, task.spans * samples_per_span + 1)
    coordinates = series_along(breaks, coefficients, TimeLaw.DEGREE, time)
    return excesses(motion(task.to_load(coordinates), task.limits.gravity), task.limits)


def tighten_limits(task: Task) -> Task:
    """Tighten the limits for excesses between samples; start, end and via points stay within ranges.

    A free motion that touches the edge of the load's range there has no room for such an excess. It keeps
    its coefficients within the range.
    """
    limits = _scale_limits(task.limits, LIMIT_TIGHTENING)
    rests = np.array(
        [
            [float(series[0][0]) for series in task.to_load([Series([np.array([value])]) for value in point])]
            for point in (task.start, task.end, *task.via)
        ]
    )
    at_rest = rests * [1.0, 1.0, -1.0]  # bridge, trolley, rope
    load = _widen_to(limits.load, rests)
    edges: list[Edge] = []
    if isinstance(task.to_load, FreeCoordinates):
        for axis, side in np.argwhere(load != limits.load):
            normal = task.to_load.directions[:, axis] * (1.0, -1.0)[side]
            offset = (load[axis, side] - task.to_load.start[axis]) * (1.0, -1.0)[side]
            edges += [Edge(normal, float(offset))] if normal.any() else []
    return replace(
        task, edges=tuple(edges), limits=limits._replace(load=load, axes=_widen_to(limits.axes, at_rest))
    )


def _widen_to(ranges: Array, points: Array) -> Array:
    return np.stack(
        [np.minimum(ranges[:, 0], points.min(axis=0)), np.maximum(ranges[:, 1], points.max(axis=0))], axis=1
    )


def _scale_limits(limits: Limits, share: float) -> Limits:
    """Tighten each limit by `share` of itself, and ranges and obstacles by a gap at each side."""
    low, high = limits.tension
    weight = float(limits.masses[3]) * limits.gravity
    keep, gap = 1.0 - share, 0.5 * share * limits.size  # of a range at most a tenth of its width
    return limits._replace(
        velocity=keep * limits.velocity,
        acceleration=keep * limits.acceleration,
        force=keep * limits.force,
        jerk=keep * limits.jerk,
        lean=keep * limits.lean,
        # Towards the weight: a share of the tension itself would forbid rest near a bound.
        tension=(low + share * (weight - low), high - share * (high - weight)),
        load=_narrow(limits.load, gap),
        axes=_narrow(limits.axes, gap),
        obstacles=tuple(box._replace(low=box.low - gap, high=box.high + gap) for box in limits.obstacles),
    )


def _narrow(ranges: Array, gap: float) -> Array:
    gaps = np.minimum(gap, 0.1 * np.ptp(ranges, axis=1))
    return np.stack([ranges[:, 0] + gaps, ranges[:, 1] - gaps], axis=1)


def _choose_guess(problem: Problem) -> tuple[float, Array]:
    """Return duration [s] and coefficients of the fastest of three smooth splines near the task's guess."""
    guesses = [fit_guess(problem, smoothing) for smoothing in SMOOTHING_WEIGHTS]
    pairs = ((_find_shortest_duration(problem.task, guess), guess) for guess in guesses)
    return min(pairs, key=lambda pair: pair[0])


def fit_guess(problem: Problem, smoothing: float) -> Array:
    """Return the coefficients of a smooth spline near the guess that nearly passes through the via points."""
    task = problem.task
    basis = problem.curves[0](np.linspace(0.0, 1.0, len(task.guess)))
    coefficients = problem.coefficients(np.zeros(problem.width + 1))
    coefficients[problem.free] = 0.0
    roughness = smoothing * np.diff(np.eye(len(coefficients)), n=5, axis=0)
    at_via = VIA_POINT_WEIGHT * problem.curves[0](np.array(task.instants[: len(task.via)]))
    matrix = np.vstack([basis, roughness, at_via])
    zeros = np.zeros((len(roughness), coefficients.shape[1]))
    target = np.vstack([task.guess, zeros, *(VIA_POINT_WEIGHT * point for point in task.via)])
    target -= matrix @ coefficients
    coefficients[problem.free] = np.linalg.lstsq(matrix[:, problem.free], target, rcond=None)[0]
    return coefficients


def _find_shortest_duration(task: Task, coefficients: Array) -> float:
    """Find the shortest duration [s] with at most ALLOWED_EXCESS more excess than a very slow motion."""

    def excess(duration: float) -> float:
        excess_by_limit = _excesses(task, duration, coefficients, SAMPLES_PER_SPAN)
        return float(np.max(list(excess_by_limit.values())))

    allowed = max(excess(NEAR_REST_DURATION), 0.0) + ALLOWED_EXCESS
    return bisect_duration(
        lambda duration: excess(duration) <= allowed, 0.1 * task.duration, 10.0 * task.duration, 0.02
    )

"""Motions in minimum time: solved at samples, proven in between, sampled more finely where the proof fails.

A search along a path begins with the fastest motion whose time law is a polynomial of degree 9. The caller
keeps that motion where the search finds nothing faster.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cranectl.planning.limits import Limits, excesses, motion
from cranectl.planning.problem import DENSITY, PASSAGE_SAMPLES, Problem, Task, ToLoad, series_along
from cranectl.planning.programs import PENALTIES, Solution, solve
from cranectl.planning.proof import PROOF_MARGIN, Proof, prove
from cranectl.planning.route import GUESS
from cranectl.planning.shortest import SLOWLY, bisected
from cranectl.reference.geometry import Geometry
from cranectl.reference.series import Series, plus, shifted
from cranectl.reference.time_laws import PLANNED_DEGREE, Law, time_law
from cranectl.support.arrays import Array

SPANS, SPANS_ALONG = 24, 40  # of free motions, of motions along a given path
DENSITY_IN_BLENDS = 16  # samples a span at first, for paths with blends: in those much happens in a span
CHECK_DENSITY = 40  # samples a span at which a solution is checked before it is proven
LIMIT_TIGHTENING = 0.004  # part of limits that the solver may not use: what lies between samples
SMOOTHING_WEIGHTS = (1.0, 10.0, 100.0)  # of fifth differences of a guess's coefficients; one is taken
VIA_POINT_WEIGHT = 1e3  # weight of its distances from via points
ALLOWED_EXCESS = 0.02  # of a guess over its excess at rest, as a share of the limit
RETRY_SLOWDOWN = 1.5  # of the second guess, whose excesses cost much from the beginning
ADDED_OFFSETS = np.array([-1.0, 0.0, 1.0])  # samples added at a violation, in distances of checked samples
MAX_REFINEMENTS = 10  # of sampling more finely

Solver = Callable[[Problem, Array, Array, float], Solution]


@dataclass(frozen=True)
class FreeCoordinates:
    """Coordinates of a free motion: distances [m] from `start` along `directions` (d, 3), unit vectors."""

    start: Array
    end: Array
    directions: Array

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the load's motion from that of the coordinates."""
        load = []
        for origin, factors in zip(self.start.tolist(), self.directions.T.tolist(), strict=True):
            series = [c * factors[0] for c in coordinates[0]]
            for coordinate, factor in zip(coordinates[1:], factors[1:], strict=True):
                if factor:
                    series = plus(series, [c * factor for c in coordinate])
            load.append(shifted(series, origin))
        return load

    def points(self, coordinates: Array) -> Array:
        """Return the points (N, 3) [m] of coordinates (N, d). Those equal to the last are exactly `end`."""
        places = self.start + coordinates @ self.directions
        places[(coordinates == coordinates[-1]).all(axis=1)] = self.end
        return places


class FastestMotion(NamedTuple):
    """A proven motion of least time, as a spline of the path coordinate, or of a free load's position."""

    duration: float  # [s]
    coefficients: Array  # (spans + degree, d); of a free motion in space, d = 3
    proof: Proof


def along_path(geometry: Geometry, limits: Limits, duration: float) -> Task:
    """Return the task of a motion along a given path. `duration` [s] is that of the degree-9 motion."""
    guess = time_law("degree-9", np.linspace(0.0, 1.0, GUESS))[0][:, None]
    ends = np.zeros(1), np.ones(1)
    return Task(*ends, geometry, limits, guess, duration, SPANS_ALONG, forwards=True)


def along_parts(geometry: Geometry, limits: Limits, stopping: Sequence[tuple[Law, float, float]]) -> Task:
    """Return the task of a motion along parts that are joined by blends.

    `stopping` has the time law, duration [s] and length [m] of each part when it starts and ends at rest.
    """
    durations, lengths = (np.array([part[k] for part in stopping]) for k in (1, 2))
    begins = np.cumsum(durations) - durations
    at = np.linspace(0.0, durations.sum(), GUESS)
    guess = sum(
        length / lengths.sum() * time_law(stop_law, np.clip((at - begin) / duration, 0.0, 1.0), 1)[0]
        for (stop_law, duration, length), begin in zip(stopping, begins, strict=True)
    )
    ends = np.zeros(1), np.ones(1)
    guessed = guess[:, None], float(durations.sum())
    return Task(*ends, geometry, limits, *guessed, SPANS_ALONG, forwards=True, density=DENSITY_IN_BLENDS)


def minimum_time(task: Task, solver: Solver = solve) -> FastestMotion | None:
    """Find and prove the motion of least time; return None if no guess leads to one."""
    return _minimum_time(task, solver) or _minimum_time(task, solver, RETRY_SLOWDOWN, PENALTIES[-1])


def _minimum_time(
    task: Task, solver: Solver, slowdown: float = 1.0, penalty: float = PENALTIES[0]
) -> FastestMotion | None:
    fractions = np.linspace(0.0, 1.0, task.spans * task.density + 1)
    tightened, passage_samples = _inside(task), PASSAGE_SAMPLES
    problem = Problem(tightened, fractions)
    first_duration, coefficients = _guess(problem)
    x = problem.unknowns(coefficients, slowdown * first_duration)
    size = 0.3 * float(np.abs(task.guess - task.start).max())
    sizes = np.concatenate(
        [np.full(problem.width, size), [0.5 * first_duration], np.full(len(task.instants), 0.3)]
    )
    obstacles = {box.key for box in task.limits.obstacles}
    for _ in range(MAX_REFINEMENTS):
        x, solved, penalty = solver(problem, x, sizes, penalty)
        if not solved:
            return None
        duration, coefficients = problem.duration(x), problem.coefficients(x)
        over = _excesses(task, duration, coefficients, CHECK_DENSITY)
        violated = {name for name, excess in over.items() if (excess > PROOF_MARGIN).any()}
        worst = np.max(list(over.values()), axis=0)
        places = np.linspace(0.0, 1.0, task.spans * CHECK_DENSITY + 1)[worst > PROOF_MARGIN]
        if not violated:
            to_load: ToLoad | None = task.to_load
            if isinstance(task.to_load, FreeCoordinates):  # what is proven is what is given
                coefficients, to_load = task.to_load.points(coefficients), None
            breaks = np.linspace(0.0, duration, task.spans + 1)
            proof = prove(breaks, coefficients, PLANNED_DEGREE, task.limits, to_load)
            if proof.is_valid:
                return FastestMotion(duration, coefficients, proof)
            violated = {violation.name for violation in proof.violations}
            places = np.array(
                [0.5 * (violation.start + violation.end) / duration for violation in proof.violations]
            )
        added = (places[:, None] + ADDED_OFFSETS / (task.spans * CHECK_DENSITY)).ravel()
        fractions = np.unique(np.clip(np.concatenate([fractions, added]), 0.0, 1.0))
        passage_samples *= 1 + bool(violated & obstacles)
        problem = Problem(tightened, fractions, passage_samples)
    return None


def _excesses(task: Task, duration: float, coefficients: Array, density: int) -> dict[str, Array]:
    """Return the excess over each limit, as a share of it, at `density` samples a span."""
    breaks = np.linspace(0.0, duration, task.spans + 1)
    time = np.linspace(0.0, duration, task.spans * density + 1)
    coordinates = series_along(breaks, coefficients, PLANNED_DEGREE, time)
    return excesses(motion(task.to_load(coordinates), task.limits.gravity), task.limits)


def _inside(task: Task) -> Task:
    """Tighten the limits for what happens between samples; start, end and via points stay within ranges."""
    limits = _tightened(task.limits, LIMIT_TIGHTENING)
    rests = np.array(
        [
            [float(series[0][0]) for series in task.to_load([[np.array([value])] for value in point])]
            for point in (task.start, task.end, *task.via)
        ]
    )
    at_rest = rests * [1.0, 1.0, -1.0]  # bridge, trolley, rope
    return replace(
        task,
        limits=limits._replace(load=_holding(limits.load, rests), axes=_holding(limits.axes, at_rest)),
    )


def _holding(ranges: Array, points: Array) -> Array:
    return np.stack(
        [np.minimum(ranges[:, 0], points.min(axis=0)), np.maximum(ranges[:, 1], points.max(axis=0))], axis=1
    )


def _tightened(limits: Limits, part: float) -> Limits:
    """Tighten each limit by `part` of itself, and ranges and obstacles by a length.

    The length is half of `part` times `limits.size` at each side, at most a tenth of a range's own width.
    """
    low, high = limits.tension
    weight = float(limits.masses[3]) * limits.gravity
    keep, gap = 1.0 - part, 0.5 * part * limits.size
    return limits._replace(
        velocity=keep * limits.velocity,
        acceleration=keep * limits.acceleration,
        force=keep * limits.force,
        jerk=keep * limits.jerk,
        lean=keep * limits.lean,
        tension=(low + part * (weight - low), high - part * (high - weight)),
        load=_narrowed(limits.load, gap),
        axes=_narrowed(limits.axes, gap),
        obstacles=tuple(box._replace(low=box.low - gap, high=box.high + gap) for box in limits.obstacles),
    )


def _narrowed(ranges: Array, gap: float) -> Array:
    gaps = np.minimum(gap, 0.1 * np.ptp(ranges, axis=1))
    return np.stack([ranges[:, 0] + gaps, ranges[:, 1] - gaps], axis=1)


def _guess(problem: Problem) -> tuple[float, Array]:
    """Return duration [s] and coefficients of the fastest of three smooth splines near the task's guess."""
    fitted = [_fitted(problem, smoothing) for smoothing in SMOOTHING_WEIGHTS]
    return min(((_quickest(problem.task, guess), guess) for guess in fitted), key=lambda pair: pair[0])


def _fitted(problem: Problem, smoothing: float) -> Array:
    """Return the coefficients of a smooth spline near the guess that nearly passes through the via points."""
    task = problem.task
    basis = problem.curves[0](np.linspace(0.0, 1.0, len(task.guess)))
    tied = problem.coefficients(np.zeros(problem.width + 1))
    tied[problem.free] = 0.0
    rough = smoothing * np.diff(np.eye(len(tied)), n=5, axis=0)
    passed = VIA_POINT_WEIGHT * problem.curves[0](np.array(task.instants[: len(task.via)]))
    rows = np.vstack([basis, rough, passed])
    still = np.zeros((len(rough), tied.shape[1]))
    wanted = np.vstack([task.guess, still, *(VIA_POINT_WEIGHT * point for point in task.via)]) - rows @ tied
    tied[problem.free] = np.linalg.lstsq(rows[:, problem.free], wanted, rcond=None)[0]
    return tied


def _quickest(task: Task, coefficients: Array) -> float:
    """Find the shortest duration [s] that exceeds limits by at most 2 % more than a very slow motion does."""

    def excess(duration: float) -> float:
        over = _excesses(task, duration, coefficients, DENSITY)
        return float(np.max(list(over.values())))

    allowed = max(excess(SLOWLY), 0.0) + ALLOWED_EXCESS
    return bisected(
        lambda duration: excess(duration) <= allowed, 0.1 * task.duration, 10.0 * task.duration, 0.02
    )

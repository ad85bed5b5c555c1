"""Motions in minimum time: solved at samples, proven in between, sampled more finely where the proof fails.

The search begins with the shortest motion by the law of degree 9, which is kept where nothing is faster.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cranectl.reference.planning.geometry import Geometry, Placed, along
from cranectl.reference.planning.limits import Box, Limits
from cranectl.reference.planning.problem import TIED, Leg, Problem, ToLoad
from cranectl.reference.planning.programs import PRICES, Solution, solve
from cranectl.reference.planning.proof import Proof, prove
from cranectl.reference.time_laws import PLANNED_DEGREE, time_law
from cranectl.support.arrays import Array

SPANS, SPANS_ALONG = 24, 40  # of free motions, of motions along a given path
DENSITY = 8  # samples a span at first
TIGHTER = 0.004  # by which limits are tightened for the solver: what lies between samples
ROUNDS = 6  # of sampling more finely

INWARDS = np.array([1.0, -1.0])

Solver = Callable[[Problem, Array, Array, float], Solution]


class Motion(NamedTuple):
    """A proven motion in coordinates q."""

    duration: float  # [s]
    coefficients: Array  # (spans + degree, d); of a free motion in space, d = 3
    proof: Proof
    steps: int  # of the solver, in all rounds
    rounds: int


@dataclass(frozen=True)
class Task:
    """From rest at `start` to rest at `end`, in coordinates (d,) that give the load's place."""

    start: Array
    end: Array
    to_load: ToLoad
    limits: Limits
    guess: Array  # (G, d) of the coordinates at equal parts of the duration
    duration: float  # of the guess [s]
    spans: int
    forwards: bool = False
    price: float = PRICES[0]  # of excesses to begin with: low, long steps are taken through what is forbidden
    via: tuple[Array, ...] = ()  # coordinates (d,) to be passed
    legs: tuple[Leg, ...] = ()
    instants: tuple[float, ...] = ()  # of the guess: when via points are passed, and sides change


def along_path(geometry: Geometry, limits: Limits, duration: float) -> Task:
    """Along a given path; `duration` is that of the law of degree 9."""
    guess = time_law("degree-9", np.linspace(0.0, 1.0, 401))[0][:, None]
    ends = np.zeros(1), np.ones(1)
    return Task(*ends, along(geometry), limits, guess, duration, SPANS_ALONG, forwards=True, price=PRICES[1])


def minimum_time(task: Task, solver: Solver = solve) -> Motion | None:
    """The least time that is found and proven; None if nothing is."""
    fractions = np.linspace(0.0, 1.0, task.spans * DENSITY + 1)
    limits = tightened(task.limits, TIGHTER)
    boxes = dict(zip((box.name for box in task.limits.obstacles), limits.obstacles, strict=True))
    legs = tuple(leg._replace(box=boxes[leg.box.name]) for leg in task.legs)
    inside = replace(task, limits=limits, legs=legs)
    problem = _problem(inside, fractions)
    x = problem.unknowns(_fitted(problem, task), task.duration, task.instants)
    size = 0.3 * float(np.abs(task.guess - task.start).max())
    sizes = np.concatenate(
        [np.full(problem.width, size), [0.5 * task.duration], np.full(len(task.instants), 0.3)]
    )
    steps, price = 0, task.price
    for round_ in range(1, ROUNDS + 1):
        solution = solver(problem, x, sizes, price)
        price = solution.price
        steps += solution.steps
        if not solution.solved:
            return None
        x = solution.x
        duration, coefficients = problem.duration(x), problem.coefficients(x)
        breaks = np.linspace(0.0, duration, task.spans + 1)
        if isinstance(task.to_load, Placed):  # what is proven is what is given
            coefficients = task.to_load.points(coefficients)
            proof = prove(breaks, coefficients, PLANNED_DEGREE, task.limits)
        else:
            proof = prove(breaks, coefficients, PLANNED_DEGREE, task.limits, task.to_load)
        if proof.holds:
            return Motion(duration, coefficients, proof, steps, round_)
        fractions = _finer(fractions, proof, duration, task.spans)
        problem = _problem(inside, fractions)
    return None


def tightened(limits: Limits, part: float) -> Limits:
    """By a part of each limit; ranges by that part of a twentieth of their width."""
    low, high = limits.tension
    weight = float(limits.masses[3]) * limits.gravity
    keep = 1.0 - part
    return limits._replace(
        velocity=keep * limits.velocity,
        acceleration=keep * limits.acceleration,
        force=keep * limits.force,
        jerk=keep * limits.jerk,
        lean=keep * limits.lean,
        tension=(low + part * (weight - low), high - part * (high - weight)),
        load=limits.load + 0.05 * part * np.ptp(limits.load, axis=1)[:, None] * INWARDS,
        axes=limits.axes + 0.05 * part * np.ptp(limits.axes, axis=1)[:, None] * INWARDS,
        obstacles=tuple(_grown(box, 0.05 * part * limits.size) for box in limits.obstacles),
    )


def _grown(box: Box, gap: float) -> Box:
    return Box(box.name, box.low - gap, box.high + gap)


def _problem(task: Task, samples: Array) -> Problem:
    return Problem(
        task.start,
        task.end,
        task.limits,
        task.to_load,
        spans=task.spans,
        samples=samples,
        via=task.via,
        legs=task.legs,
        forwards=task.forwards,
    )


def _fitted(problem: Problem, task: Task) -> Array:
    """Coefficients of the spline nearest to the guess."""
    basis = problem.basis(np.linspace(0.0, 1.0, len(task.guess)))[:, 0]
    tied = problem.coefficients(np.zeros(problem.width + 1))
    tied[problem.free] = 0.0
    inner = np.linalg.lstsq(basis[:, problem.free], task.guess - basis @ tied, rcond=None)[0]
    tied[TIED:-TIED] = inner
    return tied


def _finer(samples: Array, proof: Proof, duration: float, spans: int) -> Array:
    """Twice the samples in the spans where the proof failed."""
    parts = np.array([[broken.start, broken.end] for broken in proof.broken]) / duration * spans
    touched = {int(np.clip(span, 0, spans - 1)) for span in parts.mean(axis=1)}
    middles = 0.5 * (samples[1:] + samples[:-1])
    new = [middle for middle in middles if int(middle * spans) in touched]
    return np.sort(np.concatenate([samples, new]))

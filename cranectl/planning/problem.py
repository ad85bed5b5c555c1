"""A motion in minimum time as an optimisation problem: a spline, its duration, when it passes what.

Coordinates q, splines of degree 7 in time over uniform knots, give the load's motion: its own x, y, z for a
free motion, two of them in a plane, or how far along a path it is. Unknowns x: the free coefficients, one row
of coordinates after the other, then the duration T [s], then the instants, parts of it from 0 to 1, at which
points are passed and sides of obstacles change. Limits hold at samples; between them `proof` finds what they
miss.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cranectl.planning.arithmetic import inputs
from cranectl.planning.limits import Constraint, Limits, clear_of, constraints, motion
from cranectl.reference.series import Number, Series, from_derivatives
from cranectl.reference.time_laws import PLANNED_DEGREE, derivatives, spline
from cranectl.support.arrays import Array

ORDERS = 6  # position and five derivatives: the fifth is in the rate of the set-points
TIED = 5  # coefficients at each end that are equal: rest up to the fourth derivative
EFFORT = "set-point's rate"  # the constraints whose mean square is weighted
DENSITY = 8  # samples a span at first
PASSAGE_SAMPLES = 49  # of each passage beside an obstacle, at first
APART = 0.02  # least distance of instants, in durations
CURVATURE_STEP = 1e-5  # of a derivative's size, for second derivatives

ToLoad = Callable[[list[Series]], list[Series]]  # coordinates → load x, y, z


class Passage(NamedTuple):
    """A stretch of a motion on one side of an obstacle, from one instant to another.

    Instants count from 1; 0 is the motion's begin and -1 its end.
    """

    box: int  # which of the obstacles
    side: str
    begin: int
    end: int


@dataclass(frozen=True)
class Task:
    """A motion from rest at `start` to rest at `end`, in coordinates (d,) that give the load's place."""

    start: Array
    end: Array
    to_load: ToLoad
    limits: Limits
    guess: Array  # (G, d) of the coordinates at equal parts of the duration
    duration: float  # by the law of degree 9, with stops where it needs them [s]
    spans: int
    forwards: bool = False  # no coordinate may ever fall
    density: int = DENSITY
    via: tuple[Array, ...] = ()  # coordinates (d,) to be passed, at the first instants
    passages: tuple[Passage, ...] = ()
    instants: tuple[float, ...] = ()  # of the guess: when via points are passed, and sides change


class Linearisation(NamedTuple):
    """The problem near one x, with slopes by the unknowns."""

    excess: Array  # (R,) over each bound, in parts of its size: at most 0 where all limits hold
    slope: Array  # (R, unknowns)
    efforts: Array  # (E,) rates of the set-points, in parts of their limits
    effort_slope: Array  # (E, unknowns)


class Sampled(NamedTuple):
    """Points of the motion at which something must hold."""

    parts: Array  # (N,) of the duration, without those of the instants
    by_instant: Array  # (N, instants) what they add
    bounded: Callable[[list[Series]], list["Bounded"]]  # of the coordinates' series


class Bounded(NamedTuple):
    """A constraint and one of its bounds, by sign an upper (1) or lower (-1) one; an effort has none."""

    constraint: Constraint
    bound: float | None
    sign: float

    def excess(self) -> Number:
        """Return by how much the bound is exceeded, in parts of its size, (N,); of an effort, the effort."""
        value = self.constraint.series[0] - (self.bound or 0.0)
        return value * (self.sign / self.constraint.scale)


class Problem:
    """A task whose limits hold at samples."""

    def __init__(self, task: Task, samples: Array, beside: int = PASSAGE_SAMPLES) -> None:
        """Set up the problem at `samples` (N,), parts of the duration, and `beside` on each passage."""
        self.task = task
        spans, count = task.spans, len(task.instants)
        whole = spline(np.linspace(0.0, 1.0, spans + 1), np.eye(spans + PLANNED_DEGREE), PLANNED_DEGREE)
        self.curves = derivatives(whole, ORDERS)
        self.free = slice(TIED, spans + PLANNED_DEGREE - TIED)
        self.width = (spans + PLANNED_DEGREE - 2 * TIED) * len(task.start)  # free coefficients
        self.groups = [Sampled(samples, np.zeros((len(samples), count)), self._limited)]
        self.groups += [self._passing(index, point) for index, point in enumerate(task.via)]
        self.groups += [self._beside(passage, beside) for passage in task.passages]
        self._fixed = self.basis(samples)
        # Rows by the motion's begin, the instants, its end: how much later stretches begin than they end.
        passed = itertools.pairwise([0, *range(1, len(task.via) + 1), -1])
        stretches = [*passed, *((passage.begin, passage.end) for passage in task.passages)]
        instants = np.eye(count + 2)
        late = [instants[begin] - instants[end] for begin, end in stretches if (begin, end) != (0, -1)]
        self._late = np.array(late).reshape(-1, count + 2)

    def basis(self, parts: Array) -> Array:
        """Return derivatives by the part of the duration of the basis: (N, ORDERS, spans + degree)."""
        return np.stack([curve(parts) for curve in self.curves], axis=1)

    def coefficients(self, x: Array) -> Array:
        """Return all of them, (spans + degree, d)."""
        tied = [np.tile(end, (TIED, 1)) for end in (self.task.start, self.task.end)]
        return np.vstack([tied[0], x[: self.width].reshape(-1, len(self.task.start)), tied[1]])

    def duration(self, x: Array) -> float:
        """Return the duration [s]."""
        return float(x[self.width])

    def unknowns(self, coefficients: Array, duration: float) -> Array:
        """Return the x of a motion with the guess's instants; `coefficients`, `duration` give it back."""
        return np.array([*coefficients[self.free].ravel(), duration, *self.task.instants])

    def linearised(self, x: Array) -> Linearisation:
        """Return excesses and efforts at x, and their slopes."""
        limited, efforts = [], []
        for group in self.groups:
            jets, basis = self._jets(x, group)
            by_x = self._by_unknowns(x, group, jets, basis)
            limits, others = _parted(group.bounded(self.series_of(inputs(jets))))
            limited.append(_chained(limits, by_x))
            efforts.append(_chained(others, by_x))
        excess, slope = zip(*limited, self.in_order(x), strict=True)
        return Linearisation(np.concatenate(excess), np.vstack(slope), *efforts[0])

    def values(self, x: Array) -> tuple[Array, Array]:
        """Return excesses and efforts at x without their slopes: a tenth of the work."""
        excess, efforts = [], []
        for index, group in enumerate(self.groups):
            limits, others = _parted(group.bounded(self.series_of(list(self._jets(x, group)[0].T))))
            excess += [limit.excess() for limit in limits]
            efforts += [other.excess() for other in others if not index]
        return np.concatenate([*excess, self.in_order(x)[0]]), np.concatenate(efforts)

    def in_order(self, x: Array) -> tuple[Array, Array]:
        """Return excesses and slopes of the rule that stretches end after they begin."""
        slope = np.zeros((len(self._late), len(x)))
        slope[:, self.width + 1 :] = self._late[:, 1:-1]
        return APART + self._late @ [0.0, *x[self.width + 1 :], 1.0], slope

    def curvature(self, x: Array, multipliers: Array) -> Array:
        """Return the second derivative (unknowns, unknowns) of `multipliers` (R,) times the excesses."""
        hessian = np.zeros((len(x), len(x)))
        first = 0
        for group in self.groups:
            jets, _ = self._jets(x, group)
            count = len(group.parts)
            total = len(_parted(group.bounded(self.series_of(list(jets[:1].T))))[0]) * count
            by_sample = multipliers[first : first + total].reshape(-1, count)
            first += total
            chosen = np.flatnonzero(by_sample.max(axis=0) > 0.0)
            if len(chosen):
                acting = Sampled(group.parts[chosen], group.by_instant[chosen], group.bounded)
                self._add_curvature(hessian, x, acting, by_sample[:, chosen])
        return 0.5 * (hessian + hessian.T)

    def _add_curvature(self, hessian: Array, x: Array, group: Sampled, multipliers: Array) -> None:
        jets, basis = self._jets(x, group)
        by_x = self._by_unknowns(x, group, jets, basis)
        count, width = jets.shape
        size = CURVATURE_STEP * np.maximum(np.abs(jets).max(axis=0), 1e-3)
        moved = np.concatenate([jets[None], jets + np.diag(size)[:, None, :]])  # (1 + width, N, width)
        total = np.zeros((width + 1, count, width))
        rows = _parted(group.bounded(self.series_of(inputs(moved.reshape(-1, width)))))[0]
        for row, multiplier in zip(rows, multipliers, strict=True):
            if multiplier.any():
                slope = row.constraint.series[0].slope.reshape(total.shape)
                total += (row.sign / row.constraint.scale * multiplier)[:, None] * slope
        by_jets = (total[1:] - total[0]) / size[:, None, None]  # (width, N, width)
        half = np.matmul(by_jets.transpose(1, 0, 2), by_x)  # (N, width, unknowns)
        hessian += np.tensordot(by_x, half, axes=((0, 1), (0, 1)))
        # What the jets q_k = T^-k B_k c themselves curve, of T, of c and T, and of the instants in B.
        d, at, duration = len(self.task.start), self.width, self.duration(x)
        order = np.repeat(np.arange(float(ORDERS)), d)
        hessian[at, at] += np.einsum("nj,nj->", total[0], jets * order * (order + 1.0) / duration**2)
        mixed = np.einsum("nj,njx->x", total[0] * -order / duration, by_x[:, :, :at])
        hessian[:at, at] += 2.0 * mixed  # both halves: the caller makes it symmetric
        if self.task.instants:
            later = total[0][:, :-d]  # nothing that depends on instants takes the last order
            hessian[:at, at + 1 :] += (
                2.0 * duration * np.einsum("nj,njx,nm->xm", later, by_x[:, d:, :at], group.by_instant)
            )
            of_time = np.einsum("nj,nj,nm->m", later * -order[:-d], jets[:, d:], group.by_instant)
            hessian[at, at + 1 :] += 2.0 * of_time
            twice = np.einsum("nj,nj->n", later[:, :-d], jets[:, 2 * d :]) * duration**2
            hessian[at + 1 :, at + 1 :] += (group.by_instant * twice[:, None]).T @ group.by_instant

    def _jets(self, x: Array, group: Sampled) -> tuple[Array, Array]:
        """Return derivatives in time of the coordinates (N, ORDERS * d) and of the basis (N, ORDERS, n)."""
        parts = group.parts
        if group.by_instant.any():
            parts = np.clip(parts + group.by_instant @ x[self.width + 1 :], 0.0, 1.0)
        basis = self._fixed if parts is self.groups[0].parts else self.basis(parts)
        basis = basis * (self.duration(x) ** -np.arange(float(ORDERS)))[:, None]
        return (basis @ self.coefficients(x)).reshape(len(basis), -1), basis

    def _by_unknowns(self, x: Array, group: Sampled, flat: Array, basis: Array) -> Array:
        """Return the slopes of these derivatives, (N, ORDERS * d, unknowns)."""
        d, duration = len(self.task.start), self.duration(x)
        jets = flat.reshape(-1, ORDERS, d)
        by_x = np.zeros((*jets.shape, len(x)))
        for j in range(d):
            by_x[:, :, j, j : self.width : d] = basis[:, :, self.free]
        by_x[..., self.width] = -np.arange(float(ORDERS))[:, None] * jets / duration
        if group.by_instant.any():
            by_x[:, :-1, :, self.width + 1 :] = duration * np.einsum(
                "nkj,nm->nkjm", jets[:, 1:], group.by_instant
            )
        return by_x.reshape(len(flat), ORDERS * d, -1)

    def series_of(self, flat: Sequence[Number]) -> list[Series]:
        """Return the coordinates' series by their derivatives in time, order by order."""
        d = len(self.task.start)
        return [from_derivatives(flat[j::d]) for j in range(d)]

    def _limited(self, coordinates: list[Series]) -> list[Bounded]:
        """Return all that is limited at every sample."""
        limits = self.task.limits
        bounds = []
        for constraint in constraints(motion(self.task.to_load(coordinates), limits.gravity), limits):
            if np.isfinite(constraint.high):
                bounds.append(Bounded(constraint, constraint.high, 1.0))
            if np.isfinite(constraint.low):
                bounds.append(Bounded(constraint, constraint.low, -1.0))
            if constraint.name.endswith(EFFORT):
                bounds.append(Bounded(constraint, None, 1.0))
        if self.task.forwards:
            rates = [Constraint("progress", [c[1]], 0.0, np.inf, 1.0) for c in coordinates]
            bounds += [Bounded(rate, 0.0, -1.0) for rate in rates]
        return bounds

    def _passing(self, index: int, point: Array) -> Sampled:
        """Demand that a point is met at an instant: two inequalities for each coordinate."""

        def bounded(coordinates: list[Series]) -> list[Bounded]:
            size = self.task.limits.size
            return [
                Bounded(Constraint("via", c, at, at, size), at, sign)
                for c, at in zip(coordinates, point.tolist(), strict=True)
                for sign in (1.0, -1.0)
            ]

        return Sampled(np.zeros(1), np.eye(len(self.task.instants))[index : index + 1], bounded)

    def _beside(self, passage: Passage, count: int) -> Sampled:
        """Demand that load and rope stay on a side of an obstacle, from one instant to another."""
        limits = self.task.limits
        box, part = limits.obstacles[passage.box], np.linspace(0.0, 1.0, count)[:, None]
        instants = np.eye(len(self.task.instants) + 2)
        weights = (1.0 - part) * instants[passage.begin] + part * instants[passage.end]

        def bounded(coordinates: list[Series]) -> list[Bounded]:
            moved = motion(self.task.to_load([c[:3] for c in coordinates]), limits.gravity)
            return [
                Bounded(Constraint(box.name, distance, 0.0, np.inf, limits.size), 0.0, -1.0)
                for distance in clear_of(moved, box, limits.radius, passage.side)
            ]

        return Sampled(weights[:, -1].copy(), weights[:, 1:-1].copy(), bounded)


def series_along(breaks: Array, coefficients: Array, degree: int, time: Array) -> list[Series]:
    """Return the series at `time` (N,) [s] of coordinates (n, d) of a spline with knots at `breaks` [s]."""
    rows = [curve(time) for curve in derivatives(spline(breaks, coefficients, degree), ORDERS)]
    return [from_derivatives([row[:, j] for row in rows]) for j in range(coefficients.shape[1])]


def _parted(bounds: Sequence[Bounded]) -> tuple[list[Bounded], list[Bounded]]:
    """Divide into those with a bound, and the efforts."""
    return [f for f in bounds if f.bound is not None], [f for f in bounds if f.bound is None]


def _chained(bounds: Sequence[Bounded], by_x: Array) -> tuple[Array, Array]:
    """Return excesses over the bounds, or the efforts themselves, and their slopes by the unknowns."""
    if not bounds:
        return np.zeros(0), np.zeros((0, by_x.shape[2]))
    numbers = [bounded.excess() for bounded in bounds]
    by_jets = np.stack([number.slope for number in numbers], axis=1)
    by_unknowns = np.matmul(by_jets, by_x).transpose(1, 0, 2)
    return np.concatenate([number.value for number in numbers]), by_unknowns.reshape(-1, by_x.shape[2])

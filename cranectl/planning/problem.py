"""A motion in minimum time as an optimisation problem: a spline, its duration and its instants.

Coordinates q are splines of degree 7 in time with uniform knots. They give the load's motion: its x, y, z for
a free motion, two coordinates in a plane, or the path coordinate s. The unknowns x are

- the free coefficients, one row of coordinates after the other,
- the duration T [s],
- the instants, fractions of T, at which via points are passed and sides of obstacles change.

Limits hold at samples; `proof` covers the time between them.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cranectl.planning.arithmetic import inputs
from cranectl.planning.edges import Edge, edge_excesses
from cranectl.planning.limits import Constraint, Limits, constraints, motion, side_distances
from cranectl.reference import Series, TimeLaw, derivatives, spline
from cranectl.support import Array

ORDERS = 6  # position and five derivatives, since the rate of the set-points contains the fifth
REST_COEFFICIENTS = 5  # equal coefficients at each end, which give rest up to the fourth derivative
EFFORT_SUFFIX = "set-point's rate"  # of constraints whose mean square is an objective
SAMPLES_PER_SPAN = 8  # at first
PASSAGE_SAMPLES = 49  # of each passage beside an obstacle, at first
MIN_INSTANT_GAP = 0.02  # between instants, as a fraction of the duration
HESSIAN_STEP = 1e-5  # of finite differences, relative to a derivative's size

ToLoad = Callable[[list[Series]], list[Series]]  # coordinates → load x, y, z


class Passage(NamedTuple):
    """A part of a motion on one side of an obstacle, from one instant to another.

    Instants count from 1; 0 is the motion's begin and -1 its end.
    """

    box: int  # index of the obstacle
    side: str
    begin: int
    end: int


@dataclass(frozen=True)
class Task:
    """A motion from rest at `start` to rest at `end`, in coordinates (d,) of the load."""

    start: Array
    end: Array
    to_load: ToLoad
    limits: Limits
    guess: Array  # (G, d) coordinates at equal steps of time
    duration: float  # of the motion by the law of degree 9, with stops if needed [s]
    spans: int
    is_monotone: bool = False  # no coordinate may decrease
    samples_per_span: int = SAMPLES_PER_SPAN
    via: tuple[Array, ...] = ()  # coordinates (d,) of via points, passed at the first instants
    passages: tuple[Passage, ...] = ()
    instants: tuple[float, ...] = ()  # of the guess
    edges: tuple[Edge, ...] = ()  # at which the motion begins, ends or passes


class Linearisation(NamedTuple):
    """The problem linearised at one x, with derivatives with respect to the unknowns."""

    excess: Array  # (R,) over each bound, as a share of its scale: at most 0 where all limits hold
    slope: Array  # (R, unknowns)
    efforts: Array  # (E,) rates of the set-points, as shares of their limits
    effort_slope: Array  # (E, unknowns)


class SampleGroup(NamedTuple):
    """Samples of the motion at which the same constraints hold."""

    fractions: Array  # (N,) of the duration, without the share of the instants
    by_instant: Array  # (N, instants) weights of the instants in the fractions
    bounded: Callable[[list[Series]], list["BoundedConstraint"]]  # of the coordinates' series


class BoundedConstraint(NamedTuple):
    """A constraint with its upper (sign 1) or lower (sign -1) bound; an effort has no bound."""

    constraint: Constraint
    bound: float | None
    sign: float

    def excess(self) -> Any:
        """Return the excess over the bound as a share of its scale (N,), or an effort itself."""
        value = self.constraint.series[0] - (self.bound or 0.0)
        return value * (self.sign / self.constraint.scale)


class Problem:
    """A task with its limits at samples, its unknowns, and derivatives for the solver."""

    def __init__(self, task: Task, samples: Array, passage_samples: int = PASSAGE_SAMPLES) -> None:
        """Set up limits at `samples` (N,), fractions of the duration, and `passage_samples` per passage."""
        self.task = task
        spans, count = task.spans, len(task.instants)
        whole = spline(np.linspace(0.0, 1.0, spans + 1), np.eye(spans + TimeLaw.DEGREE), TimeLaw.DEGREE)
        self.curves = derivatives(whole, ORDERS)
        self.free = slice(REST_COEFFICIENTS, spans + TimeLaw.DEGREE - REST_COEFFICIENTS)
        self.width = (spans + TimeLaw.DEGREE - 2 * REST_COEFFICIENTS) * len(task.start)  # free coefficients
        self.groups = [SampleGroup(samples, np.zeros((len(samples), count)), self._bounded_constraints)]
        self.groups += [self._via_point_samples(index, point) for index, point in enumerate(task.via)]
        self.groups += [self._passage_samples(passage, passage_samples) for passage in task.passages]
        self._fixed_basis = self.basis(samples)
        # Rows give begin minus end of each interval, from the motion's begin, the instants and its end.
        between_via = itertools.pairwise([0, *range(1, len(task.via) + 1), -1])
        intervals = [*between_via, *((passage.begin, passage.end) for passage in task.passages)]
        instants = np.eye(count + 2)
        rows = [instants[begin] - instants[end] for begin, end in intervals if (begin, end) != (0, -1)]
        self._order_matrix = np.array(rows).reshape(-1, count + 2)

    def basis(self, fractions: Array) -> Array:
        """Return the basis and its derivatives with respect to fractions: (N, ORDERS, spans + degree)."""
        return np.stack([curve(fractions) for curve in self.curves], axis=1)

    def coefficients(self, x: Array) -> Array:
        """Return all coefficients, (spans + degree, d)."""
        ends = [np.tile(end, (REST_COEFFICIENTS, 1)) for end in (self.task.start, self.task.end)]
        return np.vstack([ends[0], x[: self.width].reshape(-1, len(self.task.start)), ends[1]])

    def duration(self, x: Array) -> float:
        """Return the duration [s]."""
        return float(x[self.width])

    def unknowns(self, coefficients: Array, duration: float) -> Array:
        """Return x of a motion with the guess's instants: the inverse of `coefficients` and `duration`."""
        return np.array([*coefficients[self.free].ravel(), duration, *self.task.instants])

    def linearise(self, x: Array) -> Linearisation:
        """Return excesses and efforts at x, and their derivatives."""
        limited, efforts = [], []
        for group in self.groups:
            jets, basis = self._jets(x, group)
            by_x = self._by_unknowns(x, group, jets, basis)
            limits, others = _split_efforts(group.bounded(self.series_of(inputs(jets))))
            limited.append(_apply_chain_rule(limits, by_x))
            efforts.append(_apply_chain_rule(others, by_x))
        excess, slope = zip(*limited, self.order_excesses(x), self._edge_excesses(x), strict=True)
        return Linearisation(np.concatenate(excess), np.vstack(slope), *efforts[0])

    def values(self, x: Array) -> tuple[Array, Array]:
        """Return excesses and efforts at x without derivatives, which takes a tenth of the time."""
        excess, efforts = [], []
        for index, group in enumerate(self.groups):
            limits, others = _split_efforts(group.bounded(self.series_of(list(self._jets(x, group)[0].T))))
            excess += [limit.excess() for limit in limits]
            efforts += [other.excess() for other in others if not index]  # the first group has all
        linear = self.order_excesses(x)[0], self._edge_excesses(x)[0]
        return np.concatenate([*excess, *linear]), np.concatenate(efforts)

    def order_excesses(self, x: Array) -> tuple[Array, Array]:
        """Return excesses, and their slopes, of the constraint that intervals end after they begin."""
        slope = np.zeros((len(self._order_matrix), len(x)))
        slope[:, self.width + 1 :] = self._order_matrix[:, 1:-1]
        return MIN_INSTANT_GAP + self._order_matrix @ [0.0, *x[self.width + 1 :], 1.0], slope

    def _edge_excesses(self, x: Array) -> tuple[Array, Array]:
        return edge_excesses(self.task.edges, x, self.width, self.task.limits.size)

    def hessian_of(self, x: Array, multipliers: Array) -> Array:
        """Return the Hessian (unknowns, unknowns) of the excesses weighted by `multipliers` (R,)."""
        hessian = np.zeros((len(x), len(x)))
        first = 0
        for group in self.groups:
            jets, _ = self._jets(x, group)
            count = len(group.fractions)
            # One sample is enough to count the constraints.
            total = len(_split_efforts(group.bounded(self.series_of(list(jets[:1].T))))[0]) * count
            by_sample = multipliers[first : first + total].reshape(-1, count)
            first += total
            index = np.flatnonzero(by_sample.max(axis=0) > 0.0)
            if len(index):
                active = SampleGroup(group.fractions[index], group.by_instant[index], group.bounded)
                self._add_hessian(hessian, x, active, by_sample[:, index])
        return 0.5 * (hessian + hessian.T)

    def _add_hessian(self, hessian: Array, x: Array, group: SampleGroup, multipliers: Array) -> None:
        jets, basis = self._jets(x, group)
        by_x = self._by_unknowns(x, group, jets, basis)
        count, width = jets.shape
        size = HESSIAN_STEP * np.maximum(np.abs(jets).max(axis=0), 1e-3)
        perturbed = np.concatenate([jets[None], jets + np.diag(size)[:, None, :]])  # (1 + width, N, width)
        total = np.zeros((width + 1, count, width))
        rows = _split_efforts(group.bounded(self.series_of(inputs(perturbed.reshape(-1, width)))))[0]
        for row, multiplier in zip(rows, multipliers, strict=True):
            if multiplier.any():
                slope = row.constraint.series[0].slope.reshape(total.shape)
                total += (row.sign / row.constraint.scale * multiplier)[:, None] * slope
        by_jets = (total[1:] - total[0]) / size[:, None, None]  # (width, N, width)
        half = np.matmul(by_jets.transpose(1, 0, 2), by_x)  # (N, width, unknowns)
        hessian += np.tensordot(by_x, half, axes=((0, 1), (0, 1)))
        # Second derivatives of the jets q_k = T^-k B_k c: in T, in c and T, and in the instants within B.
        d, at, duration = len(self.task.start), self.width, self.duration(x)
        order = np.repeat(np.arange(float(ORDERS)), d)
        hessian[at, at] += np.einsum("nj,nj->", total[0], jets * order * (order + 1.0) / duration**2)
        mixed = np.einsum("nj,njx->x", total[0] * -order / duration, by_x[:, :, :at])
        hessian[:at, at] += 2.0 * mixed  # twice, since the caller averages with the transpose
        if self.task.instants:
            later = total[0][:, :-d]  # constraints that depend on instants do not contain the last order
            hessian[:at, at + 1 :] += (
                2.0 * duration * np.einsum("nj,njx,nm->xm", later, by_x[:, d:, :at], group.by_instant)
            )
            of_time = np.einsum("nj,nj,nm->m", later * -order[:-d], jets[:, d:], group.by_instant)
            hessian[at, at + 1 :] += 2.0 * of_time
            twice = np.einsum("nj,nj->n", later[:, :-d], jets[:, 2 * d :]) * duration**2
            hessian[at + 1 :, at + 1 :] += (group.by_instant * twice[:, None]).T @ group.by_instant

    def _jets(self, x: Array, group: SampleGroup) -> tuple[Array, Array]:
        """Return derivatives in time of the coordinates (N, ORDERS * d) and of the basis (N, ORDERS, n)."""
        fractions = group.fractions
        if group.by_instant.any():
            fractions = np.clip(fractions + group.by_instant @ x[self.width + 1 :], 0.0, 1.0)
        # No instant moves the samples of the first group, so their basis is kept.
        basis = self._fixed_basis if fractions is self.groups[0].fractions else self.basis(fractions)
        basis = basis * (self.duration(x) ** -np.arange(float(ORDERS)))[:, None]
        return (basis @ self.coefficients(x)).reshape(len(basis), -1), basis

    def _by_unknowns(self, x: Array, group: SampleGroup, flat: Array, basis: Array) -> Array:
        """Return the slopes of the jets, (N, ORDERS * d, unknowns)."""
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

    def series_of(self, flat: Sequence[Any]) -> list[Series]:
        """Return the coordinates' series from their derivatives in time, order by order."""
        d = len(self.task.start)
        return [Series.from_derivatives(flat[j::d]) for j in range(d)]

    def _bounded_constraints(self, coordinates: list[Series]) -> list[BoundedConstraint]:
        """Return the constraints that hold at every sample, with their bounds, and the efforts."""
        limits = self.task.limits
        bounds = []
        for constraint in constraints(motion(self.task.to_load(coordinates), limits.gravity), limits):
            if np.isfinite(constraint.high):
                bounds.append(BoundedConstraint(constraint, constraint.high, 1.0))
            if np.isfinite(constraint.low):
                bounds.append(BoundedConstraint(constraint, constraint.low, -1.0))
            if constraint.name.endswith(EFFORT_SUFFIX):
                bounds.append(BoundedConstraint(constraint, None, 1.0))
        if self.task.is_monotone:
            rates = [Constraint("progress", Series([c[1]]), 0.0, np.inf, 1.0) for c in coordinates]
            bounds += [BoundedConstraint(rate, 0.0, -1.0) for rate in rates]
        return bounds

    def _via_point_samples(self, index: int, point: Array) -> SampleGroup:
        """Require that a via point is passed at its instant: two inequalities for each coordinate."""

        def bounded(coordinates: list[Series]) -> list[BoundedConstraint]:
            size = self.task.limits.size
            return [
                BoundedConstraint(Constraint("via", c, target, target, size), target, sign)
                for c, target in zip(coordinates, point.tolist(), strict=True)
                for sign in (1.0, -1.0)
            ]

        return SampleGroup(np.zeros(1), np.eye(len(self.task.instants))[index : index + 1], bounded)

    def _passage_samples(self, passage: Passage, count: int) -> SampleGroup:
        """Require that load and rope stay on one side of an obstacle during a passage."""
        limits = self.task.limits
        box, share = limits.obstacles[passage.box], np.linspace(0.0, 1.0, count)[:, None]
        instants = np.eye(len(self.task.instants) + 2)
        weights = (1.0 - share) * instants[passage.begin] + share * instants[passage.end]

        def bounded(coordinates: list[Series]) -> list[BoundedConstraint]:
            # Distances depend on positions of the crane, for which two derivatives of the load suffice.
            crane_motion = motion(self.task.to_load([Series(c[:3]) for c in coordinates]), limits.gravity)
            return [
                BoundedConstraint(Constraint(box.name, distance, 0.0, np.inf, limits.size), 0.0, -1.0)
                for distance in side_distances(crane_motion, box, limits.radius, passage.side)
            ]

        return SampleGroup(weights[:, -1].copy(), weights[:, 1:-1].copy(), bounded)


def series_along(breaks: Array, coefficients: Array, degree: int, time: Array) -> list[Series]:
    """Return the series at `time` (N,) [s] of the coordinates of a spline with `coefficients` (n, d)."""
    rows = [curve(time) for curve in derivatives(spline(breaks, coefficients, degree), ORDERS)]
    return [Series.from_derivatives([row[:, j] for row in rows]) for j in range(coefficients.shape[1])]


def _split_efforts(
    bounds: Sequence[BoundedConstraint],
) -> tuple[list[BoundedConstraint], list[BoundedConstraint]]:
    """Divide constraints into those with a bound, and efforts."""
    return [b for b in bounds if b.bound is not None], [b for b in bounds if b.bound is None]


def _apply_chain_rule(bounds: Sequence[BoundedConstraint], by_x: Array) -> tuple[Array, Array]:
    """Return excesses, or efforts, and their slopes with respect to the unknowns, by the chain rule."""
    if not bounds:
        return np.zeros(0), np.zeros((0, by_x.shape[2]))
    numbers = [bounded.excess() for bounded in bounds]
    by_jets = np.stack([number.slope for number in numbers], axis=1)
    by_unknowns = np.matmul(by_jets, by_x).transpose(1, 0, 2)
    return np.concatenate([number.value for number in numbers]), by_unknowns.reshape(-1, by_x.shape[2])

"""A motion in minimum time as an optimisation problem: a spline, its duration, when it passes what.

Coordinates q, splines of degree 7 in time over uniform knots, give the load's motion: its own x, y, z for a
free motion, two of them in a plane, or how far along a path it is. Unknowns x: the free coefficients, one row
of coordinates after the other, then the duration T [s], then the parts of it, 0 to 1, at which points are
passed and sides of obstacles change. Limits hold at samples; between them `proof` finds what they miss.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cranectl.planning.gradients import inputs
from cranectl.planning.limits import Box, Limits, Quantity, clear_of, motion, quantities
from cranectl.reference.series import Number, Series, from_derivatives
from cranectl.reference.time_laws import PLANNED_DEGREE, derivatives, spline
from cranectl.support.arrays import Array

ORDERS = 6  # position and five derivatives: the fifth is in the rate of the set-points
TIED = 5  # coefficients at each end that are equal: rest up to the fourth derivative
EFFORT = "set-point's rate"  # the quantities whose mean square is priced
LEG_SAMPLES = 49  # of each stretch beside an obstacle, at first
APART = 0.02  # least distance of instants, in durations
CURVATURE_STEP = 1e-5  # of a derivative's size, for second derivatives

ToLoad = Callable[[list[Series]], list[Series]]  # coordinates → load x, y, z


class Rows(NamedTuple):
    """Functions of the unknowns, linearised."""

    value: Array  # (R,)
    slope: Array  # (R, unknowns)


class Linearised(NamedTuple):
    """The problem near one x."""

    excess: Rows  # over each bound, in parts of its size: at most 0
    efforts: Rows  # rates of the set-points, in parts of their limits


class Leg(NamedTuple):
    """A stretch of the motion on one side of an obstacle, between two instants or the motion's ends."""

    box: Box
    side: str
    begins: int | None  # which of the instants; None: with the motion
    ends: int | None

    @property
    def stretch(self) -> tuple[int, int]:
        """Where it begins and ends among the motion's begin, its instants, its end."""
        return 0 if self.begins is None else self.begins + 1, -1 if self.ends is None else self.ends + 1


class Sampled(NamedTuple):
    """Points of the motion at which something must hold."""

    parts: Array  # (N,) of the duration, without those of the instants
    by_instant: Array  # (N, instants) what they add
    bounded: Callable[[list[Series]], list["Bounded"]]  # of the coordinates' series


class Bounded(NamedTuple):
    """A quantity and a bound, by sign an upper (1) or lower (-1) one; without a bound it is an effort."""

    quantity: Quantity
    bound: float | None
    sign: float

    def over(self) -> Array:
        """By how much, in parts of its size, (N,); of an effort, the effort. Of floats."""
        excess: Array = self.sign / self.quantity.scale * (self.quantity.series[0] - (self.bound or 0.0))
        return excess


class Problem:
    """From rest at `start` to rest at `end`, coordinates (d,), within `limits`."""

    def __init__(
        self,
        start: Array,
        end: Array,
        limits: Limits,
        to_load: ToLoad,
        *,
        spans: int,
        samples: Array,
        beside: int = LEG_SAMPLES,
        via: Sequence[Array] = (),
        legs: Sequence[Leg] = (),
        forwards: bool = False,
    ) -> None:
        """`samples`: parts of the duration, (N,); `beside`: how many on each leg.

        `via`: coordinates (d,) passed at the first instants.

        `forwards`: no coordinate may ever fall.
        """
        self.start, self.end, self.limits, self.spans = start, end, limits, spans
        self._to_load, self._forwards = to_load, forwards
        whole = spline(np.linspace(0.0, 1.0, spans + 1), np.eye(spans + PLANNED_DEGREE), PLANNED_DEGREE)
        self.curves = derivatives(whole, ORDERS)
        self.free = slice(TIED, spans + PLANNED_DEGREE - TIED)
        self.width = (spans + PLANNED_DEGREE - 2 * TIED) * len(start)  # free coefficients
        self.instants = max(
            [len(via), *(1 + e for leg in legs for e in (leg.begins, leg.ends) if e is not None)]
        )
        self._late = _lateness(len(via), legs, self.instants)
        still = np.zeros((len(samples), self.instants))
        self.groups = [Sampled(samples, still, self._limited)]
        self.groups += [self._passing(index, point) for index, point in enumerate(via)]
        self.groups += [self._beside(leg, beside) for leg in legs]
        self._fixed = self.basis(samples)

    def basis(self, parts: Array) -> Array:
        """Derivatives by the part of the duration of the basis functions: (N, ORDERS, spans + degree)."""
        return np.stack([curve(parts) for curve in self.curves], axis=1)

    def coefficients(self, x: Array) -> Array:
        """All of them, (spans + degree, d)."""
        tied = [np.tile(end, (TIED, 1)) for end in (self.start, self.end)]
        return np.vstack([tied[0], x[: self.width].reshape(-1, len(self.start)), tied[1]])

    def duration(self, x: Array) -> float:
        """[s]."""
        return float(x[self.width])

    def unknowns(self, coefficients: Array, duration: float, instants: Sequence[float] = ()) -> Array:
        """The x of a motion; what `coefficients`, `duration` give back."""
        return np.array([*coefficients[self.free].ravel(), duration, *instants])

    def linearised(self, x: Array) -> Linearised:
        """Excesses and efforts at x, and their slopes."""
        found = [self._linearised(x, group) for group in self.groups]
        order = Rows(*self.in_order(x))
        excess = [rows for rows, _ in found] + [order]
        return Linearised(
            Rows(np.concatenate([r.value for r in excess]), np.vstack([r.slope for r in excess])), found[0][1]
        )

    def values(self, x: Array) -> tuple[Array, Array]:
        """Excesses and efforts at x without their slopes: a tenth of the work."""
        excess, efforts = [], []
        for index, group in enumerate(self.groups):
            limits, others = _parted(group.bounded(self.series_of(list(self._jets(x, group)[0].T))))
            excess += [each.over() for each in limits]
            efforts += [each.over() for each in others if not index]
        return np.concatenate([*excess, self.in_order(x)[0]]), np.concatenate(efforts)

    def _linearised(self, x: Array, group: Sampled) -> tuple[Rows, Rows]:
        jets, basis = self._jets(x, group)
        by_x = self._by_unknowns(x, group, jets, basis)
        limits, efforts = _parted(group.bounded(self.series_of(inputs(jets))))
        return _chained(limits, by_x), _chained(efforts, by_x)

    def in_order(self, x: Array) -> tuple[Array, Array]:
        """That each stretch between via points, or beside an obstacle, ends after it begins, as excesses."""
        slope = np.zeros((len(self._late), len(x)))
        slope[:, self.width + 1 :] = self._late[:, 1:-1]
        return APART + self._late @ [0.0, *x[self.width + 1 :], 1.0], slope

    def curvature(self, x: Array, prices: Array) -> Array:
        """Second derivative (unknowns, unknowns) of `prices` (R,) times the excesses."""
        hessian = np.zeros((len(x), len(x)))
        first = 0
        for group in self.groups:
            jets, _ = self._jets(x, group)
            count = len(group.parts)
            total = len(_parted(group.bounded(self.series_of(list(jets[:1].T))))[0]) * count
            by_sample = prices[first : first + total].reshape(-1, count)
            first += total
            priced = np.flatnonzero(by_sample.max(axis=0) > 0.0)
            if len(priced):
                acting = Sampled(group.parts[priced], group.by_instant[priced], group.bounded)
                self._add_curvature(hessian, x, acting, by_sample[:, priced])
        return 0.5 * (hessian + hessian.T)

    def _add_curvature(self, hessian: Array, x: Array, group: Sampled, prices: Array) -> None:
        jets, basis = self._jets(x, group)
        by_x = self._by_unknowns(x, group, jets, basis)
        count, width = jets.shape
        size = CURVATURE_STEP * np.maximum(np.abs(jets).max(axis=0), 1e-3)
        moved = np.concatenate([jets[None], jets + np.diag(size)[:, None, :]])  # (1 + width, N, width)
        total = np.zeros((width + 1, count, width))
        rows = _parted(group.bounded(self.series_of(inputs(moved.reshape(-1, width)))))[0]
        for each, price in zip(rows, prices, strict=True):
            if price.any():
                slope = each.quantity.series[0].slope.reshape(total.shape)
                total += (each.sign / each.quantity.scale * price)[:, None] * slope
        by_jets = (total[1:] - total[0]) / size[:, None, None]  # (width, N, width)
        half = np.matmul(by_jets.transpose(1, 0, 2), by_x)  # (N, width, unknowns)
        hessian += np.tensordot(by_x, half, axes=((0, 1), (0, 1)))
        # What the jets q_k = T^-k B_k c themselves bend, of T, of c and T, and of the instants in B.
        d, at, duration = len(self.start), self.width, self.duration(x)
        order = np.repeat(np.arange(float(ORDERS)), d)
        hessian[at, at] += np.einsum("nj,nj->", total[0], jets * order * (order + 1.0) / duration**2)
        mixed = np.einsum("nj,njx->x", total[0] * -order / duration, by_x[:, :, :at])
        hessian[:at, at] += 2.0 * mixed  # both halves: the caller makes it symmetric
        if self.instants:
            later = total[0][:, :-d]  # nothing that depends on instants takes the last order
            hessian[:at, at + 1 :] += (
                2.0 * duration * np.einsum("nj,njx,nm->xm", later, by_x[:, d:, :at], group.by_instant)
            )
            of_time = np.einsum("nj,nj,nm->m", later * -order[:-d], jets[:, d:], group.by_instant)
            hessian[at, at + 1 :] += 2.0 * of_time
            twice = np.einsum("nj,nj->n", later[:, :-d], jets[:, 2 * d :]) * duration**2
            hessian[at + 1 :, at + 1 :] += (group.by_instant * twice[:, None]).T @ group.by_instant

    def _jets(self, x: Array, group: Sampled) -> tuple[Array, Array]:
        """Derivatives of the coordinates in time, (N, ORDERS * d), and the basis (N, ORDERS, n) in time."""
        duration = self.duration(x)
        parts = group.parts
        if group.by_instant.any():
            parts = np.clip(parts + group.by_instant @ x[self.width + 1 :], 0.0, 1.0)
        basis = self._fixed if parts is self.groups[0].parts else self.basis(parts)
        basis = basis * (duration ** -np.arange(float(ORDERS)))[:, None]
        return (basis @ self.coefficients(x)).reshape(len(basis), -1), basis

    def _by_unknowns(self, x: Array, group: Sampled, flat: Array, basis: Array) -> Array:
        """Slopes of these derivatives, (N, ORDERS * d, unknowns)."""
        d, duration = len(self.start), self.duration(x)
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
        """Of the coordinates, by their derivatives in time, order by order."""
        d = len(self.start)
        return [from_derivatives(flat[j::d]) for j in range(d)]

    def _limited(self, coordinates: list[Series]) -> list[Bounded]:
        """All that is limited at every sample."""
        moved = motion(self._to_load(coordinates), self.limits.gravity)
        found = []
        for each in quantities(moved, self.limits):
            if np.isfinite(each.high):
                found.append(Bounded(each, each.high, 1.0))
            if np.isfinite(each.low):
                found.append(Bounded(each, each.low, -1.0))
            if each.name.endswith(EFFORT):
                found.append(Bounded(each, None, 1.0))
        if self._forwards:
            found += [Bounded(Quantity("progress", [c[1]], 0.0, np.inf, 1.0), 0.0, -1.0) for c in coordinates]
        return found

    def _passing(self, index: int, point: Array) -> Sampled:
        """That a point is met at an instant: two inequalities for each coordinate."""

        def bounded(coordinates: list[Series]) -> list[Bounded]:
            size = self.limits.size
            return [
                Bounded(Quantity("via", c, at, at, size), at, sign)
                for c, at in zip(coordinates, point.tolist(), strict=True)
                for sign in (1.0, -1.0)
            ]

        return Sampled(np.zeros(1), np.eye(self.instants)[index : index + 1], bounded)

    def _beside(self, leg: Leg, count: int) -> Sampled:
        """That load and rope stay on a side of an obstacle, from one instant to another."""
        way = np.linspace(0.0, 1.0, count)
        parts, by_instant = np.zeros(count), np.zeros((count, self.instants))
        if leg.begins is not None:
            by_instant[:, leg.begins] = 1.0 - way
        if leg.ends is None:
            parts = way
        else:
            by_instant[:, leg.ends] = way

        def bounded(coordinates: list[Series]) -> list[Bounded]:
            moved = motion(self._to_load([c[:3] for c in coordinates]), self.limits.gravity)
            return [
                Bounded(Quantity(leg.box.name, distance, 0.0, np.inf, self.limits.size), 0.0, -1.0)
                for distance in clear_of(moved, leg.box, self.limits.radius, leg.side)
            ]

        return Sampled(parts, by_instant, bounded)


def series_along(breaks: Array, coefficients: Array, degree: int, time: Array) -> list[Series]:
    """Of the coordinates of a spline with knots at `breaks` [s], coefficients (n, d), at `time` (N,) [s]."""
    rows = [curve(time) for curve in derivatives(spline(breaks, coefficients, degree), ORDERS)]
    return [from_derivatives([row[:, j] for row in rows]) for j in range(coefficients.shape[1])]


def _lateness(vias: int, legs: Sequence[Leg], instants: int) -> Array:
    """(rows, 1 + instants + 1) that give by how much stretches begin later than they end."""
    passing = [0, *range(1, vias + 1), -1]
    stretches = [*itertools.pairwise(passing), *(leg.stretch for leg in legs)]
    each = np.eye(instants + 2)  # the motion's begin, the instants, its end
    rows = [each[begins] - each[ends] for begins, ends in stretches if (begins, ends) != (0, -1)]
    return np.array(rows).reshape(-1, len(each))


def _parted(found: Sequence[Bounded]) -> tuple[list[Bounded], list[Bounded]]:
    """Those with a bound, and the efforts."""
    return [f for f in found if f.bound is not None], [f for f in found if f.bound is None]


def _chained(found: Sequence[Bounded], by_x: Array) -> Rows:
    """Excesses over the bounds, or the efforts themselves, and their slopes by the unknowns."""
    if not found:
        return Rows(np.zeros(0), np.zeros((0, by_x.shape[2])))
    factors = [each.sign / each.quantity.scale for each in found]
    numbers = [each.quantity.series[0] for each in found]
    values = [f * (n.value - (each.bound or 0.0)) for f, n, each in zip(factors, numbers, found, strict=True)]
    by_jets = np.stack([f * n.slope for f, n in zip(factors, numbers, strict=True)], axis=1)
    by_unknowns = np.matmul(by_jets, by_x).transpose(1, 0, 2)
    return Rows(np.concatenate(values), by_unknowns.reshape(-1, by_x.shape[2]))

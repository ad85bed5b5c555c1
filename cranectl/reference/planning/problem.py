"""A motion in minimum time as an optimisation problem: a spline, its duration, when it passes what.

Coordinates q, splines of degree 7 in time over uniform knots, give the load's motion: its own x, y, z for a
free motion, two of them in a plane, or how far along a path it is. Unknowns x: the free coefficients, one row
of coordinates after the other, then the duration T [s], then the parts of it, 0 to 1, at which points are
passed and sides of obstacles change. Limits hold at samples; between them `proof` finds what they miss.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cranectl.reference.planning.gradients import Gradient, inputs
from cranectl.reference.planning.limits import Limits, Quantity, motion, quantities
from cranectl.reference.planning.series import Series, from_derivatives
from cranectl.reference.time_laws import PLANNED_DEGREE, spline
from cranectl.support.arrays import Array

ORDERS = 6  # position and five derivatives: the fifth is in the rate of the set-points
TIED = 5  # coefficients at each end that are equal: rest up to the fourth derivative
EFFORT = "set-point's rate"  # the quantities whose mean square is priced
DIFFERENCE = 1e-5  # of a derivative's size, for second derivatives

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
    """A stretch of the motion on one side of an obstacle."""

    obstacle: int
    side: str
    begins: int | None  # index among the unknown instants; None: with the motion
    ends: int | None


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
        via: Sequence[Array] = (),
        legs: Sequence[Leg] = (),
        forwards: bool = False,
    ) -> None:
        """`samples`: parts of the duration, (N,). `forwards`: no coordinate may ever fall."""
        self.start, self.end, self.limits, self.to_load = start, end, limits, to_load
        self.spans, self.samples, self.via, self.legs, self.forwards = spans, samples, via, legs, forwards
        whole = spline(np.linspace(0.0, 1.0, spans + 1), np.eye(spans + PLANNED_DEGREE), PLANNED_DEGREE)
        self._basis = [whole.derivative(order) if order else whole for order in range(ORDERS)]
        self.free = slice(TIED, spans + PLANNED_DEGREE - TIED)
        self.width = (spans + PLANNED_DEGREE - 2 * TIED) * len(start)  # free coefficients
        self._at_samples = self.basis(samples)

    def basis(self, parts: Array) -> Array:
        """Derivatives by the part of the duration of all basis functions: (N, ORDERS, spans + degree)."""
        return np.stack([curve(parts) for curve in self._basis], axis=1)

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
        jets, by_x = self._jets(x, self._at_samples)
        flat = inputs(jets)
        values, slopes, efforts, effort_slopes = [], [], [], []
        for each, bound, sign in self._bounded(flat):
            number = each.series[0]
            if bound is None:
                efforts.append(number.value / each.scale)
                effort_slopes.append(number.slope / each.scale)
            else:
                values.append(sign * (number.value - bound) / each.scale)
                slopes.append(sign * number.slope / each.scale)
        excess = _chained(values, slopes, by_x)
        return Linearised(excess, _chained(efforts, effort_slopes, by_x))

    def curvature(self, x: Array, prices: Array) -> Array:
        """Second derivative (unknowns, unknowns) of `prices` (R,) times the excesses."""
        by_sample = prices.reshape(-1, len(self.samples))
        priced = np.flatnonzero(by_sample.max(axis=0) > 0.0)
        by_sample = by_sample[:, priced]
        jets, by_x = self._jets(x, self._at_samples[priced])
        count, width = jets.shape
        size = DIFFERENCE * np.maximum(np.abs(jets).max(axis=0), 1e-3)
        moved = np.concatenate([jets[None], jets + np.diag(size)[:, None, :]])  # (1 + width, N, width)
        total = np.zeros((width + 1, count, width))
        row = 0
        for each, bound, sign in self._bounded(inputs(moved.reshape(-1, width))):
            if bound is not None:
                if by_sample[row].any():
                    slope = each.series[0].slope.reshape(total.shape)
                    total += (sign / each.scale * by_sample[row])[:, None] * slope
                row += 1
        by_jets = (total[1:] - total[0]) / size[:, None, None]  # (width, N, width)
        half = np.matmul(by_jets.transpose(1, 0, 2), by_x)  # (N, width, unknowns)
        hessian: Array = np.tensordot(by_x, half, axes=((0, 1), (0, 1)))
        # What the jets themselves bend: T^-k times linear in the coefficients.
        order = np.repeat(np.arange(float(ORDERS)), len(self.start))
        duration, at = self.duration(x), self.width
        mixed = np.einsum("nj,njx->x", total[0] * -order / duration, by_x[:, :, :at])
        hessian[:at, at] += mixed
        hessian[at, :at] += mixed
        hessian[at, at] += np.einsum("nj,nj->", total[0], jets * order * (order + 1.0) / duration**2)
        return 0.5 * (hessian + hessian.T)

    def _jets(self, x: Array, basis: Array) -> tuple[Array, Array]:
        """Derivatives of the coordinates in time, (N, ORDERS * d), and of those by the unknowns."""
        count, d, duration = len(basis), len(self.start), self.duration(x)
        scaled = basis * (duration ** -np.arange(float(ORDERS)))[:, None]
        jets = scaled @ self.coefficients(x)  # (N, ORDERS, d)
        by_x = np.zeros((count, ORDERS, d, len(x)))
        for j in range(d):
            by_x[:, :, j, j : self.width : d] = scaled[:, :, self.free]
        by_x[..., self.width] = -np.arange(float(ORDERS))[:, None] * jets / duration
        return jets.reshape(count, -1), by_x.reshape(count, ORDERS * d, -1)

    def _bounded(self, flat: Sequence[Gradient]) -> list[tuple[Quantity, float | None, float]]:
        """(quantity, bound, sign) of all that is limited; without a bound: an effort."""
        d = len(self.start)
        coordinates = [from_derivatives(flat[j::d]) for j in range(d)]
        moved = motion(self.to_load(coordinates), self.limits.gravity)
        found: list[tuple[Quantity, float | None, float]] = []
        for each in quantities(moved, self.limits):
            if np.isfinite(each.high):
                found.append((each, each.high, 1.0))
            if np.isfinite(each.low):
                found.append((each, each.low, -1.0))
            if each.name.endswith(EFFORT):
                found.append((each, None, 1.0))
        if self.forwards:
            found += [(Quantity("progress", [c[1]], 0.0, np.inf, 1.0), 0.0, -1.0) for c in coordinates]
        return found


def _chained(values: Sequence[Array], slopes: Sequence[Array], by_x: Array) -> Rows:
    """Rows by the unknowns from rows by the jets."""
    by_jets = np.stack(slopes, axis=1)  # (N, Q, ORDERS * d)
    by_unknowns = np.matmul(by_jets, by_x).transpose(1, 0, 2)
    return Rows(np.concatenate(values), by_unknowns.reshape(-1, by_x.shape[2]))

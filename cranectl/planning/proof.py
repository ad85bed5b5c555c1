"""Prove that a motion keeps its limits at every moment, also between samples.

On each polynomial piece of the curve, every constraint is enclosed twice with outward rounding: from the
hulls of the load's derivatives, and from its value in the middle plus its rate times half the length. A piece
is proven if the intersection of both enclosures is within the limits. It is refuted if its middle is
certainly outside. Else it is halved.

The hulls are those of Bernstein coefficients. Each derivative has its own, from the differences of the
spline's coefficients, because differences of later positions would lose digits: a short motion far from the
origin is a small difference of large numbers.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.planning.arithmetic import Interval, interval, stacked, unbound_nan
from cranectl.planning.limits import SIDES, Limits, constraints, motion, side_distances
from cranectl.planning.problem import ORDERS, ToLoad
from cranectl.reference import Series
from cranectl.support import Array

PROOF_MARGIN = 1e-9  # tolerated excess of a limit, as a share of its scale, or in metres for obstacles
MAX_PIECES = 20_000  # after which the proof is given up


class PolynomialPieces(NamedTuple):
    """P pieces of a spline of d coordinates over time, each of them one polynomial."""

    start: Array  # (P,) [s]
    length: Interval  # (P,) [s]
    derivatives: tuple[Interval, ...]  # of order k: Bernstein coefficients (P, degree - k + 1, d)

    def hull(self, order: int, coordinate: int) -> Interval:
        """Enclose a derivative on each piece, (P,)."""
        row = self.derivatives[order][:, :, coordinate]
        return Interval(row.low.min(axis=1), row.high.max(axis=1))

    def middle(self, order: int, coordinate: int) -> Interval:
        """Enclose a derivative in the middle of each piece, (P,)."""
        row = self.derivatives[order][:, :, coordinate]
        while row.low.shape[1] > 1:
            row = _average_neighbours(row)
        return row[:, 0]

    def halve(self, index: NDArray[np.intp]) -> "PolynomialPieces":
        """Return both halves of the pieces at `index`: first all left halves, then all right ones."""
        start, half = self.start[index], self.length[index] * 0.5
        halves = []
        for derivative in self.derivatives:
            left, right = _subdivide(derivative[index])
            halves.append(
                Interval(np.concatenate([left.low, right.low]), np.concatenate([left.high, right.high]))
            )
        lengths = Interval(np.tile(half.low, 2), np.tile(half.high, 2))
        return PolynomialPieces(np.concatenate([start, start + half.low]), lengths, tuple(halves))


def polynomial_pieces(breaks: Array, coefficients: Array, degree: int, orders: int) -> PolynomialPieces:
    """Return the spans of the B-spline with knots at `breaks` [s] and coefficients (spans + degree, d)."""
    knots = np.concatenate([np.full(degree, breaks[0]), breaks, np.full(degree, breaks[-1])])
    first = np.arange(len(breaks) - 1)
    derivatives: list[Interval] = []
    control = interval(coefficients)
    for order in range(orders):
        if order > degree:
            derivatives.append(derivatives[-1] * 0.0)
            continue
        derivatives.append(_bernstein(control, knots, first, degree - order))
        if order < degree:  # the B-spline of the next derivative, whose knots lack the outermost ones
            later, knots = knots[degree - order + 1 : -1], knots[1:-1]
            step = interval(later) - interval(knots[: len(later)])
            rise = (control[1:] - control[:-1]) * float(degree - order)
            control = rise / step[:, None]
    return PolynomialPieces(breaks[:-1], interval(breaks[1:]) - interval(breaks[:-1]), tuple(derivatives))


def _bernstein(control: Interval, knots: Array, first: NDArray[np.intp], degree: int) -> Interval:
    """Return the Bernstein coefficients (P, degree + 1, d) of each span of a B-spline.

    They are means of the span's coefficients, so they lie within their hull. De Boor's recursion alone would
    widen it: each of its levels contains a coefficient twice.
    """
    begins, ends = knots[degree + first], knots[degree + first + 1]
    rows = [
        _blossom(control, knots, first, [ends] * later + [begins] * (degree - later))
        for later in range(degree + 1)
    ]
    own = [control[first + k] for k in range(degree + 1)]
    low, high = np.min([c.low for c in own], axis=0), np.max([c.high for c in own], axis=0)
    return stacked(rows, axis=1).intersect(Interval(low[:, None], high[:, None]))


def _blossom(
    control: Interval, knots: Array, first: NDArray[np.intp], arguments: Sequence[Array]
) -> Interval:
    """Evaluate the polar form of all spans at one argument [s] per degree, by de Boor's recursion."""
    degree = len(arguments)
    row = [control[first + k] for k in range(degree + 1)]
    for level, argument in enumerate(arguments, 1):
        at = interval(argument)
        for k in range(degree, level - 1, -1):
            left, right = interval(knots[first + k]), interval(knots[first + degree + k - level + 1])
            part = (at - left) / (right - left)
            row[k] = row[k - 1] + part[:, None] * (row[k] - row[k - 1])
    return row[degree]


def _average_neighbours(row: Interval) -> Interval:
    return (row[:, :-1] + row[:, 1:]) * 0.5


def _subdivide(row: Interval) -> tuple[Interval, Interval]:
    """Divide Bézier polynomials at their middle by de Casteljau's algorithm.

    The coefficients of both halves are means of those of the whole, so they lie within its hull. Without
    that, rounding would widen the hull at each division.
    """
    hull = Interval(row.low.min(axis=1, keepdims=True), row.high.max(axis=1, keepdims=True))
    left, right = [row[:, 0]], [row[:, -1]]
    while row.low.shape[1] > 1:
        row = _average_neighbours(row)
        left.append(row[:, 0])
        right.append(row[:, -1])
    return stacked(left, axis=1).intersect(hull), stacked(right[::-1], axis=1).intersect(hull)


class Violation(NamedTuple):
    """A limit that a piece certainly exceeds, or for which it could not be decided."""

    name: str
    start: float  # of the piece [s]
    end: float
    excess: float  # as a share of the limit, or in metres for obstacles
    certain: bool


class Proof(NamedTuple):
    """The result of a proof."""

    pieces: int
    slack: dict[str, float]  # smallest proven slack by constraint, as a share of its limit or in metres
    violations: tuple[Violation, ...]

    @property
    def is_valid(self) -> bool:
        return not self.violations


def prove(
    breaks: Array, coefficients: Array, degree: int, limits: Limits, to_load: ToLoad | None = None
) -> Proof:
    """Prove that a motion keeps its limits at every moment.

    Parameters
    ----------
    breaks : (spans + 1,) array
        Simple knots of the spline [s].
    coefficients : (spans + degree, d) array
        Coefficients of the spline's d coordinates.
    degree : int
    limits : Limits
    to_load : callable, optional
        Map from the coordinates' series to the load's; by default the coordinates are the load's.

    Returns
    -------
    Proof
    """
    pieces = polynomial_pieces(breaks, coefficients, degree, ORDERS + 1)
    slack: dict[str, float] = {}
    count = 0
    while len(pieces.start):
        count += len(pieces.start)
        with np.errstate(
            invalid="ignore", over="ignore"
        ):  # infinite enclosures give NaN, which proves nothing
            margins = list(_margins(pieces, limits, to_load or (lambda q: q)))
        for name, least, _ in margins:
            if (proven := least >= 0.0).any():
                slack[name] = min(slack.get(name, np.inf), float(least[proven].min()))
        is_refuted = any((certain > 0.0).any() for _, _, certain in margins)
        undecided = np.flatnonzero(~np.all([least >= 0.0 for _, least, _ in margins], axis=0))
        if is_refuted or (len(undecided) and count > MAX_PIECES):
            ends = pieces.start + pieces.length.high
            violations = [
                Violation(name, float(pieces.start[i]), float(ends[i]), float(excess[i]), is_refuted)
                for name, least, certain in margins
                for excess in [certain if is_refuted else -least]
                for i in np.flatnonzero(certain > 0.0 if is_refuted else ~(least >= 0.0))
            ]
            return Proof(count, slack, tuple(violations))
        pieces = pieces.halve(undecided)
    return Proof(count, slack, ())


def _margins(pieces: PolynomialPieces, limits: Limits, to_load: ToLoad) -> Iterator[tuple[str, Array, Array]]:
    """Yield name, least slack on each piece (P,) and certain excess in its middle (P,) of each limit."""
    d = pieces.derivatives[0].low.shape[2]
    whole, middle = (
        motion(
            to_load([Series.from_derivatives([enclose(k, j) for k in range(ORDERS + 1)]) for j in range(d)]),
            limits.gravity,
        )
        for enclose in (pieces.hull, pieces.middle)
    )
    radius = pieces.length.high * 0.5
    for hull, centre in zip(constraints(whole, limits), constraints(middle, limits), strict=True):
        scale = hull.scale
        low, high = hull.low - PROOF_MARGIN * scale, hull.high + PROOF_MARGIN * scale
        enclosed, value = _enclose(hull.series, centre.series, radius), centre.series[0]
        slack = np.minimum(high - enclosed.high, enclosed.low - low) / scale
        yield hull.name, slack, np.maximum(value.low - high, low - value.high) / scale
    for box in limits.obstacles:
        slacks, depths = [], []
        for side in SIDES:
            hulls, centres = (side_distances(part, box, limits.radius, side) for part in (whole, middle))
            enclosures = [_enclose(a, b, radius) for a, b in zip(hulls, centres, strict=True)]
            slacks.append(np.min([enclosure.low for enclosure in enclosures], axis=0))
            depths.append(np.max([-centre[0].high for centre in centres], axis=0))
        yield box.key, np.max(slacks, axis=0) + PROOF_MARGIN, np.min(depths, axis=0) - PROOF_MARGIN


def _enclose(hull: Series, centre: Series, radius: Array) -> Interval:
    """Enclose a constraint on whole pieces by its hull, and by its value in the middle and its rate."""
    whole: Interval = hull[0]
    return whole.intersect(unbound_nan(centre[0] + hull[1] * Interval(-radius, radius)))

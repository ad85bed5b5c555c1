"""Proof that a motion keeps its limits at every moment, between samples too.

On each polynomial piece of the curve every constraint is enclosed twice: from the hulls of the load's
derivatives, and from its value in the middle plus its rate times half the length; both rounded outwards. A
piece is proven if the enclosures' meet is within the limits, refuted if its middle certainly is not, else
halved.

The hulls are those of Bernstein coefficients. Halving derivatives' own coefficients keeps their digits;
differences of halved positions would lose them by h to the power of the order.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.planning.arithmetic import Interval, interval, stacked, whole_for_nan
from cranectl.planning.limits import SIDES, Limits, clear_of, constraints, motion
from cranectl.planning.problem import ORDERS, ToLoad
from cranectl.reference.series import Series, from_derivatives
from cranectl.support.arrays import Array

PROOF_MARGIN = 1e-9  # of a range's end, or in metres: what a plan's check of the workspace lets pass too
MAX_PIECES = 20_000  # tried before it is given up


class PolynomialPieces(NamedTuple):
    """P pieces of a spline of d coordinates in time, on each of which it is one polynomial."""

    start: Array  # (P,) [s]
    length: Interval  # (P,) [s]
    derivatives: tuple[Interval, ...]  # of order k: Bernstein coefficients (P, degree - k + 1, d)

    def hull(self, order: int, coordinate: int) -> Interval:
        """Return what a derivative is within on each piece, (P,)."""
        row = self.derivatives[order][:, :, coordinate]
        return Interval(row.low.min(axis=1), row.high.max(axis=1))

    def middle(self, order: int, coordinate: int) -> Interval:
        """Return a derivative in the middle of each piece, (P,)."""
        row = self.derivatives[order][:, :, coordinate]
        while row.low.shape[1] > 1:
            row = _means(row)
        return row[:, 0]

    def halved(self, chosen: NDArray[np.intp]) -> "PolynomialPieces":
        """Return the chosen pieces as twice as many: first all left halves, then all right ones."""
        start, half = self.start[chosen], self.length[chosen] * 0.5
        both = []
        for derivative in self.derivatives:
            left, right = _halves(derivative[chosen])
            both.append(
                Interval(np.concatenate([left.low, right.low]), np.concatenate([left.high, right.high]))
            )
        lengths = Interval(np.tile(half.low, 2), np.tile(half.high, 2))
        return PolynomialPieces(np.concatenate([start, start + half.low]), lengths, tuple(both))


def polynomial_pieces(breaks: Array, coefficients: Array, degree: int, orders: int) -> PolynomialPieces:
    """Return the spans of a B-spline with knots at `breaks` [s]; coefficients (spans + degree, d)."""
    knots = np.concatenate([np.full(degree, breaks[0]), breaks, np.full(degree, breaks[-1])])
    first = np.arange(len(breaks) - 1)
    begins, ends = knots[degree + first], knots[degree + first + 1]
    rows = [
        _blossom(coefficients, knots, first, [ends] * later + [begins] * (degree - later))
        for later in range(degree + 1)
    ]
    length = interval(ends) - interval(begins)
    derivatives = [stacked(rows, axis=1)]
    for order in range(1, orders):
        last = derivatives[-1]
        if order > degree:
            derivatives.append(last * 0.0)
        else:
            step = last[:, 1:] - last[:, :-1]
            derivatives.append(step * float(degree - order + 1) / length[:, None, None])
    return PolynomialPieces(begins, length, tuple(derivatives))


def _blossom(
    coefficients: Array, knots: Array, first: NDArray[np.intp], arguments: Sequence[Array]
) -> Interval:
    """Return the polar form of all spans by de Boor's recursion, an argument [s] for each degree."""
    degree = len(arguments)
    row = [interval(coefficients[first + k]) for k in range(degree + 1)]
    for level, argument in enumerate(arguments, 1):
        at = interval(argument)
        for k in range(degree, level - 1, -1):
            left, right = interval(knots[first + k]), interval(knots[first + degree + k - level + 1])
            part = (at - left) / (right - left)
            row[k] = row[k - 1] + part[:, None] * (row[k] - row[k - 1])
    return row[degree]


def _means(row: Interval) -> Interval:
    return (row[:, :-1] + row[:, 1:]) * 0.5


def _halves(row: Interval) -> tuple[Interval, Interval]:
    """Divide Bézier polynomials in their middle by de Casteljau's algorithm."""
    left, right = [row[:, 0]], [row[:, -1]]
    while row.low.shape[1] > 1:
        row = _means(row)
        left.append(row[:, 0])
        right.append(row[:, -1])
    return stacked(left, axis=1), stacked(right[::-1], axis=1)


class Violation(NamedTuple):
    """A limit that is certainly broken on a piece, or that could not be decided there."""

    name: str
    start: float  # of the piece [s]
    end: float
    excess: float  # in parts of the limit, or in metres
    certain: bool


class Proof(NamedTuple):
    """The result of a proof."""

    pieces: int
    slack: dict[str, float]  # smallest by constraint, in parts of its limit or in metres, of what is proven
    violations: tuple[Violation, ...]

    @property
    def is_valid(self) -> bool:
        return not self.violations


def prove(
    breaks: Array, coefficients: Array, degree: int, limits: Limits, to_load: ToLoad | None = None
) -> Proof:
    """Prove limits for the spline of coordinates (spans + degree, d) with simple knots at `breaks` [s]."""
    pieces = polynomial_pieces(breaks, coefficients, degree, ORDERS + 1)
    slack: dict[str, float] = {}
    count = 0
    while len(pieces.start):
        count += len(pieces.start)
        with np.errstate(invalid="ignore", over="ignore"):  # of infinite enclosures: NaN proves nothing
            margins = list(_margins(pieces, limits, to_load or (lambda q: q)))
        for name, least, _ in margins:
            if (proven := least >= 0.0).any():
                slack[name] = min(slack.get(name, np.inf), float(least[proven].min()))
        refuted = any((sure > 0.0).any() for _, _, sure in margins)
        undecided = np.flatnonzero(~np.all([least >= 0.0 for _, least, _ in margins], axis=0))
        if refuted or (len(undecided) and count > MAX_PIECES):
            ends = pieces.start + pieces.length.high
            violations = [
                Violation(name, float(pieces.start[i]), float(ends[i]), float(excess[i]), refuted)
                for name, least, sure in margins
                for excess in [sure if refuted else -least]
                for i in np.flatnonzero(sure > 0.0 if refuted else ~(least >= 0.0))
            ]
            return Proof(count, slack, tuple(violations))
        pieces = pieces.halved(undecided)
    return Proof(count, slack, ())


def _margins(pieces: PolynomialPieces, limits: Limits, to_load: ToLoad) -> Iterator[tuple[str, Array, Array]]:
    """Yield of each limit its name, its least slack on each piece, and its sure excess in the middle (P,)."""
    d = pieces.derivatives[0].low.shape[2]
    whole, middle = (
        motion(
            to_load([from_derivatives([of(k, j) for k in range(ORDERS + 1)]) for j in range(d)]),
            limits.gravity,
        )
        for of in (pieces.hull, pieces.middle)
    )
    radius = pieces.length.high * 0.5
    for everywhere, there in zip(constraints(whole, limits), constraints(middle, limits), strict=True):
        scale = everywhere.scale
        low, high = everywhere.low - PROOF_MARGIN * scale, everywhere.high + PROOF_MARGIN * scale
        enclosed, value = _enclosed(everywhere.series, there.series, radius), there.series[0]
        slack = np.minimum(high - enclosed.high, enclosed.low - low) / scale
        yield everywhere.name, slack, np.maximum(value.low - high, low - value.high) / scale
    for box in limits.obstacles:
        beside, inside = [], []
        for side in SIDES:
            distances, centres = (clear_of(motion, box, limits.radius, side) for motion in (whole, middle))
            enclosures = [_enclosed(a, b, radius) for a, b in zip(distances, centres, strict=True)]
            beside.append(np.min([enclosure.low for enclosure in enclosures], axis=0))
            inside.append(np.max([-centre[0].high for centre in centres], axis=0))
        yield box.key, np.max(beside, axis=0) + PROOF_MARGIN, np.min(inside, axis=0) - PROOF_MARGIN


def _enclosed(everywhere: Series, there: Series, radius: Array) -> Interval:
    """Enclose a constraint on whole pieces by its hulls, and by its middle and its rate."""
    whole: Interval = everywhere[0]
    return whole.meet(whole_for_nan(there[0] + everywhere[1] * Interval(-radius, radius)))

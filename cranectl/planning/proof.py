"""Proof that a motion keeps its limits at every moment, between samples too.

On each piece of the curve every limited quantity is enclosed twice: from the hulls of the load's derivatives,
and from its value in the middle plus its rate times half the length; both rounded outwards. A piece is proven
if the enclosures' meet is within the limits, refuted if its middle certainly is not, else halved.
"""

from typing import NamedTuple

import numpy as np

from cranectl.planning.bernstein import Pieces, pieces_of
from cranectl.planning.intervals import Interval
from cranectl.planning.limits import SIDES, Limits, clear_of, motion, quantities
from cranectl.planning.problem import ORDERS, ToLoad
from cranectl.reference.series import Series, from_derivatives
from cranectl.support.arrays import Array

PROOF_MARGIN = 1e-9  # of a range's end, or in metres: what a plan's check of the workspace lets pass too
MOST_PIECES = 20_000  # tried before it is given up
ALL = np.inf


class Broken(NamedTuple):
    """A limit that is certainly broken, or that could not be decided."""

    name: str
    start: float  # of the piece [s]
    end: float
    excess: float  # in parts of the limit, or in metres
    certain: bool


class Proof(NamedTuple):
    """What came of it."""

    pieces: int
    slack: dict[str, float]  # smallest by quantity, in parts of its limit or in metres, of what is proven
    broken: tuple[Broken, ...]

    @property
    def holds(self) -> bool:
        return not self.broken


def prove(
    breaks: Array, coefficients: Array, degree: int, limits: Limits, to_load: ToLoad | None = None
) -> Proof:
    """For the spline of coordinates (spans + degree, d) with simple knots at `breaks` [s]."""
    pieces = pieces_of(breaks, coefficients, degree, ORDERS + 1)
    slack: dict[str, float] = {}
    broken: list[Broken] = []
    count = 0
    while len(pieces.start) and not broken:
        count += len(pieces.start)
        with np.errstate(invalid="ignore", over="ignore"):  # of infinite enclosures: NaN proves nothing
            open_, refuted = _judged(pieces, limits, to_load or (lambda q: q), slack)
        if refuted or (open_ and count > MOST_PIECES):
            broken = _told(pieces, refuted or open_, bool(refuted))
        undecided = sorted({index for found in open_.values() for index in found})
        pieces = pieces.of(np.array(undecided, dtype=np.intp)).halved()
    return Proof(count, slack, tuple(broken))


Found = dict[str, dict[int, float]]  # by quantity: pieces, and by how much they break its limit


def _judged(pieces: Pieces, limits: Limits, to_load: ToLoad, slack: dict[str, float]) -> tuple[Found, Found]:
    """What is undecided and what is refuted; `slack` is brought up to date by what is proven."""
    d = pieces.derivatives[0].low.shape[2]
    whole, middle = (
        motion(
            to_load([from_derivatives([of(k, j) for k in range(ORDERS + 1)]) for j in range(d)]),
            limits.gravity,
        )
        for of in (pieces.hull, pieces.middle)
    )
    radius = pieces.length.high * 0.5
    open_: Found = {}
    refuted: Found = {}
    for everywhere, there in zip(quantities(whole, limits), quantities(middle, limits), strict=True):
        low, high = (
            _widened(everywhere.low, everywhere.scale),
            _widened(everywhere.high, everywhere.scale, 1.0),
        )
        enclosed = _enclosed(everywhere.series, there.series, radius)
        room = np.minimum(high - enclosed.high, enclosed.low - low) / everywhere.scale
        sure = np.maximum(there.series[0].low - high, low - there.series[0].high) / everywhere.scale
        _sort(everywhere.name, room, sure, (open_, refuted), slack)
    for box in limits.obstacles:
        rooms, sures = [], []
        for side in SIDES:
            pairs = [
                (_enclosed(a, b, radius).low, b[0].high)
                for a, b in zip(
                    clear_of(whole, box, limits.radius, side),
                    clear_of(middle, box, limits.radius, side),
                    strict=True,
                )
            ]
            rooms.append(np.min([pair[0] for pair in pairs], axis=0))
            sures.append(np.max([-pair[1] for pair in pairs], axis=0))
        beside, inside = np.max(rooms, axis=0), np.min(sures, axis=0)
        _sort(box.key, beside + PROOF_MARGIN, inside - PROOF_MARGIN, (open_, refuted), slack)
    return open_, refuted


def _enclosed(everywhere: Series, there: Series, radius: Array) -> Interval:
    """A quantity on whole pieces: by its hulls, and by its middle and its rate."""
    step = Interval(-radius, radius)
    mean: Interval = there[0] + everywhere[1] * step
    whole: Interval = everywhere[0]
    return whole.meet(
        Interval(np.where(np.isnan(mean.low), -ALL, mean.low), np.where(np.isnan(mean.high), ALL, mean.high))
    )


def _sort(name: str, room: Array, sure: Array, found: tuple[Found, Found], slack: dict[str, float]) -> None:
    """Add to what is undecided and what is refuted, and bring `slack` up to date by what is proven."""
    open_, refuted = found
    proven = room >= 0.0
    if proven.any():
        slack[name] = min(slack.get(name, ALL), float(room[proven].min()))
    if not proven.all():
        open_[name] = {int(i): float(-room[i]) for i in np.flatnonzero(~proven)}
    if (sure > 0.0).any():
        refuted[name] = {int(i): float(sure[i]) for i in np.flatnonzero(sure > 0.0)}


def _widened(bound: float, scale: float, sign: float = -1.0) -> float:
    return bound + sign * PROOF_MARGIN * scale


def _told(pieces: Pieces, found: Found, certain: bool) -> list[Broken]:
    ends = pieces.start + pieces.length.high
    return [
        Broken(name, float(pieces.start[i]), float(ends[i]), excess, certain)
        for name, by_piece in found.items()
        for i, excess in by_piece.items()
    ]

"""Blends of the corners between lines and arcs.

A blend takes as much, h [m], of both neighbours of a corner, at most half of each, and is one polynomial of
degree 11 over 2 h that meets them in position and five derivatives by length. So it is C⁵, and what drives
feel, the fifth derivative of the load's motion, is continuous. At equal lengths path and blend are at most
`blend` apart, by enclosures: no point of the one is further than that from the other.
"""

from collections.abc import Sequence
from math import factorial
from typing import TypeAlias

import numpy as np
from scipy.interpolate import BPoly

from cranectl.reference.planning.geometry import (
    Chain,
    Circular,
    Piece,
    Polynomial,
    Straight,
    place,
    polynomial,
)
from cranectl.reference.planning.intervals import Interval
from cranectl.reference.planning.series import Number, Series
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

Part: TypeAlias = Straight | Circular
MET = 6  # position and derivatives in which a blend meets its neighbours
STRETCHES = 128  # of half a blend, on each of which its distance is enclosed
PRECISION = 1e-3  # of what a blend takes
SPARE = 0.99  # of a tolerance, for what enclosures add
ROUNDING = 1e-12  # of squares, their sum and its root
STRAIGHT_BACK = np.deg2rad(170.0)  # a turn from which on a corner cannot be blended


def blended(parts: Sequence[Part], taken: Sequence[float]) -> Chain:
    """The path with blends that take so much [m] of both parts at each corner."""
    pieces: list[Piece] = []
    for k, (part, before, after) in enumerate(zip(parts, (0.0, *taken), (*taken, 0.0), strict=True)):
        if before + after > part.length * (1.0 + PRECISION**2):
            raise InputError(
                f"blends take {before + after:g} m of part {k + 1} of a path, which has {part.length:g} m",
                allowed="blends that take no more than there is",
                remedy="give lines and arcs with blend, or correct taken",
            )
        begin, end = before / part.length, 1.0 - after / part.length
        if end > begin:
            pieces.append(part.part(begin, end))
        if after:
            pieces.append(blend(part, parts[k + 1], after))
    return Chain(tuple(pieces))


def blend(before: Part, after: Part, taken: float) -> Polynomial:
    """From `taken` [m] before the end of one to as much after the start of the other."""
    ends = [_derivatives(before, 1.0 - taken / before.length), _derivatives(after, taken / after.length)]
    width, corner = 2.0 * taken, place(after, 0.0)
    for end in ends:
        end *= width ** np.arange(MET)[:, None]
        end[0] -= corner  # small numbers: their differences keep their digits
    found = polynomial(BPoly.from_derivatives([0.0, 1.0], ends), 0.0, 1.0, width)
    found.coefficients[0] += corner
    return found


def _derivatives(part: Part, s: float) -> Array:
    """Position and derivatives by length, (MET, 3)."""
    along = [np.array([value]) for value in (s, 1.0 / part.length, *[0.0] * (MET - 2))]
    return np.array([[float(c[0]) * factorial(k) for k, c in enumerate(axis)] for axis in part([along])]).T


def deviation(before: Part, after: Part, taken: float) -> float:
    """What blend and path are apart at equal lengths [m], at most: by enclosures."""
    return _apart(before, after, taken, proven=True)


def _apart(before: Part, after: Part, taken: float, *, proven: bool) -> float:
    """The same, or at samples."""
    bend = blend(before, after, taken)
    edges = np.linspace(0.0, 0.5, STRETCHES + 1)
    middle, reach = 0.5 * (edges[:-1] + edges[1:]), Interval(-edges[1:2], edges[1:2]) * 0.51
    found = 0.0
    for part, begin, offset in ((before, 0.0, 1.0 - taken / before.length), (after, 0.5, 0.0)):
        scale = 2.0 * taken / part.length

        def between(u: Number, one: Number) -> list[Series]:
            along = [(u - begin) * scale + offset, one * scale]  # noqa: B023
            both = zip(bend([[u, one]]), part([along]), strict=True)  # noqa: B023
            return [[a - b for a, b in zip(x, y, strict=True)] for x, y in both]

        at, one = middle + begin, np.ones(STRETCHES)
        if not proven:
            squares = sum(axis[0] ** 2 for axis in between(at, one))
        else:
            there, ones = Interval(at, at), Interval(one, one)
            whole = between(there + reach, ones)
            values = [a[0] + b[1] * reach for a, b in zip(between(there, ones), whole, strict=True)]
            squares = sum(np.maximum(np.abs(each.low), np.abs(each.high)) ** 2 for each in values)
        found = max(found, float(np.sqrt(squares.max())))
    return found * (1.0 + ROUNDING)


def check_corner(before: Part, after: Part, where: str) -> None:
    """Raise InputError for a corner that leads back the way that it came."""
    ways = [_derivatives(before, 1.0)[1], _derivatives(after, 0.0)[1]]
    turn = float(np.arctan2(np.linalg.norm(np.cross(*ways)), np.dot(*ways)))
    if turn > STRAIGHT_BACK:
        raise InputError(
            f"{where} turns back by {np.rad2deg(turn):.4g} degrees, and is to be blended",
            allowed=f"turns of up to {np.rad2deg(STRAIGHT_BACK):.0f} degrees",
            remedy="leave blend out there, so that the load stops, or move the corner",
        )


def longest(before: Part, after: Part, tolerance: float) -> float:
    """What a blend may take of both parts [m]: what samples allow, then so much less that enclosures do."""
    low, high = 0.0, 0.5 * min(before.length, after.length)
    if _apart(before, after, high, proven=False) < SPARE * tolerance:
        low = high
    while high - low > PRECISION * high:
        middle = 0.5 * (low + high)
        near = _apart(before, after, middle, proven=False) < SPARE * tolerance
        low, high = (middle, high) if near else (low, middle)
    while deviation(before, after, low) > tolerance:
        low *= SPARE
    return low

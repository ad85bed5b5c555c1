"""Choose how much of its neighbours the blend of a corner takes, `reference.geometry`.

At equal lengths path and blend are at most `blend` apart, by enclosures: no point of the one is further than
that from the other.
"""

from collections.abc import Sequence

import numpy as np

from cranectl.planning.arithmetic import Interval
from cranectl.reference.geometry import LineOrArc, blend, derivatives_at, parts_of
from cranectl.reference.series import Number, Series
from cranectl.scenario import Segment
from cranectl.scenario.along_path import MINIMUM_TIME, Arc, BlendedPath, Line
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

STRETCHES = 128  # of half a blend, on each of which its distance is enclosed
PRECISION = 1e-3  # of what a blend takes
SPARE = 0.99  # of a tolerance, for what enclosures add
SQUARES_ROUNDING = 1e-12  # of squares, their sum and its root
STRAIGHT_BACK = np.deg2rad(170.0)  # a turn from which on a corner cannot be blended


def deviation(before: LineOrArc, after: LineOrArc, taken: float, *, enclosed: bool = True) -> float:
    """Return how far blend and path are apart at equal lengths [m]: a bound by enclosures, or at samples."""
    smooth = blend(before, after, taken)
    edges = np.linspace(0.0, 0.5, STRETCHES + 1)
    middle, reach = 0.5 * (edges[:-1] + edges[1:]), Interval(-edges[1:2], edges[1:2]) * 0.51
    largest = 0.0
    for part, begin, offset in ((before, 0.0, 1.0 - taken / before.length), (after, 0.5, 0.0)):
        scale = 2.0 * taken / part.length

        def between(u: Number, one: Number) -> list[Series]:
            along = [(u - begin) * scale + offset, one * scale]  # noqa: B023
            both = zip(smooth([[u, one]]), part([along]), strict=True)  # noqa: B023
            return [[a - b for a, b in zip(x, y, strict=True)] for x, y in both]

        at, one = middle + begin, np.ones(STRETCHES)
        if enclosed:
            there, ones = Interval(at, at), Interval(one, one)
            whole = between(there + reach, ones)
            values = [a[0] + b[1] * reach for a, b in zip(between(there, ones), whole, strict=True)]
            squares = sum(np.maximum(np.abs(value.low), np.abs(value.high)) ** 2 for value in values)
        else:
            squares = sum(axis[0] ** 2 for axis in between(at, one))
        largest = max(largest, float(np.sqrt(squares.max())))
    return largest * (1.0 + SQUARES_ROUNDING)


def check_corner(before: LineOrArc, after: LineOrArc, where: str) -> None:
    """Raise InputError for a corner that leads back the way that it came."""
    directions = derivatives_at(before, 1.0)[1], derivatives_at(after, 0.0)[1]
    turn = float(np.arctan2(np.linalg.norm(np.cross(*directions)), np.dot(*directions)))
    if turn > STRAIGHT_BACK:
        raise InputError(
            f"{where} turns back by {np.rad2deg(turn):.4g} degrees, and is to be blended",
            allowed=f"turns of up to {np.rad2deg(STRAIGHT_BACK):.0f} degrees",
            remedy="leave blend out there, so that the load stops, or move the corner",
        )


def longest(before: LineOrArc, after: LineOrArc, tolerance: float) -> float:
    """Return what a blend may take of both parts [m]: as samples allow, then less until enclosures do."""

    def is_near(taken: float) -> bool:
        return deviation(before, after, taken, enclosed=False) < SPARE * tolerance

    low, high = 0.0, 0.5 * min(before.length, after.length)
    if is_near(high):
        low = high
    while high - low > PRECISION * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_near(middle) else (low, middle)
    while deviation(before, after, low) > tolerance:
        low *= SPARE
    return low


def check_follower(segment: Segment | None, where: str) -> None:
    """Raise InputError where a blend cannot lead over to what follows it."""
    if isinstance(segment, Line | Arc) and segment.time_law == MINIMUM_TIME:
        return
    timed = " whose time is given" if isinstance(segment, Line | Arc) else ""
    what = "nothing" if segment is None else f"a segment of kind '{segment.kind}'{timed}"
    raise InputError(
        f"{where} has a blend, and what follows is {what}",
        allowed="a blend before a line or an arc with time_law = 'minimum-time'",
        remedy="leave blend out there, so that the load stops",
    )


def path_with_blends(segments: Sequence[Line | Arc], start: Array, where: str) -> BlendedPath:
    """Join segments by blends that are as long as their tolerances allow; raises InputError."""
    parts = parts_of(segments, start, where)
    taken = []
    for index, (before, after, segment) in enumerate(zip(parts, parts[1:], segments, strict=False)):
        check_corner(before, after, f"{where}: corner {index + 1}")
        taken.append(longest(before, after, segment.blend))
    return BlendedPath(kind="path", parts=tuple(segments), taken=tuple(taken), time_law=MINIMUM_TIME)

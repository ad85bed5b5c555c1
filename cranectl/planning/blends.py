"""Choose the length of the blend at each corner (`reference.geometry`).

Enclosures prove that path and blend are at most `blend` apart at equal lengths.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cranectl.planning.arithmetic import Interval
from cranectl.reference import Geometry, Series
from cranectl.scenario import Arc, BlendedPath, Line, Segment
from cranectl.support import Array, InputError

HALF_BLEND_PIECES = 128  # on each of which the distance of half a blend is enclosed
LENGTH_PRECISION = 1e-3  # relative, of a blend's length
ENCLOSURE_RESERVE = 0.99  # of a tolerance that samples may use, since enclosures are larger
SQUARES_ROUNDING = 1e-12  # of squares, their sum and its root
MAX_TURN = np.deg2rad(170.0)  # of a corner that can be blended


def deviation(before: Geometry, after: Geometry, length: float, *, enclosed: bool = True) -> float:
    """Return the largest distance of blend and path at equal lengths [m]: a proven bound, or at samples."""
    smooth = before.blend_into(after, length)
    edges = np.linspace(0.0, 0.5, HALF_BLEND_PIECES + 1)
    # Half a piece and more than rounding to each side of its middle.
    middle, width = 0.5 * (edges[:-1] + edges[1:]), Interval(-edges[1:2], edges[1:2]) * 0.51
    largest = 0.0
    for part, begin, offset in ((before, 0.0, 1.0 - length / before.length), (after, 0.5, 0.0)):
        scale = 2.0 * length / part.length

        def difference(u: Any, one: Any) -> list[Series]:
            along = Series([(u - begin) * scale + offset, one * scale])  # noqa: B023
            both = zip(smooth([Series([u, one])]), part([along]), strict=True)  # noqa: B023
            return [x - y for x, y in both]

        centre, one = middle + begin, np.ones(HALF_BLEND_PIECES)
        if enclosed:
            centres, ones = Interval(centre, centre), Interval(one, one)
            whole = difference(centres + width, ones)
            # Mean-value form: value in the middle, plus the rate on the whole piece times the way.
            values = [a[0] + b[1] * width for a, b in zip(difference(centres, ones), whole, strict=True)]
            squares = sum(np.maximum(np.abs(value.low), np.abs(value.high)) ** 2 for value in values)
        else:
            squares = sum(axis[0] ** 2 for axis in difference(centre, one))
        largest = max(largest, float(np.sqrt(squares.max())))
    return largest * (1.0 + SQUARES_ROUNDING)


def check_corner(before: Geometry, after: Geometry, where: str) -> None:
    """Raise InputError for a corner at which the path turns back."""
    directions = before.derivatives(1.0)[1], after.derivatives(0.0)[1]
    turn = float(np.arctan2(np.linalg.norm(np.cross(*directions)), np.dot(*directions)))
    if turn > MAX_TURN:
        raise InputError(
            f"{where} turns back by {np.rad2deg(turn):.4g} degrees and cannot be blended",
            allowed=f"turns of up to {np.rad2deg(MAX_TURN):.0f} degrees",
            remedy="leave blend out there, so that the load stops, or move the corner",
        )


def choose_blend_length(before: Geometry, after: Geometry, tolerance: float) -> float:
    """Return the longest blend [m] within `tolerance` [m]: from samples, then reduced until it is proven."""

    def is_near(length: float) -> bool:
        return deviation(before, after, length, enclosed=False) < ENCLOSURE_RESERVE * tolerance

    low, high = 0.0, 0.5 * min(before.length, after.length)
    if is_near(high):
        low = high
    while high - low > LENGTH_PRECISION * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_near(middle) else (low, middle)
    while deviation(before, after, low) > tolerance:
        low *= ENCLOSURE_RESERVE
    return low


def check_follower(segment: Segment | None, where: str) -> None:
    """Raise InputError where the segment after a blend cannot be joined to it."""
    if isinstance(segment, Line | Arc) and segment.is_in_minimum_time:
        return
    timing = " whose time is given" if isinstance(segment, Line | Arc) else ""
    follower = "nothing" if segment is None else f"a segment of kind '{segment.kind}'{timing}"
    raise InputError(
        f"{where} has a blend, but {follower} follows",
        allowed="a blend before a line or an arc with time_law = 'minimum-time'",
        remedy="leave blend out there, so that the load stops",
    )


def path_with_blends(segments: Sequence[Line | Arc], start: Array, where: str) -> BlendedPath:
    """Join segments by blends as long as their tolerances allow; raise InputError for impossible corners."""
    parts = Geometry.parts_of(segments, start, where)
    lengths = []
    for index, (before, after, segment) in enumerate(zip(parts, parts[1:], segments, strict=False)):
        check_corner(before, after, f"{where}: corner {index + 1}")
        lengths.append(choose_blend_length(before, after, segment.blend))
    return BlendedPath(kind="path", parts=tuple(segments), taken=tuple(lengths), time_law="minimum-time")

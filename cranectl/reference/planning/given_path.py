"""The path of a segment that has one: a line, an arc, both joined by blends, a spline."""

import itertools
from collections.abc import Sequence

import numpy as np

from cranectl.reference.planning.blends import Part, blended, check_corner, longest
from cranectl.reference.planning.geometry import Chain, Circular, Geometry, Straight, place, polynomial
from cranectl.reference.time_laws import spline
from cranectl.scenario import Segment
from cranectl.scenario.along_path import MINIMUM_TIME, Along, Arc, BlendedPath, Line
from cranectl.scenario.segments import Spline
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

POINTS = 20  # of each span of a spline, between which its length is measured


def geometry_of(segment: Along | Spline, start: Array, where: str = "segment") -> Geometry:
    """That of a segment that begins at `start` (3,) [m]; raises InputError where it has no length."""
    if isinstance(segment, Line | Arc):
        return _part(segment, start, where)
    return chain_of(segment, start, where)


def chain_of(segment: BlendedPath | Spline, start: Array, where: str = "segment") -> Chain:
    """The same."""
    if isinstance(segment, BlendedPath):
        return blended(parts_of(segment.parts, start, where), segment.taken)
    return _spline_path(segment)


def check_moves(segment: Line | Arc, start: Array, where: str) -> None:
    """Raise InputError for a segment of no length."""
    if isinstance(segment, Line):
        what = "a line to where the load already is" if np.array_equal(start, segment.to) else ""
    else:
        still = segment.angle == 0.0 or np.array_equal(start[:2], segment.centre)
        what = "an arc of no angle or no radius" if still else ""
    if what:
        raise InputError(
            f"{where} has zero length: {what}",
            allowed="segments that move the load",
            remedy='to stay in place use kind = "hold"',
        )


def _spline_path(segment: Spline) -> Chain:
    """Equal stretches of its parameter are equal ones of s."""
    breaks = np.array(segment.breaks)
    curve = spline(breaks, np.array(segment.coefficients), segment.degree)
    points = curve(np.linspace(0.0, breaks[-1], POINTS * len(breaks)))
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return Chain(
        tuple(
            polynomial(curve, a, b, length * (b - a) / segment.breaks[-1])
            for a, b in itertools.pairwise(segment.breaks)
        )
    )


def parts_of(segments: Sequence[Line | Arc], start: Array, where: str = "segment") -> list[Part]:
    """Their paths, one after the other; raises InputError where one has no length."""
    found: list[Part] = []
    for index, segment in enumerate(segments):
        found.append(_part(segment, start, f"{where}, part {index + 1},"))
        start = place(found[-1], 1.0) if isinstance(segment, Arc) else np.array(segment.to)
    return found


def _part(segment: Line | Arc, start: Array, where: str) -> Part:
    check_moves(segment, start, where)
    if isinstance(segment, Line):
        return Straight(start, np.array(segment.to))
    return Circular(start, np.array(segment.centre), segment.angle)


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
    """Segments joined by blends that are as long as their tolerances allow; raises InputError."""
    parts = parts_of(segments, start, where)
    taken = []
    for index, (before, after, segment) in enumerate(zip(parts, parts[1:], segments, strict=False)):
        check_corner(before, after, f"{where}: corner {index + 1}")
        taken.append(longest(before, after, segment.blend))
    return BlendedPath(kind="path", parts=tuple(segments), taken=tuple(taken), time_law=MINIMUM_TIME)

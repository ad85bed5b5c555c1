"""The path of a segment that has one: a line, an arc, both joined by blends, a spline.

A blend takes as much, h [m], of both neighbours of a corner, at most half of each, and is one polynomial of
degree 11 over 2 h that meets them in position and five derivatives by length. So it is C⁵, and what drives
feel, the fifth derivative of the load's motion, is continuous.
"""

import itertools
from collections.abc import Sequence
from math import factorial
from typing import TypeAlias

import numpy as np
from scipy.interpolate import BPoly

from cranectl.reference.geometry import (
    Chain,
    Circular,
    Geometry,
    Piece,
    Polynomial,
    Straight,
    place,
    polynomial,
)
from cranectl.reference.time_laws import spline
from cranectl.scenario.along_path import Along, Arc, BlendedPath, Line
from cranectl.scenario.segments import Spline
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

Part: TypeAlias = Straight | Circular
MET = 6  # position and derivatives in which a blend meets its neighbours
MAX_OVERLAP = 1e-6  # of a part's length, by which its blends may take more than there is
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


def blended(parts: Sequence[Part], taken: Sequence[float]) -> Chain:
    """The path with blends that take so much [m] of both parts at each corner."""
    pieces: list[Piece] = []
    for k, (part, before, after) in enumerate(zip(parts, (0.0, *taken), (*taken, 0.0), strict=True)):
        if before + after > part.length * (1.0 + MAX_OVERLAP):
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
    ends = [derivatives_at(before, 1.0 - taken / before.length), derivatives_at(after, taken / after.length)]
    width, corner = 2.0 * taken, place(after, 0.0)
    for end in ends:
        end *= width ** np.arange(MET)[:, None]
        end[0] -= corner  # small numbers: their differences keep their digits
    found = polynomial(BPoly.from_derivatives([0.0, 1.0], ends), 0.0, 1.0, width)
    found.coefficients[0] += corner
    return found


def derivatives_at(part: Part, s: float) -> Array:
    """Return position and derivatives by length at s, (MET, 3)."""
    along = [np.array([value]) for value in (s, 1.0 / part.length, *[0.0] * (MET - 2))]
    return np.array([[float(c[0]) * factorial(k) for k, c in enumerate(axis)] for axis in part([along])]).T

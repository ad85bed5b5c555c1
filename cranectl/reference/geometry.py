"""Paths, as places of the load by how far along them it is, s from 0 to 1, over any kind of number.

A path is a line, an arc, both joined by blends, or a spline. A blend takes as much, h [m], of both neighbours
of a corner, at most half of each, and is one polynomial of degree 11 over 2 h that meets them in position and
five derivatives by length. So it is C⁵, and what drives feel, the fifth derivative of the load's motion, is
continuous.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch
from math import factorial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly, BSpline

from cranectl.reference.series import Number, Series, from_derivatives, shifted, times, turned
from cranectl.reference.time_laws import Law, progress, spline
from cranectl.scenario.along_path import Along, Arc, BlendedPath, Line, check_moves
from cranectl.scenario.segments import Spline
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

MET = 6  # position and derivatives in which a blend meets its neighbours
MAX_OVERLAP = 1e-6  # of a part's length, by which its blends may take more than there is
POINTS_A_SPAN = 20  # of a spline, between which its length is measured


@dataclass(frozen=True)
class Straight:
    """From one point to another."""

    start: Array
    end: Array

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the load's motion from that of s."""
        (progress,) = coordinates
        ways = zip((self.end - self.start).tolist(), self.start.tolist(), strict=True)
        return [shifted([c * way for c in progress], at) for way, at in ways]

    @property
    def length(self) -> float:
        """Return the length [m]."""
        return float(np.linalg.norm(self.end - self.start))

    def part(self, begin: float, end: float) -> "Straight":
        """Return the same from one s to another."""
        way = self.end - self.start
        return Straight(self.start + begin * way, self.end - (1.0 - end) * way)


@dataclass(frozen=True)
class Circular:
    """A horizontal arc from `start` about `centre` (x, y) through `angle` [rad]."""

    start: Array
    centre: Array
    angle: float

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the load's motion from that of s."""
        (progress,) = coordinates
        x, y = (self.start[:2] - self.centre).tolist()
        cosine, sine = turned([c * self.angle for c in progress])
        east = [c * x - s * y for c, s in zip(cosine, sine, strict=True)]
        north = [c * y + s * x for c, s in zip(cosine, sine, strict=True)]
        level = [c * 0.0 for c in progress]
        places = *self.centre.tolist(), float(self.start[2])
        return [shifted(coordinate, at) for coordinate, at in zip((east, north, level), places, strict=True)]

    @property
    def length(self) -> float:
        """Return the length [m]."""
        return float(np.linalg.norm(self.start[:2] - self.centre)) * abs(self.angle)

    def part(self, begin: float, end: float) -> "Circular":
        """Return the same from one s to another."""
        return Circular(place(self, begin), self.centre, (end - begin) * self.angle)


@dataclass(frozen=True)
class Polynomial:
    """By powers of s less one half."""

    coefficients: Array  # (degree + 1, 3) [m]
    length: float  # [m], about

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the load's motion from that of s."""
        (progress,) = coordinates
        rate = progress[1:]
        powers = [rate]
        while len(powers) < len(rate):
            powers.append(times(powers[-1], rate))
        load = []
        for outer in expand_about(progress[0], self.coefficients, len(progress)):
            series = [outer[0]]
            for order in range(1, len(progress)):
                value = outer[1] * powers[0][order - 1]
                for k in range(2, order + 1):
                    value = value + outer[k] * powers[k - 1][order - k]
                series.append(value)
            load.append(series)
        return load


# What depends on the kind of number: these three functions serve arrays, and modules of other kinds register
# their own.


@singledispatch
def expand_about(s: Number, coefficients: Array, count: int) -> list[Series]:
    """Return the first coefficients of x, y, z in powers of a distance from s, of powers of s - 1/2.

    Zeros beyond the polynomial's degree.
    """
    coefficients_about = padded(shifted_powers(list(coefficients), s[:, None] - 0.5), count)
    return [[coefficient[:, axis] for coefficient in coefficients_about] for axis in range(3)]


@singledispatch
def select_between(s: Number, low: float, high: float) -> tuple[NDArray[np.intp], Number]:
    """Return the points at which s may be on a segment from `low` to `high`, and s at these."""
    where = np.flatnonzero((s >= low) & (s < high))
    return where, s[where]


@singledispatch
def gathered(like: Number, parts: list[tuple[NDArray[np.intp], Number]]) -> Number:
    """Return the numbers of all points, as many as in `like`, from those of each segment."""
    value = np.empty_like(like)
    for where, part in parts:
        value[where] = part
    return value


def padded(series: Series, count: int) -> Series:
    """Return the first coefficients of a series, with zeros where it has fewer."""
    return series[:count] + [series[0] * 0.0] * (count - len(series))


def shifted_powers(coefficients: Sequence[Array | float], at: Number) -> Series:
    """Return the coefficients of a polynomial in powers of x as one in powers of x - at: Horner's scheme."""
    shifted_series: Series = [at * 0.0 + coefficient for coefficient in coefficients]
    for first in range(len(shifted_series) - 1):
        for k in range(len(shifted_series) - 2, first - 1, -1):
            shifted_series[k] = shifted_series[k] + at * shifted_series[k + 1]
    return shifted_series


def polynomial(curve: BPoly | BSpline, begin: float, end: float, length: float) -> Polynomial:
    """Return what `curve` (3,) is from `begin` to `end`, between which it is one polynomial."""
    degree = curve.k if isinstance(curve, BSpline) else len(curve.c) - 1
    middle, width = 0.5 * (begin + end), end - begin
    rows = [
        (curve.derivative(k) if k else curve)(middle) * width**k / factorial(k) for k in range(degree + 1)
    ]
    return Polynomial(np.array(rows), length)


LineOrArc: TypeAlias = Straight | Circular
PathSegment = Straight | Circular | Polynomial


@dataclass(frozen=True)
class Chain:
    """Path segments one after the other, each with the share of s that it has of the length."""

    segments: tuple[PathSegment, ...]

    @property
    def length(self) -> float:
        """Return the length [m]."""
        return sum(segment.length for segment in self.segments)

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the load's motion from that of s; of an interval all that segments in it make of it."""
        (progress,) = coordinates
        first = progress[0]
        edges = np.concatenate(
            [[0.0], np.cumsum([segment.length for segment in self.segments]) / self.length]
        )
        low, high = [-np.inf, *edges[1:-1].tolist()], [*edges[1:-1].tolist(), np.inf]
        parts: list[tuple[Any, list[Series]]] = []
        for k, (begin, end) in enumerate(itertools.pairwise(edges.tolist())):
            where, own = select_between(first, low[k], high[k])
            if len(where):
                inside = [own, *(c[where] for c in progress[1:])]
                scale = 1.0 / (end - begin)
                parts.append((where, self.segments[k]([[c * scale for c in shifted(inside, -begin)]])))
        return [
            [
                gathered(first, [(where, load[axis][order]) for where, load in parts])
                for order in range(len(progress))
            ]
            for axis in range(3)
        ]


Geometry = Straight | Circular | Chain


@dataclass(frozen=True)
class GeometricPath:
    """Along a path by a time law."""

    geometry: Geometry
    duration: float
    time_law: Law

    def sample(self, time: Array) -> Array:
        load = self.geometry([from_derivatives(list(progress(self.time_law, time, self.duration)))])
        return np.array([[c * factorial(k) for k, c in enumerate(axis)] for axis in load]).transpose(2, 1, 0)


def place(geometry: Geometry | Polynomial, s: float) -> Array:
    """Return where the load is at s, (3,) [m]."""
    return np.array([float(series[0][0]) for series in geometry([[np.array([s])]])])


def geometry_of(segment: Along | Spline, start: Array, where: str = "segment") -> Geometry:
    """Return the path of a segment that begins at `start` (3,) [m]; raises InputError if it has no length."""
    if isinstance(segment, BlendedPath):
        return blended(parts_of(segment.parts, start, where), segment.taken)
    if isinstance(segment, Line | Arc):
        check_moves(segment, start, where)
    if isinstance(segment, Line):
        return Straight(start, np.array(segment.to))
    if isinstance(segment, Arc):
        return Circular(start, np.array(segment.centre), segment.angle)
    # Equal stretches of a spline's parameter are equal ones of s.
    breaks = np.array(segment.breaks)
    curve = spline(breaks, np.array(segment.coefficients), segment.degree)
    points = curve(np.linspace(0.0, breaks[-1], POINTS_A_SPAN * len(breaks)))
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    spans = itertools.pairwise(segment.breaks)
    return Chain(tuple(polynomial(curve, a, b, length * (b - a) / segment.breaks[-1]) for a, b in spans))


def parts_of(segments: Sequence[Line | Arc], start: Array, where: str = "segment") -> list[LineOrArc]:
    """Return their paths, one after the other; raises InputError where one has no length."""
    parts: list[LineOrArc] = []
    for index, segment in enumerate(segments):
        part = geometry_of(segment, start, f"{where}, part {index + 1},")
        assert isinstance(part, LineOrArc)
        parts.append(part)
        start = place(part, 1.0) if isinstance(segment, Arc) else np.array(segment.to)
    return parts


def blended(parts: Sequence[LineOrArc], taken: Sequence[float]) -> Chain:
    """Return the path with blends that take so much [m] of both parts at each corner."""
    segments: list[PathSegment] = []
    for k, (part, before, after) in enumerate(zip(parts, (0.0, *taken), (*taken, 0.0), strict=True)):
        if before + after > part.length * (1.0 + MAX_OVERLAP):
            raise InputError(
                f"blends take {before + after:g} m of part {k + 1} of a path, which has {part.length:g} m",
                allowed="blends that take no more than there is",
                remedy="give lines and arcs with blend, or correct taken",
            )
        begin, end = before / part.length, 1.0 - after / part.length
        if end > begin:
            segments.append(part.part(begin, end))
        if after:
            segments.append(blend(part, parts[k + 1], after))
    return Chain(tuple(segments))


def blend(before: LineOrArc, after: LineOrArc, taken: float) -> Polynomial:
    """Lead from `taken` [m] before the end of one to as much after the start of the other."""
    ends = [derivatives_at(before, 1.0 - taken / before.length), derivatives_at(after, taken / after.length)]
    width, corner = 2.0 * taken, place(after, 0.0)
    for end in ends:
        end *= width ** np.arange(MET)[:, None]
        end[0] -= corner  # small numbers: their differences keep their digits
    curve = polynomial(BPoly.from_derivatives([0.0, 1.0], ends), 0.0, 1.0, width)
    curve.coefficients[0] += corner
    return curve


def derivatives_at(part: LineOrArc, s: float) -> Array:
    """Return position and derivatives by length at s, (MET, 3)."""
    along = [np.array([value]) for value in (s, 1.0 / part.length, *[0.0] * (MET - 2))]
    return np.array([[float(c[0]) * factorial(k) for k, c in enumerate(axis)] for axis in part([along])]).T

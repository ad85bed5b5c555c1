"""Paths: the position of the load by the path coordinate s from 0 to 1, over any kind of number.

A path is a line, an arc, lines and arcs joined by blends, or a spline. A blend replaces the last h [m] before
a corner and the first h after it, at most half of each part. It is one polynomial of degree 11 over 2 h that
matches its neighbours in position and five derivatives with respect to length. So the path is C⁵, and the
fifth derivative of the load's motion, which acts on the drives, is continuous.
"""

import itertools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly, BSpline

from cranectl.reference.series import Number, Series
from cranectl.reference.time_laws import TimeLaw, spline
from cranectl.scenario import Along, Arc, BlendedPath, Line, Spline
from cranectl.support import Array, InputError

MATCHED_ORDERS = 6  # position and five derivatives, in which a blend matches its neighbours
MAX_OVERLAP = 1e-6  # of a part's length, by which its two blends may overlap
POINTS_PER_SPAN = 20  # of a spline, between which its length is measured


class Geometry(ABC):
    """The path of a load by the path coordinate s from 0 to 1."""

    @property
    @abstractmethod
    def length(self) -> float:
        """Length [m]."""

    @abstractmethod
    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the series of x, y, z from the series of s."""

    @staticmethod
    def straight(start: Array, end: Array) -> "Straight":
        """Return the straight line from `start` to `end` (3,) [m]."""
        return Straight(start, end)

    @staticmethod
    def of(segment: Along | Spline, start: Array, where: str = "segment") -> "Geometry":
        """Return the path of a segment that begins at `start` (3,) [m]; raise InputError for zero length."""
        if isinstance(segment, Line | Arc):
            return _line_or_arc(segment, start, where)
        if isinstance(segment, BlendedPath):
            return blend_corners(Geometry.parts_of(segment.parts, start, where), segment.taken)
        # s is proportional to the spline's parameter.
        breaks = np.array(segment.breaks)
        curve = spline(breaks, np.array(segment.coefficients), segment.degree)
        points = curve(np.linspace(0.0, breaks[-1], POINTS_PER_SPAN * len(breaks)))
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        spans = itertools.pairwise(segment.breaks)
        pieces = (extract_polynomial(curve, a, b, length * (b - a) / segment.breaks[-1]) for a, b in spans)
        return Chain(tuple(pieces))

    @staticmethod
    def parts_of(
        segments: Sequence[Line | Arc], start: Array, where: str = "segment"
    ) -> "list[Straight | Circular]":
        """Return the paths of consecutive lines and arcs from `start`; raise InputError for zero length."""
        parts: list[Straight | Circular] = []
        for index, segment in enumerate(segments):
            part = _line_or_arc(segment, start, f"{where}, part {index + 1},")
            parts.append(part)
            start = part.position(1.0) if isinstance(segment, Arc) else np.array(segment.to)
        return parts

    def position(self, s: float) -> Array:
        """Return the position of the load at s, (3,) [m]."""
        return np.array([float(series[0][0]) for series in self([Series([np.array([s])])])])

    def derivatives(self, s: float) -> Array:
        """Return position and derivatives with respect to length at s, (MATCHED_ORDERS, 3)."""
        along = Series([np.array([s]), np.array([1.0 / self.length])]).padded(MATCHED_ORDERS)
        return np.array(
            [[float(c[0]) * factorial(k) for k, c in enumerate(axis)] for axis in self([along])]
        ).T

    def blend_into(self, after: "Geometry", taken: float) -> "Polynomial":
        """Return the blend from `taken` [m] before the end to `taken` after the start of the path `after`."""
        ends = [self.derivatives(1.0 - taken / self.length), after.derivatives(taken / after.length)]
        width, corner = 2.0 * taken, after.position(0.0)
        for end in ends:
            end *= width ** np.arange(MATCHED_ORDERS)[:, None]
            end[0] -= corner  # differences of small numbers lose fewer digits
        curve = extract_polynomial(BPoly.from_derivatives([0.0, 1.0], ends), 0.0, 1.0, width)
        curve.coefficients[0] += corner
        return curve


@dataclass(frozen=True)
class Straight(Geometry):
    """A straight line from `start` to `end` (3,) [m]."""

    start: Array  # (3,) [m]
    end: Array  # (3,) [m]

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the series of x, y, z from the series of s."""
        (progress,) = coordinates
        axes = zip((self.end - self.start).tolist(), self.start.tolist(), strict=True)
        return [progress * travel + origin for travel, origin in axes]

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.linalg.norm(self.end - self.start))

    def part(self, begin: float, end: float) -> "Straight":
        """Return the section from s = `begin` to s = `end`."""
        travel = self.end - self.start
        return Straight(self.start + begin * travel, self.end - (1.0 - end) * travel)


@dataclass(frozen=True)
class Circular(Geometry):
    """A horizontal arc from `start` about `centre` (x, y) through `angle` [rad]."""

    start: Array
    centre: Array
    angle: float

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the series of x, y, z from the series of s."""
        (progress,) = coordinates
        x, y = (self.start[:2] - self.centre).tolist()
        cosine, sine = (progress * self.angle).cos_sin()
        axes = (cosine * x - sine * y, cosine * y + sine * x, progress * 0.0)
        centre = *self.centre.tolist(), float(self.start[2])
        return [axis + origin for axis, origin in zip(axes, centre, strict=True)]

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.linalg.norm(self.start[:2] - self.centre)) * abs(self.angle)

    def part(self, begin: float, end: float) -> "Circular":
        """Return the section from s = `begin` to s = `end`."""
        return Circular(self.position(begin), self.centre, (end - begin) * self.angle)


@dataclass(frozen=True)
class Polynomial(Geometry):
    """A polynomial in powers of s - 1/2."""

    coefficients: Array  # (degree + 1, 3) [m]
    approximate_length: float  # [m]

    @property
    def length(self) -> float:
        """Length [m]."""
        return self.approximate_length

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the series of x, y, z from the series of s."""
        (progress,) = coordinates
        rate = Series(progress[1:])
        powers = [rate]
        while len(powers) < len(rate):
            powers.append(powers[-1] * rate)
        load = []
        for outer in expand_about(progress[0], self.coefficients, len(progress)):
            series = Series([outer[0]])
            for order in range(1, len(progress)):
                value = outer[1] * powers[0][order - 1]
                for k in range(2, order + 1):
                    value = value + outer[k] * powers[k - 1][order - k]
                series.append(value)
            load.append(series)
        return load


def expand_about(s: Number, coefficients: Array, count: int) -> list[Series]:
    """Return the first `count` coefficients about s of x, y, z, which are polynomials in s - 1/2.

    Coefficients beyond the polynomial's degree are zero. Numbers other than arrays bring methods for this and
    for the next two functions (`planning.arithmetic`).
    """
    if not isinstance(s, np.ndarray):
        own: list[Series] = s.expand_about(coefficients, count)
        return own
    expanded = Series.about(s[:, None] - 0.5, list(coefficients)).padded(count)
    return [Series(coefficient[:, axis] for coefficient in expanded) for axis in range(3)]


def select_between(s: Number, low: float, high: float) -> tuple[NDArray[np.intp], Number]:
    """Return the indices of the points whose s lies on a segment from `low` to `high`, and s there."""
    if not isinstance(s, np.ndarray):
        own: tuple[NDArray[np.intp], Number] = s.select_between(low, high)
        return own
    index = np.flatnonzero((s >= low) & (s < high))
    return index, s[index]


def gather(like: Number, parts: list[tuple[NDArray[np.intp], Number]]) -> Number:
    """Combine the (indices, values) of segments into values at all points, as many as in `like`."""
    if not isinstance(like, np.ndarray):
        return like.gather(parts)
    value = np.empty_like(like)
    for index, part in parts:
        value[index] = part
    return value


def extract_polynomial(curve: BPoly | BSpline, begin: float, end: float, length: float) -> Polynomial:
    """Return the piece of `curve` (3,) from `begin` to `end`, between which it must be one polynomial."""
    degree = curve.k if isinstance(curve, BSpline) else len(curve.c) - 1
    middle, width = 0.5 * (begin + end), end - begin
    rows = [
        (curve.derivative(k) if k else curve)(middle) * width**k / factorial(k) for k in range(degree + 1)
    ]
    return Polynomial(np.array(rows), length)


@dataclass(frozen=True)
class Chain(Geometry):
    """A sequence of path segments, each with a share of s in proportion to its length."""

    segments: tuple[Geometry, ...]

    @property
    def length(self) -> float:
        """Length [m]."""
        return sum(segment.length for segment in self.segments)

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """Return the series of x, y, z from the series of s; an interval may span several segments."""
        (progress,) = coordinates
        first = progress[0]
        edges = np.concatenate(
            [[0.0], np.cumsum([segment.length for segment in self.segments]) / self.length]
        )
        # Without bounds at both ends, where rounding may leave s outside of 0 to 1.
        low, high = [-np.inf, *edges[1:-1].tolist()], [*edges[1:-1].tolist(), np.inf]
        parts: list[tuple[Any, list[Series]]] = []
        for k, (begin, end) in enumerate(itertools.pairwise(edges.tolist())):
            index, inside = select_between(first, low[k], high[k])
            if len(index):
                series = Series([inside, *(c[index] for c in progress[1:])])
                parts.append((index, self.segments[k]([(series + -begin) * (1.0 / (end - begin))])))
        return [
            Series(
                gather(first, [(index, load[axis][order]) for index, load in parts])
                for order in range(len(progress))
            )
            for axis in range(3)
        ]


@dataclass(frozen=True)
class GeometricPath:
    """A motion along a path by a time law."""

    geometry: Geometry
    duration: float
    time_law: TimeLaw

    def sample(self, time: Array) -> Array:
        load = self.geometry([Series.from_derivatives(list(self.time_law.progress(time, self.duration)))])
        return np.array([[c * factorial(k) for k, c in enumerate(axis)] for axis in load]).transpose(2, 1, 0)


def _line_or_arc(segment: Line | Arc, start: Array, where: str) -> Straight | Circular:
    segment.check_moves(start, where)
    if isinstance(segment, Line):
        return Straight(start, np.array(segment.to))
    return Circular(start, np.array(segment.centre), segment.angle)


def blend_corners(parts: Sequence[Straight | Circular], taken: Sequence[float]) -> Chain:
    """Return the path whose blends replace `taken` [m] of both parts at each corner."""
    segments: list[Geometry] = []
    for k, (part, before, after) in enumerate(zip(parts, (0.0, *taken), (*taken, 0.0), strict=True)):
        if before + after > part.length * (1.0 + MAX_OVERLAP):
            raise InputError(
                f"blends take {before + after:g} m of part {k + 1}, which is {part.length:g} m long",
                allowed="blends that take at most the length of the part",
                remedy="give lines and arcs with blend, or correct taken",
            )
        begin, end = before / part.length, 1.0 - after / part.length
        if end > begin:
            segments.append(part.part(begin, end))
        if after:
            segments.append(part.blend_into(parts[k + 1], after))
    return Chain(tuple(segments))

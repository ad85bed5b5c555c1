"""Where the load is by its coordinates: how far along a given path, s from 0 to 1, or freely."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, factorial
from typing import Any

import numpy as np
from scipy.interpolate import BPoly, BSpline

from cranectl.reference.planning.gradients import Gradient
from cranectl.reference.planning.intervals import Interval
from cranectl.reference.planning.series import Number, Series, plus, shifted, times, turned
from cranectl.support.arrays import Array


@dataclass(frozen=True)
class Straight:
    """From one point to another."""

    start: Array
    end: Array

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """The load's motion from that of s."""
        (progress,) = coordinates
        ways = zip((self.end - self.start).tolist(), self.start.tolist(), strict=True)
        return [shifted([c * way for c in progress], at) for way, at in ways]

    @property
    def length(self) -> float:
        """[m]."""
        return float(np.linalg.norm(self.end - self.start))

    def part(self, begin: float, end: float) -> "Straight":
        """From one s to another."""
        way = self.end - self.start
        return Straight(self.start + begin * way, self.end - (1.0 - end) * way)


@dataclass(frozen=True)
class Circular:
    """A horizontal arc from `start` about `centre` (x, y) through `angle` [rad]."""

    start: Array
    centre: Array
    angle: float

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """The load's motion from that of s."""
        (progress,) = coordinates
        x, y = (self.start[:2] - self.centre).tolist()
        cosine, sine = turned([c * self.angle for c in progress])
        east = [c * x - s * y for c, s in zip(cosine, sine, strict=True)]
        north = [c * y + s * x for c, s in zip(cosine, sine, strict=True)]
        level = [c * 0.0 for c in progress]
        places = *self.centre.tolist(), float(self.start[2])
        return [shifted(each, at) for each, at in zip((east, north, level), places, strict=True)]

    @property
    def length(self) -> float:
        """[m]."""
        return float(np.linalg.norm(self.start[:2] - self.centre)) * abs(self.angle)

    def part(self, begin: float, end: float) -> "Circular":
        """From one s to another."""
        return Circular(place(self, begin), self.centre, (end - begin) * self.angle)


@dataclass(frozen=True)
class Polynomial:
    """By powers of s less one half."""

    coefficients: Array  # (degree + 1, 3) [m]
    length: float  # [m], about

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """The load's motion from that of s."""
        (progress,) = coordinates
        rate = progress[1:]
        powers = [rate]
        while len(powers) < len(rate):
            powers.append(times(powers[-1], rate))
        load = []
        for outer in self._about(progress[0], len(progress)):
            series = [outer[0]]
            for order in range(1, len(progress)):
                value = outer[1] * powers[0][order - 1]
                for k in range(2, order + 1):
                    value = value + outer[k] * powers[k - 1][order - k]
                series.append(value)
            load.append(series)
        return load

    def _about(self, s: Number, count: int) -> list[Series]:
        """The first coefficients of x, y, z in powers of a distance from s."""
        rows = list(self.coefficients)
        if isinstance(s, Gradient):
            found = _taylor(rows, s.value[:, None], count + 1)
            slopes = [(k + 1) * each for k, each in enumerate(found[1:])]
            return [
                [
                    Gradient(value[:, axis], slope[:, axis, None] * s.slope)
                    for value, slope in zip(found, slopes, strict=False)
                ]
                for axis in range(3)
            ]
        if isinstance(s, np.ndarray | Interval):
            found = _taylor(rows, s[:, None], count)
            return [[each[:, axis] for each in found] for axis in range(3)]
        return [_taylor(column, s, count) for column in self.coefficients.T.tolist()]


def _taylor(coefficients: Sequence[Array | float], s: Number, count: int) -> Series:
    """Of a polynomial in powers of s - 1/2 the first coefficients in powers of a distance from s.

    Zeros beyond its degree.
    """
    if isinstance(s, Interval):
        # About the middle, and from there as far as the interval: what is far away cancels.
        middle = 0.5 * (s.low + s.high)
        about, step = _shifted(coefficients, Interval(middle, middle) - 0.5), s - middle
        found = []
        for k in range(min(count, len(about))):
            value = about[-1] * float(comb(len(about) - 1, k))
            for j in range(len(about) - 2, k - 1, -1):
                value = value * step + about[j] * float(comb(j, k))
            found.append(value)
    else:
        found = _shifted(coefficients, s - 0.5)[:count]
    return found + [found[0] * 0.0] * (count - len(found))


def _shifted(coefficients: Sequence[Array | float], at: Number) -> Series:
    """Coefficients of a polynomial in powers of x as one in powers of x - at: Horner's scheme."""
    found: Series = [at * 0.0 + each for each in coefficients]
    for first in range(len(found) - 1):
        for k in range(len(found) - 2, first - 1, -1):
            found[k] = found[k] + at * found[k + 1]
    return found


def polynomial(curve: BPoly | BSpline, begin: float, end: float, length: float) -> Polynomial:
    """What `curve` (3,) is from `begin` to `end`, between which it is one polynomial."""
    degree = curve.k if isinstance(curve, BSpline) else len(curve.c) - 1
    middle, width = 0.5 * (begin + end), end - begin
    rows = [
        (curve.derivative(k) if k else curve)(middle) * width**k / factorial(k) for k in range(degree + 1)
    ]
    return Polynomial(np.array(rows), length)


Piece = Straight | Circular | Polynomial


@dataclass(frozen=True)
class Chain:
    """Pieces one after the other, each with the share of s that it has of the length."""

    pieces: tuple[Piece, ...]

    @property
    def length(self) -> float:
        """[m]."""
        return sum(piece.length for piece in self.pieces)

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """The load's motion from that of s; of an interval all that pieces which it meets make of it."""
        (progress,) = coordinates
        first = progress[0]
        edges = np.concatenate([[0.0], np.cumsum([piece.length for piece in self.pieces]) / self.length])
        found: list[tuple[Any, list[Series]]] = []
        for k, (piece, begin, end) in enumerate(
            zip(self.pieces, edges[:-1].tolist(), edges[1:].tolist(), strict=True)
        ):
            low, high = begin if k else -np.inf, end if k + 1 < len(self.pieces) else np.inf
            if isinstance(first, Interval):
                where = np.flatnonzero((first.low <= high) & (first.high >= low))
                own = [c[where] for c in progress]
                own[0] = own[0].meet(Interval(np.array(low), np.array(high)))
            elif isinstance(first, np.ndarray | Gradient):
                value = first.value if isinstance(first, Gradient) else first
                where = np.flatnonzero((value >= low) & (value < high))
                own = [c[where] for c in progress]
            else:
                where = (
                    (first >= low) * (first < high)
                    if k and k + 1 < len(self.pieces)
                    else (first < high if k == 0 else first >= low)
                )
                own = progress
            if not isinstance(where, np.ndarray) or len(where):
                scale = 1.0 / (end - begin)
                found.append((where, piece([[c * scale for c in shifted(own, -begin)]])))
        return [
            [
                _gathered([(where, load[axis][order]) for where, load in found], first)
                for order in range(len(progress))
            ]
            for axis in range(3)
        ]


def _gathered(found: list[tuple[Any, Number]], like: Number) -> Number:
    """Of all points, from those of each piece: the hull where there are several."""
    if isinstance(like, Interval):
        low, high = np.full(len(like.low), np.inf), np.full(len(like.low), -np.inf)
        for where, part in found:
            low[where] = np.minimum(low[where], part.low)
            high[where] = np.maximum(high[where], part.high)
        return Interval(low, high)
    if isinstance(like, Gradient):
        value, slope = np.empty_like(like.value), np.empty(like.slope.shape)
        for where, part in found:
            value[where], slope[where] = part.value, part.slope
        return Gradient(value, slope)
    if isinstance(like, np.ndarray):
        value = np.empty_like(like)
        for where, part in found:
            value[where] = part
        return value
    total = found[0][0] * found[0][1]
    for where, part in found[1:]:
        total = total + where * part
    return total


Geometry = Straight | Circular | Chain


def place(geometry: Geometry | Polynomial, s: float) -> Array:
    """Of the load at s, (3,) [m]."""
    return np.array([float(series[0][0]) for series in geometry([[np.array([s])]])])


@dataclass(frozen=True)
class Placed:
    """A free motion: coordinates along `directions` (d, 3), unit vectors, from `start`."""

    start: Array
    end: Array
    directions: Array

    def __call__(self, coordinates: list[Series]) -> list[Series]:
        """The load's motion from that of the coordinates."""
        load = []
        for origin, factors in zip(self.start.tolist(), self.directions.T.tolist(), strict=True):
            series = [c * factors[0] for c in coordinates[0]]
            for coordinate, factor in zip(coordinates[1:], factors[1:], strict=True):
                if factor:
                    series = plus(series, [c * factor for c in coordinate])
            load.append(shifted(series, origin))
        return load

    def points(self, coordinates: Array) -> Array:
        """Places (N, 3) [m] of coordinates (N, d); where they end exact."""
        places = self.start + coordinates @ self.directions
        places[(coordinates == coordinates[-1]).all(axis=1)] = self.end
        return places

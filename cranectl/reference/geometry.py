"""Where the load is by its coordinates: how far along a given path, s from 0 to 1, or freely."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch
from itertools import pairwise
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly, BSpline

from cranectl.reference.series import Number, Series, shifted, times, turned
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
    found = padded(shifted_powers(list(coefficients), s[:, None] - 0.5), count)
    return [[each[:, axis] for each in found] for axis in range(3)]


@singledispatch
def select_between(s: Number, low: float, high: float) -> tuple[NDArray[np.intp], Number]:
    """Return the points at which s may be on a piece from `low` to `high`, and s at these."""
    where = np.flatnonzero((s >= low) & (s < high))
    return where, s[where]


@singledispatch
def gathered(like: Number, found: list[tuple[NDArray[np.intp], Number]]) -> Number:
    """Return the numbers of all points, of which there are as many as in `like`, from those of each piece."""
    value = np.empty_like(like)
    for where, part in found:
        value[where] = part
    return value


def padded(series: Series, count: int) -> Series:
    """Return the first coefficients of a series, with zeros where it has fewer."""
    return series[:count] + [series[0] * 0.0] * (count - len(series))


def shifted_powers(coefficients: Sequence[Array | float], at: Number) -> Series:
    """Return the coefficients of a polynomial in powers of x as one in powers of x - at: Horner's scheme."""
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
        last = len(self.pieces) - 1
        for k, (piece, (begin, end)) in enumerate(zip(self.pieces, pairwise(edges.tolist()), strict=True)):
            low, high = begin if k else -np.inf, end if k < last else np.inf
            where, own = select_between(first, low, high)
            if len(where):
                inside = [own, *(c[where] for c in progress[1:])]
                scale = 1.0 / (end - begin)
                found.append((where, piece([[c * scale for c in shifted(inside, -begin)]])))

        def whole(axis: int, order: int) -> Number:
            return gathered(first, [(where, load[axis][order]) for where, load in found])

        return [[whole(axis, order) for order in range(len(progress))] for axis in range(3)]


Geometry = Straight | Circular | Chain


def place(geometry: Geometry | Polynomial, s: float) -> Array:
    """Of the load at s, (3,) [m]."""
    return np.array([float(series[0][0]) for series in geometry([[np.array([s])]])])

"""Given paths, as functions of how far along one is, s from 0 to 1: their Taylor coefficients at any s."""

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from typing import Protocol

import numpy as np

from cranectl.reference.planning.series import Number, Series, composed, plus
from cranectl.support.arrays import Array


class Geometry(Protocol):
    """A path."""

    def taylor(self, s: Number, order: int) -> list[Series]:
        """Of x, y, z in s, up to an order."""


@dataclass(frozen=True)
class Straight:
    """From one point to another."""

    start: Array
    end: Array

    def taylor(self, s: Number, order: int) -> list[Series]:
        nothing = [s * 0.0] * (order - 1)
        way = (self.end - self.start).tolist()
        return [[s * w + float(a), s * 0.0 + w, *nothing] for a, w in zip(self.start, way, strict=True)]


@dataclass(frozen=True)
class Circular:
    """A horizontal arc from `start` about `centre` (x, y) through `angle` [rad]."""

    start: Array
    centre: Array
    angle: float

    def taylor(self, s: Number, order: int) -> list[Series]:
        x, y = (self.start[:2] - self.centre).tolist()
        turn = s * self.angle
        cosine, sine = (
            (np.cos(turn), np.sin(turn)) if isinstance(turn, np.ndarray) else (turn.cos(), turn.sin())
        )
        turned = cosine * x - sine * y, cosine * y + sine * x  # and so on by quarter turns
        cycle = (turned, (-turned[1], turned[0]), (-turned[0], -turned[1]), (turned[1], -turned[0]))
        factors = [self.angle**k / factorial(k) for k in range(order + 1)]
        plane = [[cycle[k % 4][axis] * factors[k] for k in range(order + 1)] for axis in range(2)]
        for axis in range(2):
            plane[axis][0] = plane[axis][0] + float(self.centre[axis])
        height = [s * 0.0 + float(self.start[2]), *([s * 0.0] * order)]
        return [*plane, height]


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
            load.append([series[0] + origin, *series[1:]])
        return load

    def points(self, coordinates: Array) -> Array:
        """Places (N, 3) [m] of coordinates (N, d); where they end exact."""
        places = self.start + coordinates @ self.directions
        places[(coordinates == coordinates[-1]).all(axis=1)] = self.end
        return places


def along(geometry: Geometry) -> Callable[[list[Series]], list[Series]]:
    """The load's motion from that of s."""

    def to_load(coordinates: list[Series]) -> list[Series]:
        (progress,) = coordinates
        return [composed(series, progress) for series in geometry.taylor(progress[0], len(progress) - 1)]

    return to_load

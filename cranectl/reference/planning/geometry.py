"""Where the load is by its coordinates: how far along a given path, s from 0 to 1, or freely."""

from dataclasses import dataclass

import numpy as np

from cranectl.reference.planning.series import Series, plus, shifted, turned
from cranectl.scenario import Line
from cranectl.scenario.segments import Arc
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


Geometry = Straight | Circular


def geometry_of(segment: Line | Arc, start: Array) -> Geometry:
    """The path of a segment that begins at `start` (3,) [m]."""
    if isinstance(segment, Line):
        return Straight(start, np.array(segment.to))
    return Circular(start, np.array(segment.centre), segment.angle)


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

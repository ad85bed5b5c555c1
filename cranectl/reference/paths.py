"""Segments with their start point fixed: desired load positions and derivatives over local time."""

import functools
from dataclasses import dataclass
from math import factorial
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline

from cranectl.reference.geometry import Chain
from cranectl.reference.series import from_derivatives
from cranectl.reference.time_laws import Law, derivatives, progress, spline
from cranectl.support.arrays import Array


class Path(Protocol):
    """A segment with its start point fixed."""

    @property
    def duration(self) -> float:
        """Length in time [s]."""

    def sample(self, time: Array) -> Array:
        """Position and four derivatives at local times in [0, duration] [s]: shape (N, 5, 3)."""


@dataclass(frozen=True)
class HoldPath:
    """Stay at `point`."""

    point: Array
    duration: float

    def sample(self, time: Array) -> Array:
        rows = np.zeros((len(time), 5, 3))
        rows[:, 0] = self.point
        return rows


@dataclass(frozen=True)
class LinePath:
    """Straight line from `start` to `end`."""

    start: Array
    end: Array
    duration: float
    time_law: Law

    def sample(self, time: Array) -> Array:
        s = progress(self.time_law, time, self.duration)
        rows = s.T[:, :, np.newaxis] * (self.end - self.start)
        # Exact at both ends: the next segment and the hold start where the line was told to go.
        rows[:, 0] = (1.0 - s[0])[:, np.newaxis] * self.start + s[0][:, np.newaxis] * self.end
        return rows


@dataclass(frozen=True)
class ArcPath:
    """Horizontal circular arc from `start` about `centre` (x, y) through `angle` [rad].

    Positive angles run counter-clockwise seen from above.
    """

    start: Array
    centre: Array
    angle: float
    duration: float
    time_law: Law

    def sample(self, time: Array) -> Array:
        theta, s1, s2, s3, s4 = self.angle * progress(self.time_law, time, self.duration)
        radius = self.start[:2] - self.centre
        # d/dt of exp(i theta): Faà di Bruno to order four, with complex numbers for the plane.
        turn = np.exp(1j * theta)
        factors = np.array(
            [
                np.ones_like(theta),
                1j * s1,
                1j * s2 - s1**2,
                1j * s3 - 3.0 * s1 * s2 - 1j * s1**3,
                1j * s4 - 4.0 * s1 * s3 - 3.0 * s2**2 - 6j * s1**2 * s2 + s1**4,
            ]
        )
        plane = complex(radius[0], radius[1]) * turn * factors
        rows = np.zeros((len(time), 5, 3))
        rows[:, :, 0], rows[:, :, 1] = plane.real.T, plane.imag.T
        rows[:, 0, :2] += self.centre
        rows[:, 0, 2] = self.start[2]
        return rows


@dataclass(frozen=True)
class ChainPath:
    """Along pieces that go over into each other."""

    pieces: Chain
    duration: float
    time_law: Law

    def sample(self, time: Array) -> Array:
        load = self.pieces([from_derivatives(list(progress(self.time_law, time, self.duration)))])
        return np.array([[c * factorial(k) for k, c in enumerate(axis)] for axis in load]).transpose(2, 1, 0)


@dataclass(frozen=True)
class SplinePath:
    """A B-spline over time, at rest at both ends."""

    breaks: Array  # (spans + 1,) knots, each once [s]
    coefficients: Array  # (spans + degree, 3) [m]
    degree: int

    @property
    def duration(self) -> float:
        return float(self.breaks[-1])

    @functools.cached_property
    def _curves(self) -> tuple[BSpline, ...]:
        curves: tuple[BSpline, ...] = derivatives(spline(self.breaks, self.coefficients, self.degree))
        return curves

    def sample(self, time: Array) -> Array:
        time = np.clip(time, 0.0, self.duration)
        rows = np.stack([curve(time) for curve in self._curves], axis=1)
        # What rounding leaves of derivatives at rest would be a jump.
        rows[time == 0.0] = HoldPath(self.coefficients[0], 1.0).sample(np.zeros(1))
        rows[time == self.duration] = HoldPath(self.coefficients[-1], 1.0).sample(np.zeros(1))
        return rows

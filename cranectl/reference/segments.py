"""Path segments: position and four derivatives of the desired load position over local time."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cranectl.reference import time_law

Array = NDArray[np.float64]


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
    time_law: str

    def sample(self, time: Array) -> Array:
        s = _progress(self.time_law, time, self.duration)
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
    time_law: str

    def sample(self, time: Array) -> Array:
        s1, s2, s3, s4 = (self.angle * s for s in _progress(self.time_law, time, self.duration)[1:])
        theta = self.angle * _progress(self.time_law, time, self.duration)[0]
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


def _progress(law: str, time: Array, duration: float) -> Array:
    """Time law and its derivatives in real time, shape (5, N)."""
    scale = duration ** -np.arange(5.0)
    return scale[:, np.newaxis] * time_law.evaluate(law, np.clip(time / duration, 0.0, 1.0))

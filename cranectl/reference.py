"""Desired load trajectories: time laws, path segments, their composition, checked for smoothness.

Time laws s(tau) go from 0 to 1 over 0 <= tau <= 1, at rest at both ends. `degree-9`: position and four
derivatives given at each end, so rest-to-rest motions are C⁴, which the tracker needs. `degree-5`: the
thesis's quintic (4.3), C² only, for reproduction.
"""

import functools
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from cranectl.scenario import AddedSegment, Hold, Line, ReferenceSettings, Segment
from cranectl.scenario.segments import added_kinds
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

# Derivatives that vanish at both ends.
REST_DERIVATIVES = {"degree-9": 4, "degree-5": 2}


@functools.cache
def _polynomials(name: str) -> tuple[BPoly, ...]:
    """The time law and its first four derivatives, in the Bernstein basis (exact at both ends)."""
    rest = [0.0] * REST_DERIVATIVES[name]
    law = BPoly.from_derivatives([0.0, 1.0], [[0.0, *rest], [1.0, *rest]])
    return tuple(law if order == 0 else law.derivative(order) for order in range(5))


def time_law(name: str, tau: Array) -> Array:
    """S and its first four derivatives with respect to tau, shape (5, len(tau))."""
    return np.array([polynomial(tau) for polynomial in _polynomials(name)])


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
        theta, s1, s2, s3, s4 = self.angle * _progress(self.time_law, time, self.duration)
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
    return scale[:, np.newaxis] * time_law(law, np.clip(time / duration, 0.0, 1.0))


# A jump this large, relative to the largest value of that derivative (at least 1), is no rounding.
JUMP_TOLERANCE = 1e-9
_ORDINALS = ("position", "first derivative", "second derivative", "third derivative", "fourth derivative")


@dataclass(frozen=True)
class Trajectory:
    """Segments one after the other; after the last its end point is held."""

    start: Array
    paths: tuple[Path, ...]

    @property
    def joints(self) -> Array:
        """Start times of the segments and the end of the last [s]."""
        return np.array([0.0, *np.cumsum([path.duration for path in self.paths])])

    def sample(self, time: Array) -> Array:
        """Desired load position and four derivatives, shape (N, 15): (z, z', z'', z''', z'''').

        At a joint the later segment counts. `time` [s] from 0.
        """
        time = np.asarray(time, dtype=np.float64)
        rows = np.zeros((len(time), 5, 3))
        index, joints = self._segment_at(time), self.joints
        for k, path in enumerate((*self.paths, self._final_hold())):
            chosen = index == k
            rows[chosen] = path.sample(time[chosen] - joints[k])
        return rows.reshape(len(time), 15)

    def set_points(self, time: Array) -> Array:
        """Where the segment that runs at `time` [s] ends, at rest: rows (N, 15) for a set-point law."""
        rows = np.zeros((len(time), 15))
        ends = np.array([_end_point(path) for path in (*self.paths, self._final_hold())])
        rows[:, :3] = ends[self._segment_at(time)]
        return rows

    def _segment_at(self, time: Array) -> NDArray[np.intp]:
        """Index of the path that runs at `time`; at a joint the later one counts."""
        # Joints are sums of decimal durations: meet the sample that is meant, a nanosecond early.
        return np.searchsorted(self.joints - 1e-9, time, side="right") - 1

    def jumps(self) -> list[tuple[float, int, float]]:
        """Discontinuities: (time [s], derivative order, size), the start from rest included."""
        found = []
        before = HoldPath(self.start, 1.0).sample(np.array([1.0]))[0]
        for time, path in zip(self.joints, (*self.paths, self._final_hold()), strict=True):
            samples = path.sample(np.linspace(0.0, path.duration, 101))
            scale = np.maximum(1.0, np.abs(samples).max(axis=(0, 2)))
            jump = np.abs(samples[0] - before).max(axis=1)
            found += [
                (float(time), order, float(jump[order]))
                for order in range(5)
                if jump[order] > JUMP_TOLERANCE * scale[order]
            ]
            before = samples[-1]
        return found

    def _final_hold(self) -> HoldPath:
        return HoldPath(_end_point(self.paths[-1]) if self.paths else self.start, 1.0)


def build_trajectory(settings: ReferenceSettings) -> Trajectory:
    """Build the trajectory of a scenario.

    Raises InputError for segments of no length and for jumps in derivatives that
    `settings.continuity` requires to be continuous.
    """
    start = np.array(settings.start)
    paths: list[Path] = []
    for index, segment in enumerate(settings.segments):
        here = _end_point(paths[-1]) if paths else start
        paths.append(_build_path(segment, here, f"reference.segments.{index}"))
    trajectory = Trajectory(start, tuple(paths))
    _check_continuity(trajectory, settings.continuity)
    return trajectory


def _build_path(segment: Segment, start: Array, where: str) -> Path:
    if isinstance(segment, Hold):
        return HoldPath(start, segment.duration)
    if isinstance(segment, Line):
        end = np.array(segment.to)
        if np.array_equal(start, end):
            raise _no_length(where, "a line to where the load already is")
        return LinePath(start, end, segment.duration, segment.time_law)
    if isinstance(segment, AddedSegment):
        added: Path = added_kinds()[segment.kind].path(segment.settings, start)
        return added
    centre = np.array(segment.centre)
    if segment.angle == 0.0 or np.array_equal(start[:2], centre):
        raise _no_length(where, "an arc of no angle or no radius")
    return ArcPath(start, centre, segment.angle, segment.duration, segment.time_law)


def _end_point(path: Path) -> Array:
    end: Array = path.sample(np.array([path.duration]))[0, 0]
    return end


def _no_length(where: str, what: str) -> InputError:
    return InputError(
        f"{where} has zero length: {what}",
        allowed="segments that move the load",
        remedy='to stay in place use kind = "hold"',
    )


def _check_continuity(trajectory: Trajectory, continuity: int) -> None:
    broken = [jump for jump in trajectory.jumps() if jump[1] <= continuity]
    if not broken:
        return
    listed = ", ".join(f"{_ORDINALS[order]} by {size:.3g} at {time:g} s" for time, order, size in broken)
    lowest = min(order for _, order, _ in broken)
    opt_out = f", or accept it with reference.continuity = {lowest - 1}" if lowest > 0 else ""
    raise InputError(
        f"the reference jumps: {listed}",
        allowed=f"continuous derivatives up to order {continuity} (reference.continuity)",
        remedy=f'use time_law = "degree-9"{opt_out}',
    )

"""Desired load trajectories: a sequence of segments, sampled with derivatives, and checked for jumps."""

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from cranectl.reference.time_laws import SAMPLE_TOLERANCE, TimeLaw, derivatives, spline
from cranectl.scenario import (
    AddedSegment,
    Arc,
    BlendedPath,
    Driven,
    Hold,
    Line,
    ReferenceSettings,
    Segment,
    Spline,
)
from cranectl.support import Array, InputError

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

JUMP_TOLERANCE = 1e-9  # of the largest value of a derivative, or of 1; smaller jumps are rounding
BEFORE_END = 1e-3  # share of a segment's duration: so long before its end its direction is taken
RESTS = 0.01  # share of a spline's largest speed, below which it counts as at rest
_ORDINALS = ("position", "first derivative", "second derivative", "third derivative", "fourth derivative")


class Path(Protocol):
    """Motion of the load on one segment, from its start point."""

    @property
    def duration(self) -> float:
        """Duration [s]."""

    def sample(self, time: Array) -> Array:
        """Return position and four derivatives at local times in [0, duration] [s]: shape (N, 5, 3)."""


@dataclass(frozen=True)
class HoldPath:
    """Stay at `point`."""

    point: Array  # (3,) [m]
    duration: float  # [s]

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
    time_law: TimeLaw

    def sample(self, time: Array) -> Array:
        s = self.time_law.progress(time, self.duration)
        rows = s.T[:, :, np.newaxis] * (self.end - self.start)
        # Exact at both ends, where the next segment starts.
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
    time_law: TimeLaw

    def sample(self, time: Array) -> Array:
        theta, s1, s2, s3, s4 = self.angle * self.time_law.progress(time, self.duration)
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
class SplinePath:
    """A B-spline over time, at rest at both ends."""

    breaks: Array  # (spans + 1,) knots, each once [s]
    coefficients: Array  # (spans + degree, 3) [m]
    degree: int  # of the polynomials

    @property
    def duration(self) -> float:
        return float(self.breaks[-1])

    @functools.cached_property
    def _curves(self) -> "tuple[BSpline, ...]":
        curves: tuple[BSpline, ...] = derivatives(spline(self.breaks, self.coefficients, self.degree))
        return curves

    def sample(self, time: Array) -> Array:
        time = np.clip(time, 0.0, self.duration)
        rows = np.stack([curve(time) for curve in self._curves], axis=1)
        # Derivatives at rest must be exactly zero: what rounding leaves would be a jump.
        rows[time == 0.0] = HoldPath(self.coefficients[0], 1.0).sample(np.zeros(1))
        rows[time == self.duration] = HoldPath(self.coefficients[-1], 1.0).sample(np.zeros(1))
        return rows


@dataclass(frozen=True)
class Trajectory:
    """Follow a sequence of segments, after which the load stays at the last end point.

    Parameters
    ----------
    start : ndarray, shape (3,)
        First position of the load (x, y, z) in the world [m].
    paths : tuple of Path
        Motions on the segments. Each begins where the one before ends.
    """

    start: Array
    paths: tuple[Path, ...]

    @classmethod
    def of(cls, settings: ReferenceSettings) -> "Trajectory":
        """Build the trajectory of a scenario whose segments are all planned.

        Raises InputError for segments of zero length, and for jumps in derivatives up to order
        `settings.continuity`.
        """
        start = np.array(settings.start)
        paths: list[Path] = []
        for index, segment in enumerate(settings.segments):
            begin = _end_of(paths[-1]) if paths else start
            paths.append(_build_path(segment, begin, f"reference.segments.{index}"))
        trajectory = cls(start, tuple(paths))
        _check_continuity(trajectory, settings.continuity)
        return trajectory

    @staticmethod
    def end_of(segment: Segment, start: Array) -> Array:
        """Return the end point (x, y, z) [m] of a planned segment that begins at `start`."""
        return _end_of(_build_path(segment, start, "segment"))

    @property
    def motions(self) -> dict[int, Path]:
        """The paths on which the load moves, by their number."""
        return {k: path for k, path in enumerate(self.paths) if not isinstance(path, HoldPath)}

    @property
    def last_motion(self) -> tuple[float, Array]:
        """End [s] and direction (3,) of the last motion, a unit vector; zeros if the load never moves."""
        if not self.motions:
            return 0.0, np.zeros(3)
        index, path = list(self.motions.items())[-1]
        velocity = path.sample(np.array([(1.0 - BEFORE_END) * path.duration]))[0, 1]
        if isinstance(path, SplinePath):  # a recorded motion may rest before its end, except for noise
            velocities = path.sample(np.linspace(0.0, path.duration, 1001))[:, 1]
            speeds = np.linalg.norm(velocities, axis=1)
            velocity = velocities[np.flatnonzero(speeds >= RESTS * speeds.max())[-1]]
        return float(self.joints[index + 1]), velocity / (np.linalg.norm(velocity) or 1.0)

    @property
    def joints(self) -> Array:
        """Start times of the segments, and the end of the last [s]."""
        return np.array([0.0, *np.cumsum([path.duration for path in self.paths])])

    def sample(self, time: Array) -> Array:
        """Return the desired position of the load and four derivatives.

        Parameters
        ----------
        time : ndarray, shape (N,)
            Time from the start of the reference [s]. At a joint the later segment counts.

        Returns
        -------
        ndarray, shape (N, 15)
            z, z', z'', z''' and z'''' [m, m/s, ... m/s⁴], each with three axes.
        """
        time = np.asarray(time, dtype=np.float64)
        rows = np.zeros((len(time), 5, 3))
        index, joints = self._segment_at(time), self.joints
        for k, path in enumerate((*self.paths, self._final_hold())):
            mask = index == k
            rows[mask] = path.sample(time[mask] - joints[k])
        return rows.reshape(len(time), 15)

    def set_points(self, time: Array) -> Array:
        """Return the end point of the segment at `time` (N,) [s], at rest: (N, 15), for set-point control."""
        rows = np.zeros((len(time), 15))
        ends = np.array([_end_of(path) for path in (*self.paths, self._final_hold())])
        rows[:, :3] = ends[self._segment_at(time)]
        return rows

    def _segment_at(self, time: Array) -> NDArray[np.intp]:
        """Return the index of the path that runs at `time`; at a joint the later one counts."""
        return np.searchsorted(self.joints - SAMPLE_TOLERANCE, time, side="right") - 1

    def jumps(self) -> list[tuple[float, int, float]]:
        """Return discontinuities as (time [s], derivative order, size), also at the start from rest."""
        jumps = []
        before = HoldPath(self.start, 1.0).sample(np.array([1.0]))[0]
        for time, path in zip(self.joints, (*self.paths, self._final_hold()), strict=True):
            samples = path.sample(np.linspace(0.0, path.duration, 101))
            scale = np.maximum(1.0, np.abs(samples).max(axis=(0, 2)))
            jump = np.abs(samples[0] - before).max(axis=1)
            jumps += [
                (float(time), order, float(jump[order]))
                for order in range(5)
                if jump[order] > JUMP_TOLERANCE * scale[order]
            ]
            before = samples[-1]
        return jumps

    def _final_hold(self) -> HoldPath:
        return HoldPath(_end_of(self.paths[-1]) if self.paths else self.start, 1.0)


def _build_path(segment: Segment, start: Array, where: str) -> Path:
    if isinstance(segment, Hold):
        return HoldPath(start, segment.duration)
    if isinstance(segment, Line):
        segment.check_moves(start, where)
        return LinePath(start, np.array(segment.to), segment.seconds, TimeLaw.of(segment))
    if isinstance(segment, BlendedPath) or (isinstance(segment, Spline) and segment.time_law is not None):
        from cranectl.reference.geometry import GeometricPath, Geometry

        return GeometricPath(Geometry.of(segment, start, where), segment.seconds, TimeLaw.of(segment))
    if isinstance(segment, Spline):
        return SplinePath(np.array(segment.breaks), np.array(segment.coefficients), segment.degree)
    if isinstance(segment, Driven):
        from cranectl.reference.driven import DrivenPath, HandLimits

        box = np.array([segment.speed, segment.low, segment.high])
        limits = HandLimits(segment.bandwidth, *box)
        return DrivenPath(start, limits, segment.period, tuple(segment.changes), segment.duration)
    if isinstance(segment, AddedSegment):
        added: Path = segment.path(start)
        return added
    assert isinstance(segment, Arc), f"segment of kind {segment.kind} is not planned"
    segment.check_moves(start, where)
    return ArcPath(start, np.array(segment.centre), segment.angle, segment.seconds, TimeLaw.of(segment))


def _end_of(path: Path) -> Array:
    end: Array = path.sample(np.array([path.duration]))[0, 0]
    return end


def _check_continuity(trajectory: Trajectory, continuity: int) -> None:
    jumps = [jump for jump in trajectory.jumps() if jump[1] <= continuity]
    if not jumps:
        return
    listed = ", ".join(f"{_ORDINALS[order]} by {size:.3g} at {time:g} s" for time, order, size in jumps)
    lowest = min(order for _, order, _ in jumps)
    opt_out = f", or accept it with reference.continuity = {lowest - 1}" if lowest > 0 else ""
    raise InputError(
        f"the reference jumps: {listed}",
        allowed=f"continuous derivatives up to order {continuity} (reference.continuity)",
        remedy=f'use time_law = "degree-9"{opt_out}',
    )

"""Desired load trajectories: segments one after the other, checked for smoothness."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.reference.driven import DrivenPath, HandLimits
from cranectl.reference.given_path import chain_of, check_moves
from cranectl.reference.paths import ArcPath, ChainPath, HoldPath, LinePath, Path, SplinePath
from cranectl.reference.time_laws import law_of
from cranectl.scenario import AddedSegment, Hold, Line, ReferenceSettings, Segment
from cranectl.scenario.along_path import Arc, BlendedPath
from cranectl.scenario.driven import Driven
from cranectl.scenario.segments import Spline, added_kinds, seconds
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

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
        ends = np.array([_end_of(path) for path in (*self.paths, self._final_hold())])
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
        return HoldPath(_end_of(self.paths[-1]) if self.paths else self.start, 1.0)


def build_trajectory(settings: ReferenceSettings) -> Trajectory:
    """Build the trajectory of a scenario whose segments are `planned`.

    Raises InputError for segments of no length and for jumps in derivatives that
    `settings.continuity` requires to be continuous.
    """
    start = np.array(settings.start)
    paths: list[Path] = []
    for index, segment in enumerate(settings.segments):
        here = _end_of(paths[-1]) if paths else start
        paths.append(_build_path(segment, here, f"reference.segments.{index}"))
    trajectory = Trajectory(start, tuple(paths))
    _check_continuity(trajectory, settings.continuity)
    return trajectory


def _build_path(segment: Segment, start: Array, where: str) -> Path:
    if isinstance(segment, Hold):
        return HoldPath(start, segment.duration)
    if isinstance(segment, Line):
        check_moves(segment, start, where)
        return LinePath(start, np.array(segment.to), seconds(segment), law_of(segment))
    if isinstance(segment, BlendedPath) or (isinstance(segment, Spline) and segment.time_law is not None):
        return ChainPath(chain_of(segment, start, where), seconds(segment), law_of(segment))
    if isinstance(segment, Spline):
        return SplinePath(np.array(segment.breaks), np.array(segment.coefficients), segment.degree)
    if isinstance(segment, Driven):
        box = np.array([segment.speed, segment.low, segment.high])
        limits = HandLimits(segment.bandwidth, *box)
        return DrivenPath(start, limits, segment.period, tuple(segment.changes), segment.duration)
    if isinstance(segment, AddedSegment):
        added: Path = added_kinds()[segment.kind].path(segment.settings, start)
        return added
    assert isinstance(segment, Arc), f"{segment.kind}: not planned"
    check_moves(segment, start, where)
    return ArcPath(start, np.array(segment.centre), segment.angle, seconds(segment), law_of(segment))


def end_point(segment: Segment, start: Array) -> Array:
    """Where a segment that is planned and starts at `start` ends (x, y, z) [m]."""
    return _end_of(_build_path(segment, start, "segment"))


def _end_of(path: Path) -> Array:
    end: Array = path.sample(np.array([path.duration]))[0, 0]
    return end


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

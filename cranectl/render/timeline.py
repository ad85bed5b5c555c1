"""What of a log is drawn: which plants, at which times, which lines. Pure: no engine, no files."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cranectl.metrics import NEARLY_SLACK
from cranectl.plants.registry import plant_entry, reference_plant
from cranectl.scenario.drawn_size import drawn_scale, drawn_trail
from cranectl.simulate import Run
from cranectl.support.arrays import Array, Mask
from cranectl.support.colours import LIGHT, VIEWER_SERIES
from cranectl.support.errors import InputError

TRAIL_POINTS = 60
DASH, PERIOD = 0.035, 0.065  # [m] of the reference path, times the rig's scale
MOST_DASHES = 1000
FARTHEST = 1e6  # [m or rad] that is drawn


@dataclass(frozen=True)
class Track:
    """One run. Where several are drawn, all but the reference plant's, or the first by label, are ghosts."""

    run: Run
    ghost: bool
    label: str  # for people
    colour: str  # `#rrggbb`

    @cached_property
    def error(self) -> Array:
        """Distance of the load from its reference [m], shape (N,)."""
        distance: Array = np.linalg.norm(self.run.load_position - self.run.reference[:, :3], axis=1)
        return distance

    @cached_property
    def nearly_slack(self) -> Mask:
        """Whether the rope pulls with less than NEARLY_SLACK of the load's weight, shape (N,)."""
        weight = self.run.scenario.rig.weight
        slack: Mask = self.run.signal("load.rope_tension") < NEARLY_SLACK * weight
        return slack

    def row(self, time: float) -> int:
        """Return the sample nearest to `time` [s]; after the end of its run, the last."""
        return int(np.argmin(np.abs(self.run.time_ns - round(time * 1e9))))

    def stopped(self, time: float) -> bool:
        """Return True if the run has ended before its scenario, by `time` [s]."""
        return self.run.status.stopped and time >= float(self.run.time[-1])

    def trail(self, row: int) -> Array:
        """Return where the load has been in the last seconds, shape (M, 3), oldest first."""
        time = self.run.time_ns
        start = int(np.searchsorted(time, time[row] - int(drawn_trail(self.run.scenario.rig) * 1e9)))
        points: Array = self.run.load_position[np.unique(np.linspace(start, row, TRAIL_POINTS).astype(int))]
        return points


@dataclass(frozen=True)
class Timeline:
    """The plants of a log or the runs of an overlay, and for how long they are drawn."""

    tracks: tuple[Track, ...]
    duration: float  # [s] simulated
    by_label: bool = False  # whether they are runs of an overlay

    @property
    def main(self) -> Track:
        """The run drawn solid."""
        return next(track for track in self.tracks if not track.ghost)

    @cached_property
    def path_dashes(self) -> Array:
        """The desired path of the longest run as dashes, shape (M, 2, 3); none if the load is to stay."""
        longest = max((track.run for track in self.tracks), key=lambda run: run.end_ns)
        return dashes(longest.reference[:, :3], drawn_scale(longest.scenario.rig))

    @cached_property
    def distances(self) -> list[tuple[Array, Array]]:
        """Times [s] and distances [m] of each ghost's load from the solid crane's."""
        result, solid = [], self.main.run
        for run in (track.run for track in self.tracks if track.ghost):
            times = solid.time_ns, run.time_ns
            _, rows, own = np.intersect1d(*times, assume_unique=True, return_indices=True)
            distance = np.linalg.norm(solid.load_position[rows] - run.load_position[own], axis=1)
            result.append((solid.time[rows], distance))
        return result

    def distance(self, time: float) -> float | None:
        """Return the largest distance [m]; None for one plant, and after all but one have ended."""
        going = ((times, far) for times, far in self.distances if len(times) and time <= times[-1])
        return max((float(far[np.argmin(np.abs(times - time))]) for times, far in going), default=None)

    def times(self, fps: float, speed: float) -> Array:
        """Return the time of each frame [s]: in even steps from the start, and at the end."""
        step = speed / fps
        steps = int(np.ceil(self.duration / step - 1e-9))
        return np.append(np.arange(steps) * step, self.duration)

    @property
    def worst_time(self) -> float:
        """When the load of any crane is farthest from its reference [s]."""
        worst = max(self.tracks, key=lambda track: float(track.error.max()))
        return float(worst.run.time[int(np.argmax(worst.error))])


def timeline_of(runs: Mapping[str, Run]) -> Timeline:
    """Return the timeline of runs by plant or label; raise InputError if none has a sample."""
    drawn = {
        name: run for name, run in zip(runs, map(_drawable, runs.values()), strict=True) if len(run.time_ns)
    }
    if not drawn:
        raise InputError(
            "the log holds no sample: its runs stopped before their first",
            allowed="logs of runs that began",
            remedy="cranectl info says why a run stopped",
        )
    by_label = any(name != run.plant for name, run in runs.items())
    if by_label:
        solid = next(iter(drawn))
        blue, orange, *more = VIEWER_SERIES
        # The solid crane has an orange bridge, as MuJoCo's beside the analytic plant's.
        colours = dict(zip(runs, (orange, blue, *more), strict=False))
        tracks = [Track(run, name != solid, name, colours[name]) for name, run in drawn.items()]
    else:
        solid = reference_plant(drawn)
        entries = [(run, plant_entry(run.plant)) for run in drawn.values()]
        tracks = [Track(run, run.plant != solid, e.label, LIGHT[e.colour]) for run, e in entries]
    return Timeline(tuple(tracks), max(float(run.time[-1]) for run in drawn.values()), by_label)


def _drawable(run: Run) -> Run:
    """Return the run without samples that cannot be drawn, as before some stops."""
    drawable = (np.abs(np.hstack([run.block("state"), run.block("load")])) < FARTHEST).all(axis=1)
    if drawable.all():
        return run
    return replace(
        run, time_ns=run.time_ns[drawable], table=run.table[drawable], reference=run.reference[drawable]
    )


def dashes(path: Array, scale: float = 1.0) -> Array:
    """Return a path (N, 3) as dashes to scale, shape (M, 2, 3), longer ones if there are too many."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    period = max(PERIOD * scale, lengths[-1] / MOST_DASHES)
    starts = np.arange(0.0, lengths[-1], period)
    ends = np.minimum(starts + period * DASH / PERIOD, lengths[-1])
    corners = [np.column_stack([np.interp(s, lengths, axis) for axis in path.T]) for s in (starts, ends)]
    return np.stack(corners, axis=1)

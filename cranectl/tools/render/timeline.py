"""Select what is drawn of a log: plants, times and lines. No engine or files are used here."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cranectl.metrics import NEARLY_SLACK
from cranectl.plants import PLANTS
from cranectl.scenario import Drawing
from cranectl.simulate import Run
from cranectl.support import Array, InputError, Mask, Palette

TRAIL_POINTS = 60
DASH_LENGTH, DASH_PERIOD = 0.035, 0.065  # [m] of the reference path, times the rig's scale
MAX_DASHES = 1000
MAX_DRAWN = 1e6  # [m] or [rad]; samples beyond are left out


@dataclass(frozen=True)
class Track:
    """One run. Of several, one is solid: of a user's or the reference plant, or the first by label."""

    run: Run
    is_ghost: bool  # or an outline, see `Timeline.has_user_model`
    label: str
    colour: str  # `#rrggbb`

    @cached_property
    def error(self) -> Array:
        """Distance of the load from its reference [m], shape (N,); only of a run that has one."""
        distance: Array = np.linalg.norm(self.run.load_position - self.run.reference_position, axis=1)
        return distance

    @cached_property
    def nearly_slack(self) -> Mask:
        """Whether the tension is below NEARLY_SLACK of the load's weight, (N,)."""
        if not self.run.has_tension:
            return np.zeros(len(self.run.time_ns), dtype=np.bool_)
        slack: Mask = self.run.signal("load.rope_tension") < NEARLY_SLACK * self.run.scenario.rig.weight
        return slack

    def row(self, time: float) -> int:
        """Return the index of the sample nearest to `time` [s]."""
        return int(np.argmin(np.abs(self.run.time_ns - round(time * 1e9))))

    def stopped(self, time: float) -> bool:
        """Return True if the run has stopped early by `time` [s]."""
        return self.run.status.stopped and time >= float(self.run.time[-1])

    def trail(self, row: int) -> Array:
        """Return positions of the load in the last seconds before a sample, (M, 3) [m], oldest first."""
        time = self.run.time_ns
        start = int(np.searchsorted(time, time[row] - int(Drawing(self.run.scenario.rig).trail * 1e9)))
        points: Array = self.run.load_position[np.unique(np.linspace(start, row, TRAIL_POINTS).astype(int))]
        return points

    def has_visible_trail(self, row: int) -> bool:
        """Return True if the trail leaves the drawn load."""
        away = np.linalg.norm(self.trail(row) - self.run.load_position[row], axis=1)
        return bool(away.max() > Drawing(self.run.scenario.rig).load_radius)


@dataclass(frozen=True)
class Timeline:
    """The plants of a log or the runs of an overlay, and how long they are drawn."""

    tracks: tuple[Track, ...]
    duration: float  # [s] simulated
    by_label: bool = False  # True for runs of an overlay

    @property
    def main(self) -> Track:
        """The run drawn solid."""
        return next(track for track in self.tracks if not track.is_ghost)

    @cached_property
    def has_user_model(self) -> bool:
        """Whether the run drawn solid is of a user's model, beside which other runs are outlines."""
        run = self.main.run
        return bool(run.model) and run.plant in PLANTS and not PLANTS[run.plant].is_own

    @cached_property
    def others(self) -> list[Track]:
        """The runs that are ghosts or outlines."""
        return [track for track in self.tracks if track.is_ghost]

    @cached_property
    def path_dashes(self) -> Array:
        """The desired path of the longest run as dashes (M, 2, 3) [m]; none if the reference stays."""
        longest = max((track.run for track in self.tracks), key=lambda run: run.end_ns)
        if not longest.has_reference:
            return np.zeros((0, 2, 3))
        return dashes(longest.reference_position, Drawing(longest.scenario.rig).scale)

    @cached_property
    def distances(self) -> list[tuple[Array, Array]]:
        """Times [s], and distances [m] of each ghost's load from the solid crane's load."""
        result, solid = [], self.main.run
        for run in (track.run for track in self.others):
            times = solid.time_ns, run.time_ns
            _, rows, run_rows = np.intersect1d(*times, assume_unique=True, return_indices=True)
            distance = np.linalg.norm(solid.load_position[rows] - run.load_position[run_rows], axis=1)
            result.append((solid.time[rows], distance))
        return result

    def distance(self, time: float) -> float | None:
        """Return the largest distance at `time` [m], or None if fewer than two runs last until then."""
        current = ((times, far) for times, far in self.distances if len(times) and time <= times[-1])
        return max((float(far[np.argmin(np.abs(times - time))]) for times, far in current), default=None)

    def times(self, fps: float, speed: float) -> Array:
        """Return the time of each picture [s], in even steps from the start, and at the end."""
        step = speed / fps
        steps = int(np.ceil(self.duration / step - 1e-9))
        return np.append(np.arange(steps) * step, self.duration)

    @property
    def worst_time(self) -> float:
        """When the load is farthest from its reference, or swings most without one [s].

        That is the load of the user's own plant if there is one, else that of any crane.
        """
        own = not self.by_label and not PLANTS.entry(self.main.run.plant).is_own
        tracks = (self.main,) if own else self.tracks
        following = [track for track in tracks if track.run.has_reference]
        if not following:
            return float(self.main.run.time[int(np.argmax(np.hypot(*self.main.run.angles.T)))])
        worst = max(following, key=lambda track: float(track.error.max()))
        return float(worst.run.time[int(np.argmax(worst.error))])

    @staticmethod
    def of(runs: Mapping[str, Run]) -> "Timeline":
        """Return the timeline of runs by plant or label; raise InputError if none has a sample."""
        for name, run in runs.items():
            if not run.has("state", "load"):
                raise InputError(
                    f"the run of {name} has no angles of the rope: where its load was is not known",
                    allowed="runs with positions, angles and load",
                    remedy="map the columns of both angles, and import the files again",
                )
        drawn = {name: _without_invalid_samples(run) for name, run in runs.items()}
        drawn = {name: run for name, run in drawn.items() if len(run.time_ns)}
        if not drawn:
            raise InputError(
                "the log holds no sample, since its runs stopped before their first",
                allowed="logs of runs with samples",
                remedy="cranectl info says why a run stopped",
            )
        by_label = any(name != run.plant for name, run in runs.items())
        if by_label:
            solid = next(iter(drawn))
            blue, orange, *more = Palette.VIEWER.series
            # The model's bridge is orange, so the solid run has that colour.
            colours = dict(zip(runs, (orange, blue, *more), strict=False))
            tracks = [Track(run, name != solid, name, colours[name]) for name, run in drawn.items()]
        else:
            solid = PLANTS.shown(drawn)
            entries = [(run, PLANTS.entry(run.plant)) for run in drawn.values()]
            tracks = [Track(run, run.plant != solid, e.label, Palette.LIGHT[e.colour]) for run, e in entries]
        return Timeline(tuple(tracks), max(float(run.time[-1]) for run in drawn.values()), by_label)


def _without_invalid_samples(run: Run) -> Run:
    """Return the run without samples that cannot be drawn, such as those before some stops."""
    drawable = (np.abs(np.hstack([run.block("state"), run.block("load")])) < MAX_DRAWN).all(axis=1)
    if drawable.all():
        return run
    return replace(
        run, time_ns=run.time_ns[drawable], table=run.table[drawable], reference=run.reference[drawable]
    )


def dashes(path: Array, scale: float = 1.0) -> Array:
    """Return a path (N, 3) as dashes (M, 2, 3), with longer dashes if there would be too many."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    period = max(DASH_PERIOD * scale, lengths[-1] / MAX_DASHES)
    starts = np.arange(0.0, lengths[-1], period)
    ends = np.minimum(starts + period * DASH_LENGTH / DASH_PERIOD, lengths[-1])
    corners = [np.column_stack([np.interp(s, lengths, axis) for axis in path.T]) for s in (starts, ends)]
    return np.stack(corners, axis=1)

"""What of a log is drawn: which plants, at which times, which lines. Pure: no engine, no files."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cranectl.metrics import NEARLY_SLACK
from cranectl.plants.registry import plant_entry, reference_plant
from cranectl.simulate import Run
from cranectl.support.colours import LIGHT
from cranectl.support.errors import InputError

Array = NDArray[np.float64]

TRAIL = 4.0  # [s] that a trail shows
TRAIL_POINTS = 60
DASH, PERIOD = 0.035, 0.065  # [m] of the reference path
MOST_DASHES = 1000
FARTHEST = 1e6  # [m or rad] that is drawn


@dataclass(frozen=True)
class Actor:
    """One plant of a log. Where several are drawn, all but the reference plant are ghosts."""

    run: Run
    ghost: bool

    @property
    def label(self) -> str:
        """The plant's name, for people."""
        return plant_entry(self.run.plant).label

    @property
    def colour(self) -> str:
        """`#rrggbb` of the plant."""
        return LIGHT[plant_entry(self.run.plant).colour]

    @cached_property
    def error(self) -> Array:
        """Distance of the load from its reference [m], shape (N,)."""
        distance: Array = np.linalg.norm(self.run.load_position - self.run.reference[:, :3], axis=1)
        return distance

    def row(self, time: float) -> int:
        """The sample nearest to `time` [s]; after the end of its run, the last."""
        return int(np.argmin(np.abs(self.run.time_ns - round(time * 1e9))))

    def joints(self, row: int) -> Array:
        """Joint positions (5,): bridge, trolley, rope, alpha, beta."""
        positions: Array = self.run.block("state")[row, 0::2]
        return positions

    def load(self, row: int) -> Array:
        """World position of the load (3,)."""
        position: Array = self.run.load_position[row]
        return position

    def nearly_slack(self, row: int) -> bool:
        """Whether the rope pulls with less than NEARLY_SLACK of the load's weight."""
        return bool(self.run.signal("load.rope_tension")[row] < NEARLY_SLACK * self.run.scenario.rig.weight)

    @cached_property
    def ever_nearly_slack(self) -> bool:
        """Whether that is so at any sample."""
        return bool(self.run.signal("load.rope_tension").min() < NEARLY_SLACK * self.run.scenario.rig.weight)

    def stopped(self, time: float) -> bool:
        """Whether the run has ended before its scenario did, by `time` [s]."""
        return self.run.status.stopped and time >= float(self.run.time[-1])

    def disturbance(self, row: int) -> tuple[float, float]:
        """Angular accelerations added to alpha and beta [rad/s²]."""
        alpha, beta = self.run.block("disturbance")[row].tolist()
        return alpha, beta

    def trail(self, row: int) -> Array:
        """Where the load has been in the last TRAIL seconds, shape (M, 3), oldest first."""
        time = self.run.time_ns
        start = int(np.searchsorted(time, time[row] - int(TRAIL * 1e9)))
        rows = np.unique(np.linspace(start, row, TRAIL_POINTS).astype(int))
        points: Array = self.run.load_position[rows]
        return points


@dataclass(frozen=True)
class Film:
    """The cast, and for how long it acts."""

    cast: tuple[Actor, ...]
    duration: float  # [s] simulated

    @property
    def lead(self) -> Actor:
        """The plant drawn solid."""
        return next(actor for actor in self.cast if not actor.ghost)

    @property
    def reference(self) -> Array:
        """The desired path over the longest run, shape (N, 3)."""
        longest = max(self.cast, key=lambda actor: actor.run.end_ns)
        path: Array = longest.run.reference[:, :3]
        return path

    @cached_property
    def path_dashes(self) -> Array:
        """The desired path as dashes, shape (M, 2, 3); none if the load is to stay where it is."""
        return dashes(self.reference)

    @cached_property
    def distances(self) -> list[tuple[Array, Array]]:
        """Times [s] and distances [m] of each ghost's load from the solid crane's."""
        found, solid = [], self.lead.run
        for run in (actor.run for actor in self.cast if actor.ghost):
            times = solid.time_ns, run.time_ns
            _, rows, own = np.intersect1d(*times, assume_unique=True, return_indices=True)
            apart = np.linalg.norm(solid.load_position[rows] - run.load_position[own], axis=1)
            found.append((solid.time[rows], apart))
        return found

    def apart(self, time: float) -> float | None:
        """Largest of the distances [m]; None for one plant, and after all but one have ended."""
        return max(
            (
                float(apart[np.argmin(np.abs(times - time))])
                for times, apart in self.distances
                if len(times) and time <= times[-1]
            ),
            default=None,
        )

    def times(self, fps: float, speed: float) -> Array:
        """When each frame is [s]: in even steps from the start, and at the end, which shows how it ended."""
        step = speed / fps
        steps = int(np.ceil(self.duration / step - 1e-9))
        return np.append(np.arange(steps) * step, self.duration)

    @property
    def worst_time(self) -> float:
        """When the load of the solid crane is farthest from its reference [s]."""
        return float(self.lead.run.time[int(np.argmax(self.lead.error))])


def film_of(runs: Mapping[str, Run]) -> Film:
    """The film of a log's runs; raises InputError if none has a sample."""
    drawn = [run for run in map(_drawable, runs.values()) if len(run.time_ns)]
    if not drawn:
        raise InputError(
            "the log holds no sample: its runs stopped before their first",
            allowed="logs of runs that began",
            remedy="cranectl info says why a run stopped",
        )
    solid = reference_plant(run.plant for run in drawn)
    cast = tuple(Actor(run, ghost=run.plant != solid) for run in drawn)
    return Film(cast, max(float(run.time[-1]) for run in drawn))


def _drawable(run: Run) -> Run:
    """The run without samples in which something is nowhere, as before a stop because of that."""
    places = np.hstack([run.block("state"), run.block("load")])
    kept = (np.abs(places) < FARTHEST).all(axis=1)
    if kept.all():
        return run
    return replace(run, time_ns=run.time_ns[kept], table=run.table[kept], reference=run.reference[kept])


def dashes(path: Array) -> Array:
    """A path (N, 3) as dashes, shape (M, 2, 3); longer ones where there would be too many."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    period = max(PERIOD, lengths[-1] / MOST_DASHES)
    starts = np.arange(0.0, lengths[-1], period)
    ends = np.minimum(starts + period * DASH / PERIOD, lengths[-1])
    corners = [np.column_stack([np.interp(s, lengths, axis) for axis in path.T]) for s in (starts, ends)]
    return np.stack(corners, axis=1)

"""Make the messages of runs that come in parts, those that a log of the whole runs would have.

Only the verdict over the whole run, `/diff/verdict`, is missing. The messages at the start of a log are sent
again for each start and each recording.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.log import scene
from cranectl.log.events import (
    Disturbed,
    Event,
    EventsOfParts,
    Phase,
    Saturated,
    StatusChange,
    disturbed,
    phases,
    saturation,
)
from cranectl.log.messages import design_info, differences, log_lines, run_info, samples, status
from cranectl.log.topics import Stream
from cranectl.scenario import NANOSECONDS, Drawing, Scenario
from cranectl.simulate import Plan, Run
from cranectl.status import RunStatus
from cranectl.support import Array, Provenance

# The value before anything is sent, so that the first value counts as a change.
NO_STATUS, NO_DISTURBANCE = np.full((1, 4), -1), np.full((1, 5), np.nan)


@dataclass
class _SentState:
    """The values already sent about one plant since its start, and its newest row."""

    trail: Array = field(default_factory=lambda: np.zeros((0, 3)))
    events: EventsOfParts = field(default_factory=EventsOfParts)
    status: NDArray[np.int64] = field(default_factory=lambda: NO_STATUS)  # as `_statuses` has it
    disturbance: Array = field(default_factory=lambda: NO_DISTURBANCE)
    newest: Run | None = None  # its newest row
    waiting: bool = False  # whether that row has not been sent


class LiveMessages:
    """Makes the messages of the runs of a live session, part by part.

    Parameters
    ----------
    scenario : Scenario
        What all plants run.
    plan : Plan
        Its reference.
    plants : sequence of str
        The plants.
    """

    def __init__(self, scenario: Scenario, plan: Plan, plants: Sequence[str]) -> None:
        self._scenario, self._plan, self._period = scenario, plan, scenario.period_ns
        self._opacities, self._scale = scene.opacities(plants), Drawing(scenario.rig).scale
        self._every = scenario.log.every
        logged = self._every * self._period / NANOSECONDS
        self._pose_step = self._every * max(1, round(1.0 / scene.RATE / logged))  # samples between poses
        # Samples between points of a trail.
        self._trail_step = self._every * max(1, round(scene.trail_step(scenario.rig) / logged))
        self._reference_ns = -1  # time of the newest desired value that was sent
        self.start()

    def start(self) -> None:
        """Start the scenario, or start it again."""
        self._shown = {plant: _SentState() for plant in self._opacities}
        self._phases = phases(self._scenario)

    def begin_hand_driving(self, time_ns: int) -> None:
        """Mark that driving by hand begins at `time_ns` since the start."""
        before = [phase for phase in self._phases if phase[0] < time_ns]
        self._phases = [*before, (time_ns, Phase.DRIVEN)]

    def opening_messages(self, runs: Sequence[Run], now_ns: int) -> list[Stream]:
        """Return the messages that a recording needs before its first increment: settings and scene."""
        for shown in self._shown.values():
            shown.status, shown.disturbance = NO_STATUS, NO_DISTURBANCE  # to be sent again
        whole = replace(
            runs[0],
            time_ns=np.arange(0, len(self._plan.time_ns), self._every) * self._period,
            reference=self._plan.reference[:: self._every],
        )
        streams = [
            run_info(runs, Provenance.now()),
            design_info(runs[0].design),
            scene.path(whole),
            scene.workspace(whole),
        ]
        streams += [
            scene.model(plant, self._scenario.rig, opacity) for plant, opacity in self._opacities.items()
        ]
        return [replace(stream, time_ns=np.full_like(stream.time_ns, now_ns)) for stream in streams]

    def messages(self, runs: Sequence[Run], origin_ns: int) -> list[Stream]:
        """Return the messages of the next part of each run; the scenario started at `origin_ns`."""
        events, changes = list[Event](), list[Stream]()
        for run in runs:
            shown = self._shown[run.plant]
            changes += self._changes(run, origin_ns)
            events += shown.events.of(run, origin_ns)
            if len(run.time_ns):
                shown.newest, shown.waiting = _select_rows(run, np.array([-1])), True
        logged = [_select_rows(run, self._rows(run, origin_ns, self._every)) for run in runs]
        logged = [run for run in logged if len(run.time_ns)]
        if not logged:
            return [log_lines(events), *changes]
        for run in logged:
            newest = self._shown[run.plant].newest
            self._shown[run.plant].waiting = newest is None or newest.time_ns[0] != run.time_ns[-1]
        return [log_lines(events), *changes, *self._samples(logged), *self._scene(logged, origin_ns)]

    def unsent_samples(self) -> list[Stream]:
        """Return the newest sample of each plant if it has not been sent, because a log ends with it."""
        waiting = [shown for shown in self._shown.values() if shown.waiting]
        for shown in waiting:
            shown.waiting = False
        return self._samples([shown.newest for shown in waiting if shown.newest is not None])

    def said(self, time_ns: int, message: str, *, warning: bool) -> list[Stream]:
        """Return a line of the session itself, which comes from no plant."""
        return [log_lines([Event(time_ns, "live", message, warning)])]

    def _samples(self, runs: Sequence[Run]) -> list[Stream]:
        """Return signals, differences between plants, and those values of the reference that are new."""
        if not runs:
            return []
        reference, *recorded = samples(runs)
        new = np.flatnonzero(reference.time_ns > self._reference_ns).tolist()
        self._reference_ns = max(self._reference_ns, int(reference.time_ns[-1]))
        messages = [reference.messages[k] for k in new]
        reference = replace(reference, time_ns=reference.time_ns[new], messages=messages)
        return [reference, *recorded, *differences(runs, [*self._opacities])]

    def _rows(self, run: Run, origin_ns: int, step: int) -> NDArray[np.intp]:
        """Return the indices of every `step`-th sample, and of the one at which a run stopped."""
        chosen = (run.time_ns - origin_ns) // self._period % step == 0
        if run.status.stopped:
            chosen[-1:] = True
        return np.flatnonzero(chosen)

    def _changes(self, run: Run, origin_ns: int) -> list[Stream]:
        """Return the messages about status and disturbances of a run, at the samples where they change."""
        shown = self._shown[run.plant]
        statuses, disturbance = self._statuses(run, origin_ns), _disturbances(run)
        times = run.time_ns.tolist()
        changes = [
            self._status(times[k], RunStatus.RUNNING, statuses[k])
            for k in _changed_rows(shown.status, statuses)
        ]
        edges = _changed_rows(shown.disturbance, disturbance)
        shown.status = np.vstack([shown.status, statuses])[-1:]
        shown.disturbance = np.vstack([shown.disturbance, disturbance])[-1:]
        if run.status.stopped and not shown.events.is_stopped:
            # The row is -1 if the run stopped before a status was sent.
            changes.append(self._status(run.end_ns, run.status, np.maximum(shown.status[0], 0)))
        streams = [status(run.plant, changes)] if changes else []
        if edges:
            rows, mass = disturbance[edges], run.scenario.rig.load_mass
            edge_times = [times[k] for k in edges]
            streams.append(scene.arrows(run.plant, edge_times, rows, mass=mass, scale=self._scale))
        return streams

    def _statuses(self, run: Run, origin_ns: int) -> NDArray[np.int64]:
        """Return columns (N, 4): inside the workspace, segment of the reference, Disturbed, Saturated."""
        inside = run.workspace_excess.max(axis=1) <= 0.0
        starts = [start for start, _ in self._phases]
        segment = np.searchsorted(starts, run.time_ns - origin_ns, side="right") - 1
        return np.column_stack([inside, segment, disturbed(_disturbances(run)), saturation(run)])

    def _status(self, time_ns: int, status: RunStatus, row: NDArray[np.int64]) -> StatusChange:
        inside, segment, acting, limited = row.tolist()
        phase = self._phases[segment][1]
        return StatusChange(time_ns, status, bool(inside), phase, Disturbed(acting), Saturated(limited))

    def _scene(self, logged: Sequence[Run], origin_ns: int) -> list[Stream]:
        """Return poses, ropes and trails."""
        leader = max(logged, key=lambda run: len(run.time_ns))
        moving = {run.plant: run for run in logged}
        drawn = [moving.get(plant, shown.newest) for plant, shown in self._shown.items()]
        rows = self._rows(leader, origin_ns, self._pose_step)
        streams = [scene.transforms([run for run in drawn if run is not None], leader, rows)]
        for run in logged:
            rows = self._rows(run, origin_ns, self._pose_step)
            shown, dots = self._shown[run.plant], self._rows(run, origin_ns, self._trail_step)
            trail = np.vstack([shown.trail, run.load_position[dots]])
            opacity = self._opacities[run.plant]
            streams.append(scene.rope(run, opacity, rows))
            streams.append(scene.trail(run.plant, run.time_ns[dots], trail, opacity))
            shown.trail = trail[-scene.TRAIL_POINTS :]
        return streams


def _disturbances(run: Run) -> Array:
    """Return the recorded disturbances, (N, 5) in the order of `Scenario.disturbances_at`."""
    return np.hstack([run.block("disturbance"), run.load_force])


def _select_rows(run: Run, rows: NDArray[np.intp]) -> Run:
    return replace(run, time_ns=run.time_ns[rows], table=run.table[rows], reference=run.reference[rows])


def _changed_rows(before: NDArray[Any], rows: NDArray[Any]) -> list[int]:
    """Return the indices of rows that differ from the row before; `before` (1, M) precedes the first."""
    changed: list[int] = np.flatnonzero((np.diff(rows, axis=0, prepend=before) != 0).any(axis=1)).tolist()
    return changed

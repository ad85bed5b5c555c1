"""Turn the pieces of a live session into messages: those that a log of the whole run would have.

Missing is the verdict over the whole run, `/diff/verdict`. What a log shows once at its start is shown again
for each start and each recording.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from cranectl.log import scene
from cranectl.log.events import (
    Disturbed,
    Event,
    Saturated,
    Standing,
    end_event,
    limit_events,
    rope_events,
    saturation,
    scenario_events,
    segments,
    workspace_events,
)
from cranectl.log.messages import design_info, differences, log_lines, run_info, samples, status
from cranectl.log.stream import Stream
from cranectl.metrics import workspace_excess
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.simulate import Plan, Run
from cranectl.status import RunStatus

Array = NDArray[np.float64]
JOINTS = ("alpha", "beta")


Key = tuple[bool, int, int, int]  # inside the workspace, number of the segment, Disturbed, Saturated


@dataclass
class _Seen:
    """What has been shown of one plant since its start."""

    trail: Array = field(default_factory=lambda: np.zeros((0, 3)))
    slack: bool = False
    limited: int = 0  # drives that have been at their limits, as `Saturated`
    outside: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(3, dtype=bool))
    key: Key | None = None
    acting: tuple[float, ...] | None = None
    newest: Run | None = None  # its newest row
    waiting: bool = False  # whether that row has not been sent
    stopped: bool = False


class Pieces:
    """Makes the messages of consecutive pieces of runs of one scenario."""

    def __init__(self, scenario: Scenario, plan: Plan, plants: Sequence[str]) -> None:
        self._scenario, self._plan, self._period = scenario, plan, scenario.period_ns
        self._opacities = scene.opacities(plants)
        self._every = scenario.log.every
        logged = self._every * self._period / NANOSECONDS
        self._pose = self._every * max(1, round(1.0 / scene.RATE / logged))  # samples between poses
        self._dot = self._every * max(1, round(scene.TRAIL_STEP / logged))  # between points of a trail
        self._segments = segments(scenario)
        self._starts = np.array([start for start, _ in self._segments])
        self._reference_ns = -1  # of the newest desired value that was sent
        self.start()

    def start(self) -> None:
        """The scenario starts, or starts again."""
        self._seen = {plant: _Seen() for plant in self._opacities}

    def standing(self, runs: Sequence[Run]) -> list[Stream]:
        """What shows what is run and where: all that a recording needs before its first piece."""
        for seen in self._seen.values():
            seen.key = seen.acting = None  # to be said again
        whole = replace(
            runs[0],
            time_ns=np.arange(0, len(self._plan.time_ns), self._every) * self._period,
            reference=self._plan.reference[:: self._every],
        )
        found = [run_info(runs), design_info(runs[0].design), scene.path(whole), scene.workspace(whole)]
        return found + [scene.model(plant, opacity) for plant, opacity in self._opacities.items()]

    def piece(self, runs: Sequence[Run], origin_ns: int) -> list[Stream]:
        """The messages of one piece of each plant's run; `origin_ns` is when the scenario was started."""
        found = [log_lines(event for run in runs for event in self._events(run, origin_ns))]
        for run in runs:
            found += self._changes(run, origin_ns)
            seen = self._seen[run.plant]
            seen.stopped = run.status.stopped
            if len(run.time_ns):
                seen.newest, seen.waiting = _chosen(run, np.array([-1])), True
        logged = [_chosen(run, self._rows(run, origin_ns, self._every)) for run in runs]
        logged = [run for run in logged if len(run.time_ns)]
        if not logged:
            return found
        for run in logged:
            newest = self._seen[run.plant].newest
            self._seen[run.plant].waiting = newest is None or newest.time_ns[0] != run.time_ns[-1]
        return found + self._samples(logged) + self._scene(logged, origin_ns)

    def last(self) -> list[Stream]:
        """The newest sample of each plant where it has not been sent: a log ends with it."""
        waiting = [seen for seen in self._seen.values() if seen.waiting]
        for seen in waiting:
            seen.waiting = False
        return self._samples([seen.newest for seen in waiting if seen.newest is not None])

    def _samples(self, runs: Sequence[Run]) -> list[Stream]:
        """Signals, differences, and what is desired: once, though the plants' samples may come apart."""
        if not runs:
            return []
        reference, *found = samples(runs)
        new = np.flatnonzero(reference.time_ns > self._reference_ns).tolist()
        self._reference_ns = max(self._reference_ns, int(reference.time_ns[-1]))
        messages = [reference.messages[k] for k in new]
        found.insert(0, replace(reference, time_ns=reference.time_ns[new], messages=messages))
        return found + (differences(runs, [*self._opacities]))

    def _rows(self, run: Run, origin_ns: int, step: int) -> NDArray[np.intp]:
        """Every `step`-th sample since the start, and that at which a run stopped."""
        chosen = (run.time_ns - origin_ns) // self._period % step == 0
        if run.status.stopped:
            chosen[-1:] = True
        return np.flatnonzero(chosen)

    def _events(self, run: Run, origin_ns: int) -> list[Event]:
        """What is worth a line in this piece."""
        seen, found = self._seen[run.plant], []
        if len(run.time_ns):
            if seen.newest is None:
                text = f"{self._scenario.name} with {run.design.name}, {run.drive} drives"
                found.append(Event(origin_ns, run.plant, text))
            before = seen.newest.time_ns[0] if seen.newest is not None else origin_ns - 1
            planned = [
                replace(event, time_ns=event.time_ns + origin_ns)
                for event in scenario_events(self._scenario, run.plant)
            ]
            found += [event for event in planned if before < event.time_ns <= run.time_ns[-1]]
            found += workspace_events(run, seen.outside)
            seen.outside = workspace_excess(run)[-1] > 0.0
            found += limit_events(run, seen.limited)
            found += rope_events(run, slack=seen.slack)
            seen.slack = bool(run.signal("load.rope_tension")[-1] <= 0.0)
            seen.limited |= int(np.bitwise_or.reduce(saturation(run)))
        if run.status.stopped and not seen.stopped:
            found.append(end_event(run))
        return found

    def _changes(self, run: Run, origin_ns: int) -> list[Stream]:
        """How the run stands and what pushes its load, where that changes."""
        seen = self._seen[run.plant]
        acting = [tuple(row) for row in run.block("disturbance").tolist()]
        keys = self._keys(run, origin_ns)
        times = run.time_ns.tolist()
        changed = zip(times, keys, [seen.key, *keys], strict=False)
        standings = [self._standing(time, RunStatus.RUNNING, key) for time, key, old in changed if key != old]
        pushes = [t for t in zip(times, acting, [seen.acting, *acting], strict=False) if t[1] != t[2]]
        if keys:
            seen.key, seen.acting = keys[-1], acting[-1]
        if run.status.stopped and not seen.stopped:
            standings.append(self._standing(run.end_ns, run.status, seen.key or (False, 0, 0, 0)))
        found = [status(run.plant, standings)] if standings else []
        if pushes:
            arrows = [[(j, a) for j, a in zip(JOINTS, now, strict=True) if a] for _, now, _ in pushes]
            found.append(scene.push(run.plant, [time for time, _, _ in pushes], arrows))
        return found

    def _keys(self, run: Run, origin_ns: int) -> list[Key]:
        """How the run stands at each sample."""
        inside = workspace_excess(run).max(axis=1) <= 0.0
        segment = np.searchsorted(self._starts, run.time_ns - origin_ns, side="right") - 1
        disturbed = (run.block("disturbance") != 0.0) @ np.array([1, 2])
        limited = saturation(run)
        return list(zip(inside.tolist(), segment.tolist(), disturbed.tolist(), limited.tolist(), strict=True))

    def _standing(self, time_ns: int, status: RunStatus, key: Key) -> Standing:
        inside, segment, disturbed, limited = key
        phase = self._segments[segment][1]
        return Standing(time_ns, status, inside, phase, Disturbed(disturbed), Saturated(limited))

    def _scene(self, logged: Sequence[Run], origin_ns: int) -> list[Stream]:
        """Poses, ropes and trails."""
        leader = max(logged, key=lambda run: len(run.time_ns))
        moving = {run.plant: run for run in logged}
        shown = [moving.get(plant, seen.newest) for plant, seen in self._seen.items()]
        rows = self._rows(leader, origin_ns, self._pose)
        found = [scene.transforms([run for run in shown if run is not None], leader, rows)]
        for run in logged:
            found.append(scene.cable(run, self._opacities[run.plant], self._rows(run, origin_ns, self._pose)))
            seen, dots = self._seen[run.plant], self._rows(run, origin_ns, self._dot)
            trail = np.vstack([seen.trail, run.load_position[dots]])
            found.append(scene.trail(run.plant, run.time_ns[dots], trail))
            seen.trail = trail[-scene.TRAIL_POINTS :]
        return found


def _chosen(run: Run, rows: NDArray[np.intp]) -> Run:
    return replace(run, time_ns=run.time_ns[rows], table=run.table[rows], reference=run.reference[rows])

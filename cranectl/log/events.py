"""What a viewer of a log wants to read in words: when a run started, was disturbed, left the rig, ended."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from cranectl.metrics import workspace_excess
from cranectl.scenario import NANOSECONDS
from cranectl.signals import WORKSPACE_SIGNALS
from cranectl.simulate import Run
from cranectl.status import RunStatus


@dataclass(frozen=True)
class Event:
    """Something worth a line in the log."""

    time_ns: int
    source: str
    message: str
    warning: bool = False


class Phase(IntEnum):
    """What the reference does."""

    HOLD = 0
    LINE = 1
    ARC = 2


class Disturbed(IntEnum):
    """Which cardan angles are disturbed, as the sum of 1 for alpha and 2 for beta."""

    NONE = 0
    ALPHA = 1
    BETA = 2
    ALPHA_AND_BETA = 3


@dataclass(frozen=True)
class Standing:
    """How a run stands from a time on."""

    time_ns: int
    status: RunStatus
    inside_workspace: bool
    phase: Phase
    disturbed: Disturbed


def standings(run: Run) -> list[Standing]:
    """At the start, at every change, and at the end."""
    inside: NDArray[np.bool_] = workspace_excess(run).max(axis=1) <= 0.0
    crossings = run.time_ns[1:][np.diff(inside)] if len(inside) else run.time_ns
    edges = {0, *(time for time, _ in _segments(run)), *(time for time, _, _ in _disturbance_edges(run))}
    times = sorted(edges | {int(time) for time in crossings})
    before_end = [time for time in times if time < run.end_ns]
    found = [_standing(run, time, RunStatus.RUNNING, inside) for time in before_end]
    return [*found, _standing(run, run.end_ns, run.status, inside)]


def _standing(run: Run, time_ns: int, status: RunStatus, inside: NDArray[np.bool_]) -> Standing:
    row = min(int(np.searchsorted(run.time_ns, time_ns)), len(inside) - 1)
    phase = [kind for start, kind in _segments(run) if start <= time_ns][-1]
    acting = {"alpha": 0, "beta": 0}
    for time, joint, change in _disturbance_edges(run):
        acting[joint] += change if time <= time_ns else 0
    disturbed = Disturbed((1 if acting["alpha"] else 0) + (2 if acting["beta"] else 0))
    return Standing(time_ns, status, bool(inside[row]) if len(inside) else False, phase, disturbed)


def _segments(run: Run) -> list[tuple[int, Phase]]:
    """Start [ns] and kind of each segment of the reference; the last point is held."""
    found, start = [], 0.0
    for segment in run.scenario.reference.segments:
        found.append((round(start * NANOSECONDS), Phase[segment.kind.upper()]))
        start += segment.duration
    return [*found, (round(start * NANOSECONDS), Phase.HOLD)]


def _disturbance_edges(run: Run) -> list[tuple[int, str, int]]:
    """(time [ns], joint, +1 on or -1 off) of each disturbance."""
    edges: list[tuple[int, str, int]] = []
    for step in run.scenario.disturbances:
        edges.append((round(step.start * NANOSECONDS), step.joint, 1))
        if step.end is not None:
            edges.append((round(step.end * NANOSECONDS), step.joint, -1))
    return edges


def events(run: Run) -> list[Event]:
    """The events of one run in the order of time."""
    found = [
        Event(0, run.plant, f"{run.scenario.name} with {run.design.name}, {run.drive} drives"),
        *_segment_events(run),
        *_disturbance_events(run),
        *_workspace_events(run),
    ]
    found = sorted(found, key=lambda event: event.time_ns)
    end = f"{run.status.label} at {run.end_ns / NANOSECONDS:g} s: {run.status.explanation}"
    return [*found, Event(run.end_ns, run.plant, end, warning=run.status.stopped)]


def _segment_events(run: Run) -> list[Event]:
    if not run.scenario.reference.segments:
        return []
    return [
        Event(time, run.plant, f"reference: {phase.name.lower()}")
        for time, phase in _segments(run)
        if time < run.end_ns
    ]


def _disturbance_events(run: Run) -> list[Event]:
    found = []
    for step in run.scenario.disturbances:
        name = f"disturbance of {step.magnitude:g} rad/s² on {step.joint}"
        for time, verb in ((step.start, "begins"), (step.end, "ends")):
            if time is not None and round(time * NANOSECONDS) < run.end_ns:
                found.append(Event(round(time * NANOSECONDS), run.plant, f"{name} {verb}"))
    return found


def _workspace_events(run: Run) -> list[Event]:
    found = []
    for name, excess in zip(WORKSPACE_SIGNALS, workspace_excess(run).T, strict=True):
        edges = np.diff((excess > 0.0).astype(np.int8), prepend=0)
        for k in np.flatnonzero(edges):
            verb = "leaves" if edges[k] > 0 else "is back in"
            text = f"{name} {verb} the workspace"
            found.append(Event(int(run.time_ns[k]), run.plant, text, warning=bool(edges[k] > 0)))
    return found

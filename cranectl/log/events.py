"""What a viewer of a log wants to read in words: when a run started, was disturbed, left the rig, ended."""

from dataclasses import dataclass

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


@dataclass(frozen=True)
class StatusChange:
    """The run's status from this time on."""

    time_ns: int
    status: RunStatus
    inside_workspace: bool


def status_changes(run: Run) -> list[StatusChange]:
    """Start, every crossing of the workspace limit, end."""
    inside: NDArray[np.bool_] = workspace_excess(run).max(axis=1) <= 0.0
    changed = np.flatnonzero(np.diff(inside, prepend=~inside[:1]))
    changes = [StatusChange(int(run.time_ns[k]), RunStatus.RUNNING, bool(inside[k])) for k in changed]
    last = bool(inside[-1]) if len(inside) else False
    return [*changes, StatusChange(run.end_ns, run.status, last)]


def events(run: Run) -> list[Event]:
    """The events of one run in the order of time."""
    found = [
        Event(0, run.plant, f"{run.scenario.name} with {run.design.name}, {run.drive} drives"),
        *_disturbance_events(run),
        *_workspace_events(run),
    ]
    found = sorted(found, key=lambda event: event.time_ns)
    end = f"{run.status.label} at {run.end_ns / NANOSECONDS:g} s: {run.status.explanation}"
    return [*found, Event(run.end_ns, run.plant, end, warning=run.status.stopped)]


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

"""What a viewer of a log wants to read in words: when a run started, was disturbed, left the rig, ended."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from cranectl.metrics import workspace_excess
from cranectl.scenario import NANOSECONDS, Scenario
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


class Saturated(IntEnum):
    """Which drives' limits act, as the sum of 1 for the bridge, 2 for the trolley and 4 for the rope.

    Protobuf wants names that no other enumeration of a message has.
    """

    UNSATURATED = 0
    BRIDGE = 1
    TROLLEY = 2
    BRIDGE_AND_TROLLEY = 3
    ROPE = 4
    BRIDGE_AND_ROPE = 5
    TROLLEY_AND_ROPE = 6
    ALL = 7


@dataclass(frozen=True)
class Standing:
    """How a run stands from a time on."""

    time_ns: int
    status: RunStatus
    inside_workspace: bool
    phase: Phase
    disturbed: Disturbed
    saturated: Saturated


def saturation(run: Run) -> NDArray[np.int64]:
    """`Saturated` at every sample, shape (N,)."""
    if "command" not in (group.name for group in run.groups):
        return np.zeros(len(run.time_ns), dtype=np.int64)
    acting: NDArray[np.int64] = (run.block("command")[:, 3:] > 0.0) @ np.array([1, 2, 4])
    return acting


def standings(run: Run) -> list[Standing]:
    """At the start, at every change, and at the end."""
    inside: NDArray[np.bool_] = workspace_excess(run).max(axis=1) <= 0.0
    limited = saturation(run)
    crossings = run.time_ns[1:][np.diff(inside) | (np.diff(limited) != 0)] if len(inside) else run.time_ns
    edges = {
        0,
        *(time for time, _ in segments(run.scenario)),
        *(time for time, _, _ in disturbance_edges(run.scenario)),
    }
    times = sorted(edges | {int(time) for time in crossings})
    before_end = [time for time in times if time < run.end_ns]
    found = [_standing(run, time, RunStatus.RUNNING, inside, limited) for time in before_end]
    return [*found, _standing(run, run.end_ns, run.status, inside, limited)]


def _standing(
    run: Run, time_ns: int, status: RunStatus, inside: NDArray[np.bool_], limited: NDArray[np.int64]
) -> Standing:
    row = min(int(np.searchsorted(run.time_ns, time_ns)), len(inside) - 1)
    phase = [kind for start, kind in segments(run.scenario) if start <= time_ns][-1]
    acting = {"alpha": 0, "beta": 0}
    for time, joint, change in disturbance_edges(run.scenario):
        acting[joint] += change if time <= time_ns else 0
    disturbed = Disturbed((1 if acting["alpha"] else 0) + (2 if acting["beta"] else 0))
    within, cut = (bool(inside[row]), int(limited[row])) if len(inside) else (False, 0)
    return Standing(time_ns, status, within, phase, disturbed, Saturated(cut))


def segments(scenario: Scenario) -> list[tuple[int, Phase]]:
    """Start [ns] and kind of each segment of the reference; the last point is held."""
    found, start = [], 0.0
    for segment in scenario.reference.segments:
        found.append((round(start * NANOSECONDS), Phase[segment.kind.upper()]))
        start += segment.duration
    return [*found, (round(start * NANOSECONDS), Phase.HOLD)]


def disturbance_edges(scenario: Scenario) -> list[tuple[int, str, int]]:
    """(time [ns], joint, +1 on or -1 off) of each disturbance."""
    edges: list[tuple[int, str, int]] = []
    for step in scenario.disturbances:
        edges.append((round(step.start * NANOSECONDS), step.joint, 1))
        if step.end is not None:
            edges.append((round(step.end * NANOSECONDS), step.joint, -1))
    return edges


def events(run: Run) -> list[Event]:
    """The events of one run in the order of time."""
    planned = [event for event in scenario_events(run.scenario, run.plant) if event.time_ns < run.end_ns]
    found = [
        Event(0, run.plant, f"{run.scenario.name} with {run.design.name}, {run.drive} drives"),
        *planned,
        *workspace_events(run, np.zeros(3, dtype=bool)),
        *limit_events(run, 0),
        *rope_events(run, slack=False),
    ]
    return [*sorted(found, key=lambda event: event.time_ns), end_event(run)]


def end_event(run: Run) -> Event:
    """How and why a run ended."""
    end = f"{run.status.label} at {run.end_s:g} s: {run.status.explanation}"
    return Event(run.end_ns, run.plant, end, warning=run.status.stopped)


def scenario_events(scenario: Scenario, plant: str) -> list[Event]:
    """What is bound to happen: segments of the reference, then disturbances."""
    found = []
    if scenario.reference.segments:
        for time_ns, phase in segments(scenario):
            found.append(Event(time_ns, plant, f"reference: {phase.name.lower()}"))
    for step in scenario.disturbances:
        name = f"disturbance of {step.magnitude:g} rad/s² on {step.joint}"
        for time, verb in ((step.start, "begins"), (step.end, "ends")):
            if time is not None:
                found.append(Event(round(time * NANOSECONDS), plant, f"{name} {verb}"))
    return found


def limit_events(run: Run, before: int) -> list[Event]:
    """When each drive reaches its limits for the first time; `before` says as `Saturated` which had already.

    Later times are in the status: they can be as many as samples.
    """
    found, limited = [], saturation(run)
    for bit, drive in enumerate(("bridge", "trolley", "rope")):
        acting = np.flatnonzero(limited & (1 << bit))
        if len(acting) and not before & (1 << bit):
            time_ns = int(run.time_ns[acting[0]])
            found.append(Event(time_ns, run.plant, f"the {drive} drive reaches its limits", warning=True))
    return found


def rope_events(run: Run, *, slack: bool) -> list[Event]:
    """When the rope goes slack and when it pulls again; `slack` says whether it was before."""
    now = run.signal("load.rope_tension") <= 0.0
    found = []
    for k in np.flatnonzero(np.diff(now.astype(np.int8), prepend=np.int8(slack))):
        text = "the rope goes slack" if now[k] else "the rope pulls again"
        found.append(Event(int(run.time_ns[k]), run.plant, text, warning=bool(now[k])))
    return found


def workspace_events(run: Run, outside: NDArray[np.bool_]) -> list[Event]:
    """When bridge, trolley and rope cross their limits; `outside` (3,) says which were outside before."""
    found = []
    for name, excess, before in zip(WORKSPACE_SIGNALS, workspace_excess(run).T, outside, strict=True):
        edges = np.diff((excess > 0.0).astype(np.int8), prepend=np.int8(before))
        for k in np.flatnonzero(edges):
            verb = "leaves" if edges[k] > 0 else "is back in"
            text = f"{name} {verb} the workspace"
            found.append(Event(int(run.time_ns[k]), run.plant, text, warning=bool(edges[k] > 0)))
    return found

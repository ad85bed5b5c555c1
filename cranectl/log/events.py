"""Describe a run in words and states for viewers: its start, disturbances, violations and end."""

from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.scenario import Scenario, Segment, Spline, nanoseconds
from cranectl.signals import State
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import Array, Quantity

DIGEST_DIGITS = 12  # of the digest of a file


@dataclass(frozen=True)
class Event:
    """One line of the log's text topic."""

    time_ns: int  # [ns]
    source: str  # the plant, or "live"
    message: str  # for people
    warning: bool = False  # whether it is shown as a warning


# Kind of the reference's present segment; planned and fitted ones have the requested kind, and ADDED comes
# from another package. Logs hold the numbers, so new kinds come last.
Phase = IntEnum("Phase", "HOLD LINE ARC ADDED MOVE WAYPOINTS SAMPLES SPLINE DRIVEN PATH", start=0)
# Which disturbances act: the sum of 1 for alpha, 2 for beta and 4 for a force on the load.
Disturbed = IntEnum(
    "Disturbed",
    "NONE ALPHA BETA ALPHA_AND_BETA FORCE ALPHA_AND_FORCE BETA_AND_FORCE ALPHA_BETA_AND_FORCE",
    start=0,
)
# Which drives' limits act: the sum of 1 for the bridge, 2 for the trolley and 4 for the rope. In protobuf no
# two enumerations of a message may share a name, hence UNSATURATED beside NONE.
Saturated = IntEnum(
    "Saturated",
    "UNSATURATED BRIDGE TROLLEY BRIDGE_AND_TROLLEY ROPE BRIDGE_AND_ROPE TROLLEY_AND_ROPE ALL",
    start=0,
)


@dataclass(frozen=True)
class StatusChange:
    """The status of a run from a time on."""

    time_ns: int  # [ns]
    status: RunStatus  # from then on
    inside_workspace: bool  # whether all axes are in their ranges
    phase: Phase  # of the reference
    disturbed: Disturbed  # which disturbances act
    saturated: Saturated  # which drives' limits act


class Conditions(NamedTuple):
    """Conditions at the end of a part of a run, whose beginning the log's text already reports."""

    outside: tuple[bool, ...] = (False,) * 3  # whether bridge, trolley and rope are outside their ranges
    limited: int = 0  # drives that have reached their limits at any time, as `Saturated`
    slack: bool = False  # whether the rope was slack


def saturation(run: Run) -> NDArray[np.int64]:
    """Return `Saturated` at every sample, shape (N,)."""
    flags = run.block("command")[:, 3:] if run.has("command") else np.zeros((len(run.time_ns), 0))
    if not flags.shape[1]:
        return np.zeros(len(run.time_ns), dtype=np.int64)
    acting: NDArray[np.int64] = (flags > 0.0) @ np.array([1, 2, 4])
    return acting


def status_changes(run: Run) -> list[StatusChange]:
    """Return the status of a run at its start, at every change, and at its end."""
    inside: NDArray[np.bool_] = run.workspace_excess.max(axis=1) <= 0.0
    limited = saturation(run)
    crossings = run.time_ns[1:][np.diff(inside) | (np.diff(limited) != 0)] if len(inside) else run.time_ns
    times = {0, *(time for time, _ in phases(run.scenario)), *disturbance_times(run.scenario)}
    times |= set(crossings.tolist())

    def at(time_ns: int, status: RunStatus) -> StatusChange:
        row = min(int(np.searchsorted(run.time_ns, time_ns)), len(inside) - 1)
        phase = [phase for start, phase in phases(run.scenario) if start <= time_ns][-1]
        acting = Disturbed(int(disturbed(run.scenario.disturbances_at(np.array([time_ns])))[0]))
        within, saturated = (bool(inside[row]), int(limited[row])) if len(inside) else (False, 0)
        return StatusChange(time_ns, status, within, phase, acting, Saturated(saturated))

    before_end = [at(time, RunStatus.RUNNING) for time in sorted(times) if time < run.end_ns]
    return [*before_end, at(run.end_ns, run.status)]


def phases(scenario: Scenario) -> list[tuple[int, Phase]]:
    """Return start [ns] and kind of each segment of the reference, and of the hold after the last one."""
    starts, start = [], 0.0
    for segment in scenario.reference.segments:
        starts.append((nanoseconds(start), _phase(segment)))
        start += segment.seconds
    return [*starts, (nanoseconds(start), Phase.HOLD)]


def _phase(segment: Segment) -> Phase:
    made_from = segment.made_from if isinstance(segment, Spline) else {}
    kind = str(made_from.get("kind", segment.kind))
    return Phase.__members__.get(kind.upper(), Phase.ADDED)


def disturbance_times(scenario: Scenario) -> set[int]:
    """Return the times at which disturbances begin and end [ns]."""
    times = [time for step in scenario.disturbances for time in (step.start, step.end)]
    return {nanoseconds(time) for time in times if time is not None}


def disturbed(disturbances: Array) -> NDArray[np.int64]:
    """Return `Disturbed` (N,) of disturbances (N, 5) in the order of `Scenario.disturbances_at`."""
    angles, force = disturbances[:, :2] != 0.0, (disturbances[:, 2:] != 0.0).any(axis=1)
    acting: NDArray[np.int64] = angles @ np.array([1, 2]) + 4 * force
    return acting


def events(run: Run) -> list[Event]:
    """Return the events of one run in the order of time."""
    return sorted(EventsOfParts().of(run, 0, is_whole=True), key=lambda event: event.time_ns)


@dataclass
class EventsOfParts:
    """Finds the events of a run, or of parts of it that come one after the other."""

    newest_ns: int | None = None  # time of the newest sample
    conditions: Conditions = field(default_factory=Conditions)
    is_stopped: bool = False

    def of(self, run: Run, origin_ns: int, *, is_whole: bool = False) -> list[Event]:
        """Return the events of the next part, or of a whole run; its scenario started at `origin_ns`."""
        # One less, so that events at the very start are after it.
        found, before = [], origin_ns - 1 if self.newest_ns is None else self.newest_ns
        if is_whole or (self.newest_ns is None and len(run.time_ns)):
            start = f"{run.scenario.name} with {run.design.name}, {run.drive} drives"
            found.append(Event(origin_ns, run.plant, start))
        last = run.end_ns - 1 if is_whole else int(run.time_ns[-1:].max(initial=before))
        planned = [
            replace(event, time_ns=event.time_ns + origin_ns)
            for event in _scenario_events(run.scenario, run.plant)
        ]
        found += [event for event in planned if before < event.time_ns <= last]
        observed, self.conditions = _condition_events(run, self.conditions)
        found += observed
        if is_whole or (run.status.stopped and not self.is_stopped):
            end = f"{run.status.label} at {run.end_s:g} s: {run.status.explanation}"
            found.append(Event(run.end_ns, run.plant, end, warning=run.status.stopped))
        self.is_stopped = run.status.stopped
        if len(run.time_ns):
            self.newest_ns = last
        return found


def _scenario_events(scenario: Scenario, plant: str) -> list[Event]:
    """Return the planned events: segments of the reference, then disturbances."""
    planned = []
    if scenario.reference.segments:
        origin_by_name = origins(scenario)
        for k, (time_ns, phase) in enumerate(phases(scenario)):
            origin = origin_by_name.get(f"segment {k}", phase.name.lower())
            planned.append(Event(time_ns, plant, f"reference: {origin}"))
    for step in scenario.disturbances:
        for time, verb in ((step.start, "begins"), (step.end, "ends")):
            if time is not None:
                planned.append(Event(nanoseconds(time), plant, f"{step} {verb}"))
    return planned


def _condition_events(run: Run, before: Conditions) -> tuple[list[Event], Conditions]:
    """Return events of axes that leave the workspace, drives at their limits, and a slack rope.

    Axes and rope have another event when they recover. Each drive has one event only, at its first limit,
    since there could be as many as samples; the status has all of them. `before` are the conditions at the
    start. The result has the conditions at the end too, for the events of the next part of the run.
    """
    if not len(run.time_ns):
        return [], before
    observed: list[Event] = []
    outside, limited = run.workspace_excess > 0.0, saturation(run)
    slack = run.tension <= 0.0 if run.has_tension else np.zeros(len(run.time_ns), dtype=np.bool_)
    for name, axis, was in zip(State.AXIS_NAMES, outside.T, before.outside, strict=True):
        texts = f"{name} leaves the workspace", f"{name} is back in the workspace"
        observed += _changes(run, axis, was, *texts)
    for bit, drive in enumerate(("bridge", "trolley", "rope")):
        acting = np.flatnonzero(limited & (1 << bit))
        if len(acting) and not before.limited & (1 << bit):
            time_ns = int(run.time_ns[acting[0]])
            observed.append(Event(time_ns, run.plant, f"the {drive} drive reaches its limits", warning=True))
    observed += _changes(run, slack, before.slack, "the rope goes slack", "the rope pulls again")
    reached = before.limited | int(np.bitwise_or.reduce(limited))
    return observed, Conditions(tuple(outside[-1].tolist()), reached, bool(slack[-1]))


def _changes(run: Run, holds: NDArray[np.bool_], before: bool, begins: str, ends: str) -> list[Event]:
    """Return a warning at each sample where a condition begins, and an event where it ends."""
    return [
        Event(int(run.time_ns[k]), run.plant, begins if holds[k] else ends, warning=bool(holds[k]))
        for k in np.flatnonzero(np.diff(holds.astype(np.int8), prepend=np.int8(before)))
    ]


def origins(scenario: Scenario) -> dict[str, str]:
    """Return the file of each segment, and the claim of its plan, by names such as `segment 0`.

    Segments without either are left out.
    """
    texts = {f"segment {k}": _origin(segment) for k, segment in enumerate(scenario.reference.segments)}
    return {name: text for name, text in texts.items() if text}


def _origin(segment: Segment) -> str:
    file = _file_of(segment) if isinstance(segment, Spline) and segment.source else ""
    return "; ".join(filter(None, (file, segment.claim)))


def _file_of(spline: Spline) -> str:
    source, fit = spline.source, spline.fit
    assert source is not None
    where = "held here" if spline.held else "not held here"
    digest = source.sha256[:DIGEST_DIGITS]
    file = f"{spline.made_from.get('kind')} from {source.file} (SHA-256 {digest}, {where})"
    if fit is None:
        return f"{file}: {len(spline.breaks)} points"
    left_out, residual = (Quantity(error, "m").text() for error in (fit.left_out_error, fit.residual))
    return (
        f"{file}: {fit.samples} samples, {fit.spans} spans; samples left out are {left_out} rms from it, all "
        f"others {residual}; z'''' up to {fit.peak_d4:.3g} ± {fit.band_d4:.2g} m/s⁴"
    )

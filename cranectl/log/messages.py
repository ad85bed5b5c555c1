"""Make the messages of a log from runs: one stream for each topic."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from foxglove.messages import Log, LogLevel
from numpy.typing import NDArray

from cranectl.compare import Agreement, PairLimits, compare_runs, judge
from cranectl.design import ControllerDesign
from cranectl.log.events import Event, StatusChange, events, status_changes
from cranectl.log.scene import scene_streams, timestamp_of
from cranectl.log.topics import (
    DIFFERENCE_GROUPS,
    PACKAGE,
    STATUS_FIELDS,
    Stream,
    Topics,
    channel_metadata,
    encode,
    group_schema,
    record_schema,
)
from cranectl.mcap_columns import EncodedRows
from cranectl.signals import SignalGroup
from cranectl.simulate import Run
from cranectl.support import Provenance, Quantity

MIN_DISTANCE = 1e-14  # [m, rad] least logged distance: the size of rounding, so that logarithms exist


def streams(
    runs: Sequence[Run], limits: PairLimits | None = None, versions: Mapping[str, str] | None = None
) -> list[Stream]:
    """Return the streams of all topics of a log; at equal times earlier streams come first in the file.

    Plants are judged by `limits`, by default those of `judge`. `versions` are those of the software that made
    the runs, by default the installed one.
    """
    result = [run_info(runs, versions or Provenance.now()), design_info(runs[0].design)]
    result.append(log_lines(event for run in runs for event in events(run)))
    result += [status(run.plant, status_changes(run)) for run in runs]
    result += samples(runs)
    for a, b in Agreement.pairs(runs):
        name = a.plant if len(runs) > 2 else ""
        if differing := _differences(a, b, name):
            verdict = _verdict(a, b, limits=limits)
            result += [*differing, _text(Topics.difference("verdict", name), "Verdict", verdict)]
    return result + scene_streams(runs)


def samples(runs: Sequence[Run]) -> list[Stream]:
    """Return the reference, if any, at all times at which a run has a sample, and all signals of the runs."""
    result = []
    if runs[0].has_reference:
        time_ns, rows = np.unique(np.concatenate([run.time_ns for run in runs]), return_index=True)
        reference = np.concatenate([run.reference for run in runs])[rows]
        result.append(signals(Topics.REFERENCE, SignalGroup.REFERENCE, time_ns, reference))
    return result + [stream for run in runs for stream in recorded(run)]


def recorded(run: Run) -> Iterator[Stream]:
    """Yield the signals of a run."""
    for group in run.groups:
        yield signals(Topics(run.plant).of(group.name), group, run.time_ns, run.block(group.name))


def signals(
    topic: str, group: SignalGroup, time_ns: NDArray[np.int64], values: NDArray[np.float64]
) -> Stream:
    """Return the stream of a signal group; `values` (N, signals) belong to `time_ns` (N,)."""
    kind, rows = group_schema(group), EncodedRows(values)
    return Stream(topic, f"{PACKAGE}.{group.schema}", kind, time_ns, rows, channel_metadata(group))


def differences(runs: Sequence[Run], plants: Sequence[str]) -> list[Stream]:
    """Return the differences of the runs from that of the reference plant, among all `plants` of the log."""
    pairs = Agreement.pairs(runs, plants)
    return [s for a, b in pairs for s in _differences(a, b, a.plant if len(plants) > 2 else "")]


def _differences(a: Run, b: Run, name: str) -> list[Stream]:
    """Return differences and distances at the common times, if there are any; topics are called by `name`."""
    time_ns, in_a, in_b = np.intersect1d(a.time_ns, b.time_ns, return_indices=True)
    if not len(time_ns):
        return []
    result = []
    for group in DIFFERENCE_GROUPS:
        difference = b.block(group.name)[in_b] - a.block(group.name)[in_a]
        result.append(signals(Topics.difference(group.name, name), group, time_ns, difference))
    return [*result, distances(Topics.difference(Topics.DISTANCE.name, name), a, b)]


def distances(topic: str, a: Run, b: Run) -> Stream:
    """Return the distances, at least MIN_DISTANCE, of two runs with angles and loads at common times."""
    time_ns, in_a, in_b = np.intersect1d(a.time_ns, b.time_ns, return_indices=True)
    load = np.linalg.norm(b.load_position[in_b] - a.load_position[in_a], axis=1)
    angles = np.abs(b.angles[in_b] - a.angles[in_a]).max(axis=1)
    return signals(topic, Topics.DISTANCE, time_ns, np.column_stack([load, angles]).clip(MIN_DISTANCE))


def _verdict(a: Run, b: Run, *, limits: PairLimits | None) -> dict[str, str]:
    """Return in words whether the plants agree, and the difference of every signal."""
    comparison = compare_runs(a, b)
    agreement = judge(a, b, limits=(limits or {}).get((a.plant, b.plant)), comparison=comparison)
    values = {
        "verdict": agreement.verdict,
        "load": _with_limit(agreement.max_load_error_m, agreement.limit_m, "m", agreement.limits),
        "angles": _with_limit(agreement.max_angle_error_rad, agreement.limit_rad, "rad", agreement.limits),
    }
    for row in comparison.signals:
        largest, mean = (Quantity(value).si_difference() for value in (row.max_abs, row.rms))
        text = f"at most {largest} {row.unit}, RMS {mean}"
        text += "" if row.max_abs < Quantity.PROCESSOR_ROUNDING else f", largest at {row.at_s:g} s"
        values[row.signal.replace(".", "_")] = text
    return values


def _with_limit(largest: float, limit: float | None, unit: str, limits: str) -> str:
    """Return the largest distance with its limit, or with the reason why it has none."""
    limit_text = f"no limit: {limits}" if limit is None else f"limit {limit:g} {unit}"
    return f"{Quantity(largest).si_difference()} {unit}, {limit_text}"


def status(plant: str, changes: Sequence[StatusChange]) -> Stream:
    """Return the stream of the status of the run of `plant`."""
    times = [change.time_ns for change in changes]
    return _own(Topics(plant).status, "Status", STATUS_FIELDS, times, map(vars, changes))


def log_lines(unordered: Iterable[Event]) -> Stream:
    """Return the stream of events as text, in the order of time."""
    ordered = sorted(unordered, key=lambda event: event.time_ns)
    messages = (
        Log(
            timestamp=timestamp_of(event.time_ns),
            level=LogLevel.Warning if event.warning else LogLevel.Info,
            name=event.source,
            message=event.message,
        )
        for event in ordered
    )
    return Stream.of(Topics.LOG, Log, [event.time_ns for event in ordered], messages)


def run_info(runs: Sequence[Run], versions: Mapping[str, str]) -> Stream:
    """Return names, plants and status of the runs, and the software that made them."""
    first = runs[0]
    values = {
        "scenario": first.scenario.name,
        "title": first.scenario.title,
        "controller": first.design.name,
        "drive": first.drive,
        "plants": ", ".join(run.plant for run in runs),
        "status": ", ".join(f"{run.plant}: {run.status.label}" for run in runs),
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
    }
    return _text(Topics.RUN_INFO, "RunInfo", values)


def design_info(design: ControllerDesign) -> Stream:
    """Return the controller's design as JSON texts: gains, poles and margins, or its parameters."""
    values = {name: json.dumps(value) for name, value in design.to_json().items()}
    return _text(Topics.DESIGN, "Design", values)


def _text(topic: str, name: str, values: dict[str, str]) -> Stream:
    """Return a stream of one message of strings at time 0."""
    return _own(topic, name, dict.fromkeys(values, str), [0], [values])


def _own(
    topic: str, name: str, fields: Mapping[str, type], times: list[int], rows: Iterable[dict[str, Any]]
) -> Stream:
    """Return messages of our type `name` at their times [ns]; each has the `fields` of one of `rows`."""
    definition = record_schema(name, tuple(fields.items()))
    messages = [encode(definition, name, {field: row[field] for field in fields}) for row in rows]
    time_ns = np.array(times, dtype=np.int64)
    return Stream(topic, f"{PACKAGE}.{name}", definition, time_ns, messages)

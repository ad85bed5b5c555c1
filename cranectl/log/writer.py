"""Write runs to MCAP: protobuf messages, everything needed to understand and repeat the run inside.

The file is written beside its place as `.part` and renamed once it is closed and checked. Time is
simulation time, no wall clock goes in: the same runs give the same bytes.
"""

import contextlib
import importlib.metadata
import json
import platform
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import foxglove
import numpy as np
from foxglove.channels import LogChannel
from foxglove.mcap import MCAPWriteOptions
from foxglove.messages import Log, LogLevel, Timestamp
from mcap.reader import make_reader

from cranectl.errors import LogError
from cranectl.log import schema, topics
from cranectl.log.events import events, status_changes
from cranectl.scenario import NANOSECONDS
from cranectl.signals import REFERENCE, SignalGroup
from cranectl.simulate import Run

# Small chunks: after a kill nearly everything can be salvaged, for 0.2 % more size.
CHUNK_SIZE = 64 * 1024
VERSIONED = ("cranectl", "mujoco", "numpy", "scipy", "numba", "control", "foxglove-sdk")

RUN_INFO_FIELDS = ("scenario", "title", "controller", "drive", "plants", "status", "versions")

# Sends one message at a simulation time.
Send = Callable[[int], None]


def check_writable(path: Path) -> None:
    """Raise LogError now rather than after the simulation if `path` cannot be written."""
    part = _part(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.touch()
        part.unlink()
        if path.is_dir():
            raise IsADirectoryError(f"{path} is a directory")
    except OSError as error:
        raise _unwritable(path, error) from None


def write_log(path: str | Path, runs: Sequence[Run], *, every: int | None = None) -> Path:
    """Write one or two runs of the same scenario, design and drive to `path`.

    `every`: log every n-th control sample, by default as the scenario says; the last sample always.
    Returns `path`; raises LogError if it cannot be written.
    """
    path = Path(path)
    check_writable(path)
    part = _part(path)
    every = every or runs[0].scenario.log.every
    try:
        _write(part, [run.every(every) for run in runs], every)
        part.replace(path)
    except (OSError, RuntimeError) as error:
        raise _unwritable(path, error) from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
    return path


def _write(part: Path, runs: Sequence[Run], every: int) -> None:
    # The writer's channels die with the context: it must stay referenced until the file is closed.
    context = foxglove.Context()
    options = MCAPWriteOptions(chunk_size=CHUNK_SIZE, compression_threads=0, profile="cranectl")
    with foxglove.open_mcap(part, allow_overwrite=True, context=context, writer_options=options) as file:
        _write_header(file, runs, every)
        dense = _dense_messages(context, runs)
        sparse = sorted(_sparse_messages(context, runs), key=lambda message: message[0])
        sent = _send_in_order(runs, dense, sparse)
    del context
    _check_complete(part, sent)


def _write_header(file: foxglove.MCAPWriter, runs: Sequence[Run], every: int) -> None:
    first = runs[0]
    file.write_metadata(
        "cranectl",
        {
            "format": topics.FORMAT_VERSION,
            "scenario": first.scenario.name,
            "controller": first.design.name,
            "drive": first.drive,
            "plants": ",".join(run.plant for run in runs),
            "every": str(every),
        },
    )
    file.write_metadata("versions", _versions())
    for run in runs:
        status = {"status": run.status.label, "end_ns": str(run.end_ns)}
        file.write_metadata(f"run/{run.plant}", {**status, "samples": str(len(run.time_ns))})
    _attach_json(file, "scenario.json", first.scenario.model_dump(mode="json"))
    _attach_json(file, "parameters.json", first.scenario.rig.model_dump(mode="json"))
    _attach_json(file, "design.json", first.design.to_json())
    for run in runs:
        xml = run.model.lstrip().startswith("<")
        name = f"{run.plant}.xml" if xml else f"{run.plant}.txt"
        media_type = "application/xml" if xml else "text/plain"
        _attach(file, name, media_type, run.model)


def _attach_json(file: foxglove.MCAPWriter, name: str, data: dict[str, Any]) -> None:
    _attach(file, name, "application/json", json.dumps(data, indent=2, ensure_ascii=False))


def _attach(file: foxglove.MCAPWriter, name: str, media_type: str, text: str) -> None:
    file.attach(log_time=0, create_time=0, name=name, media_type=media_type, data=text.encode())


def _versions() -> dict[str, str]:
    found = {name: importlib.metadata.version(name) for name in VERSIONED}
    return {"python": platform.python_version(), **found}


def _dense_messages(
    context: foxglove.Context, runs: Sequence[Run]
) -> list[tuple[dict[int, int], Callable[..., None], list[bytes]]]:
    """(row of each time, channel's log function, messages) for every topic with a message a sample."""
    longest = max(runs, key=lambda run: len(run.time_ns))
    streams = [(longest.time_ns, topics.REFERENCE_LOAD, REFERENCE, longest.reference)]
    for run in runs:
        for group in run.groups:
            topic = topics.plant_topic(run.plant, group.name)
            streams.append((run.time_ns, topic, group, run.block(group.name)))
    if len(runs) == 2:
        streams += _difference_streams(*runs)
    dense = []
    for time_ns, topic, group, values in streams:
        rows = {time: row for row, time in enumerate(time_ns.tolist())}
        log = _channel(context, topic, group).log
        dense.append((rows, log, schema.encode_rows(values)))
    return dense


def _difference_streams(a: Run, b: Run) -> Iterator[tuple[Any, str, SignalGroup, Any]]:
    time_ns, in_a, in_b = np.intersect1d(a.time_ns, b.time_ns, return_indices=True)
    for group in topics.DIFFERENCE_GROUPS:
        values = b.block(group.name)[in_b] - a.block(group.name)[in_a]
        yield time_ns, topics.difference_topic(group.name), group, values


def _channel(context: foxglove.Context, topic: str, group: SignalGroup) -> foxglove.Channel:
    return foxglove.Channel(
        topic,
        message_encoding="protobuf",
        schema=_protobuf(group.schema, schema.group_schema(group)),
        metadata=topics.units(group),
        context=context,
    )


def _protobuf(name: str, data: bytes) -> foxglove.Schema:
    return foxglove.Schema(name=f"{schema.PACKAGE}.{name}", encoding="protobuf", data=data)


def _sparse_messages(context: foxglove.Context, runs: Sequence[Run]) -> list[tuple[int, Send]]:
    """(time, function that sends the message at a given time) of everything that is rare."""
    found = [_run_info(context, runs), _design(context, runs[0])]
    log = LogChannel(topics.LOG, context=context)
    for run in runs:
        for event in events(run):
            message = Log(
                timestamp=Timestamp(*divmod(event.time_ns, NANOSECONDS)),
                level=LogLevel.Warning if event.warning else LogLevel.Info,
                name=event.source,
                message=event.message,
            )
            found.append((event.time_ns, partial(_send_log, log, message)))
        found += _status_messages(context, run)
    return found


def _status_messages(context: foxglove.Context, run: Run) -> list[tuple[int, Send]]:
    definition = schema.status_schema()
    channel = foxglove.Channel(
        topics.status_topic(run.plant),
        message_encoding="protobuf",
        schema=_protobuf("Status", definition),
        context=context,
    )
    found: list[tuple[int, Send]] = []
    for change in status_changes(run):
        values = {"status": int(change.status), "inside_workspace": change.inside_workspace}
        data = schema.encode(definition, "Status", values)
        found.append((change.time_ns, partial(_send, channel, data)))
    return found


def _run_info(context: foxglove.Context, runs: Sequence[Run]) -> tuple[int, Send]:
    first = runs[0]
    values = {
        "scenario": first.scenario.name,
        "title": first.scenario.title,
        "controller": first.design.name,
        "drive": first.drive,
        "plants": ", ".join(run.plant for run in runs),
        "status": ", ".join(f"{run.plant}: {run.status.label}" for run in runs),
        "versions": ", ".join(f"{name} {version}" for name, version in _versions().items()),
    }
    return _text_message(context, topics.RUN_INFO, "RunInfo", RUN_INFO_FIELDS, values)


def _design(context: foxglove.Context, run: Run) -> tuple[int, Send]:
    design = run.design.to_json()
    values = {name: json.dumps(value) for name, value in design.items()}
    return _text_message(context, topics.DESIGN, "Design", tuple(design), values)


def _text_message(
    context: foxglove.Context, topic: str, name: str, fields: tuple[str, ...], values: dict[str, str]
) -> tuple[int, Send]:
    definition = schema.text_schema(name, fields)
    channel = foxglove.Channel(
        topic,
        message_encoding="protobuf",
        schema=_protobuf(name, definition),
        context=context,
    )
    data = schema.encode(definition, name, values)
    return 0, partial(_send, channel, data)


def _send(channel: foxglove.Channel, data: bytes, time: int) -> None:
    channel.log(data, log_time=time)


def _send_log(channel: LogChannel, message: Log, time: int) -> None:
    channel.log(message, log_time=time)


def _send_in_order(runs: Sequence[Run], dense: Any, sparse: list[tuple[int, Send]]) -> int:
    """Send everything in the order of time; returns the number of messages."""
    sent, waiting = 0, 0
    for time in np.unique(np.concatenate([run.time_ns for run in runs])).tolist():
        while waiting < len(sparse) and sparse[waiting][0] <= time:
            sparse[waiting][1](sparse[waiting][0])
            waiting += 1
        for rows, log, messages in dense:
            row = rows.get(time)
            if row is not None:
                log(messages[row], log_time=time)
                sent += 1
    for time, send in sparse[waiting:]:
        send(time)
    return sent + len(sparse)


def _check_complete(path: Path, sent: int) -> None:
    """The writer drops messages rather than fail: count what has arrived."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    statistics = summary.statistics if summary is not None else None
    written = statistics.message_count if statistics is not None else 0
    if written != sent:
        raise OSError(f"only {written} of {sent} messages were written")


def _part(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _unwritable(path: Path, error: Exception) -> LogError:
    return LogError(
        f"cannot write {path}: {error}",
        allowed="a file in a directory that can be written, on a disk with space",
        remedy="choose another place with --out",
    )

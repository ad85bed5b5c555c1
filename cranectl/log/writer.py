"""Write runs to MCAP: protobuf messages, everything needed to understand and repeat the run inside.

The file is written beside its place as `.PID.part` and renamed once it is closed and checked. Time is
simulation time, no wall clock goes in: the same runs give the same bytes.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import foxglove
import numpy as np
from foxglove.mcap import MCAPWriteOptions
from mcap.reader import make_reader

from cranectl.errors import LogError
from cranectl.files import check_replaceable, replacing
from cranectl.log import topics
from cranectl.log.stream import Stream
from cranectl.log.streams import streams, versions
from cranectl.simulate import Run

# Small chunks: after a kill nearly everything can be salvaged, for 0.2 % more size.
CHUNK_SIZE = 64 * 1024


def check_writable(path: Path) -> None:
    """Raise LogError now rather than after the simulation if `path` cannot be written."""
    try:
        check_replaceable(path)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise _unwritable(path, error) from None


def write_log(path: str | Path, runs: Sequence[Run], *, every: int | None = None) -> Path:
    """Write one or two runs of the same scenario, design and drive to `path`.

    `every`: log every n-th control sample, by default as the scenario says; the last sample always.
    Returns `path`; raises LogError if it cannot be written.
    """
    path = Path(path)
    check_writable(path)
    every = every or runs[0].scenario.log.every
    try:
        with replacing(path) as part:
            _write(part, [run.every(every) for run in runs], every)
    except (OSError, RuntimeError) as error:
        raise _unwritable(path, error) from None
    return path


def _write(part: Path, runs: Sequence[Run], every: int) -> None:
    # The writer's channels die with the context: it must stay referenced until the file is closed.
    context = foxglove.Context()
    options = MCAPWriteOptions(chunk_size=CHUNK_SIZE, compression_threads=0)
    with foxglove.open_mcap(part, allow_overwrite=True, context=context, writer_options=options) as file:
        _write_header(file, runs, every)
        sent = _send_in_order(context, streams(runs))
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
    file.write_metadata("versions", versions())
    for run in runs:
        status = {"status": run.status.label, "end_ns": str(run.end_ns)}
        file.write_metadata(f"run/{run.plant}", {**status, "samples": str(len(run.time_ns))})
    _attach_json(file, "scenario.json", first.scenario.model_dump(mode="json"))
    _attach_json(file, "parameters.json", first.scenario.rig.model_dump(mode="json"))
    _attach_json(file, "design.json", first.design.to_json())
    for run in runs:
        is_xml = run.model.startswith("<")
        name = f"{run.plant}.{'xml' if is_xml else 'txt'}"
        _attach(file, name, "application/xml" if is_xml else "text/plain", run.model)


def _attach_json(file: foxglove.MCAPWriter, name: str, data: dict[str, Any]) -> None:
    _attach(file, name, "application/json", json.dumps(data, indent=2, ensure_ascii=False))


def _attach(file: foxglove.MCAPWriter, name: str, media_type: str, text: str) -> None:
    file.attach(log_time=0, create_time=0, name=name, media_type=media_type, data=text.encode())


def _send_in_order(context: foxglove.Context, sent: Sequence[Stream]) -> int:
    """Send all messages in the order of time; returns their number."""
    channels = [_channel(context, stream) for stream in sent]
    time = np.concatenate([stream.time_ns for stream in sent])
    index = np.concatenate([np.full(len(stream.messages), k) for k, stream in enumerate(sent)])
    order = np.lexsort((index, time))
    waiting = [iter(stream.messages) for stream in sent]
    logs = [channel.log for channel in channels]
    for k, log_time in zip(index[order].tolist(), time[order].tolist(), strict=True):
        logs[k](next(waiting[k]), log_time=log_time)
    return len(time)


def _channel(context: foxglove.Context, stream: Stream) -> foxglove.Channel:
    return foxglove.Channel(
        stream.topic,
        message_encoding="protobuf",
        schema=foxglove.Schema(name=stream.schema_name, encoding="protobuf", data=stream.schema),
        metadata=stream.metadata,
        context=context,
    )


def _check_complete(path: Path, sent: int) -> None:
    """The writer drops messages rather than fail: count what has arrived."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    statistics = summary.statistics if summary is not None else None
    written = statistics.message_count if statistics is not None else 0
    if written != sent:
        raise OSError(f"only {written} of {sent} messages were written")


def _unwritable(path: Path, error: Exception) -> LogError:
    return LogError(
        f"cannot write {path}: {error}",
        allowed="a file in a directory that can be written, on a disk with space",
        remedy="choose another place with --out",
    )

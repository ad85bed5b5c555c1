"""Read logs back to NumPy, bit for bit what was written."""

import json
import struct
from collections import defaultdict
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from numpy.typing import NDArray

from cranectl.design import Design
from cranectl.errors import InputError, LogError
from cranectl.log import schema, topics
from cranectl.plants.interface import PLANTS
from cranectl.scenario import Scenario
from cranectl.settings import parse_settings
from cranectl.signals import REFERENCE, recorded_groups
from cranectl.simulate import Run, checked_drive
from cranectl.status import RunStatus

# (times [ns], messages) of a topic.
Stream = tuple[list[int], list[bytes]]


def read_log(path: str | Path) -> dict[str, Run]:
    """The runs in a log by plant, at the logged rate.

    Raises LogError if the file is missing, empty, truncated, foreign, or of another format version.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            return _read(path, stream)
    except OSError as error:
        raise LogError(f"cannot read {path}: {error}", remedy="name a log that cranectl wrote") from None
    except (McapError, struct.error, EOFError) as error:
        raise _damaged(path, error) from None
    except (KeyError, TypeError, ValueError) as error:
        raise LogError(
            f"{path} is not a log this version understands: {error}",
            allowed=f"logs of cranectl, format {topics.FORMAT_VERSION}",
            remedy="write the log again with this version",
        ) from None


def _read(path: Path, stream: BinaryIO) -> dict[str, Run]:
    reader = make_reader(stream, validate_crcs=True)
    metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    if "cranectl" not in metadata:
        raise LogError(f"{path} is an MCAP file, but not of cranectl", allowed="logs that cranectl wrote")
    version = metadata["cranectl"]["format"]
    if version != topics.FORMAT_VERSION:
        raise LogError(
            f"{path} has log format {version}",
            allowed=f"format {topics.FORMAT_VERSION}",
            remedy="write the log again, or read it with the version of cranectl that wrote it",
        )
    attachments = {a.name: a.data for a in reader.iter_attachments()}
    try:
        scenario = parse_settings(Scenario, _json(attachments, "scenario.json"), str(path))
    except InputError as error:
        raise LogError(error.found, allowed=error.allowed, remedy="write the log again") from None
    design = Design.from_json(_json(attachments, "design.json"))
    streams = _streams(reader)
    runs = {}
    for plant in metadata["cranectl"]["plants"].split(","):
        if plant not in PLANTS:
            raise ValueError(f"unknown plant {plant}")
        model = attachments.get(f"{plant}.xml", attachments.get(f"{plant}.txt", b"")).decode()
        runs[plant] = _run(metadata, streams, scenario, design, plant, model)
    return runs


def _json(attachments: dict[str, bytes], name: str) -> dict[str, Any]:
    data = json.loads(attachments[name])
    if not isinstance(data, dict):
        raise TypeError(f"{name} is no table")
    return data


def _streams(reader: McapReader) -> dict[str, Stream]:
    streams: dict[str, Stream] = defaultdict(lambda: ([], []))
    for _, channel, message in reader.iter_messages(log_time_order=False):
        times, data = streams[channel.topic]
        times.append(message.log_time)
        data.append(message.data)
    return streams


def _run(
    metadata: dict[str, dict[str, str]],
    streams: dict[str, Stream],
    scenario: Scenario,
    design: Design,
    plant: str,
    model: str,
) -> Run:
    outcome = metadata[f"run/{plant}"]
    samples = int(outcome["samples"])
    groups = recorded_groups(design.robustifier.sampled_order)
    columns = []
    time_ns: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    for group in groups:
        times, messages = streams[topics.plant_topic(plant, group.name)]
        if len(messages) != samples:
            raise ValueError(f"{len(messages)} of {samples} samples of {plant}/{group.name}")
        time_ns = np.array(times, dtype=np.int64)
        columns.append(schema.decode_rows(messages, len(group)))
    times, messages = streams[topics.REFERENCE_LOAD]
    chosen = np.isin(np.array(times, dtype=np.int64), time_ns)
    return Run(
        scenario=scenario,
        design=design,
        plant=plant,
        drive=checked_drive(metadata["cranectl"]["drive"]),
        model=model,
        time_ns=time_ns,
        table=np.hstack(columns),
        reference=schema.decode_rows(messages, len(REFERENCE))[chosen],
        status=RunStatus[outcome["status"].upper().replace("-", "_")],
        end_ns=int(outcome["end_ns"]),
    )


def _damaged(path: Path, error: Exception) -> LogError:
    empty = path.stat().st_size == 0
    what = "is empty" if empty else f"is truncated or no MCAP file ({type(error).__name__})"
    return LogError(
        f"{path} {what}",
        allowed="closed logs that cranectl wrote",
        remedy="run the scenario again",
    )

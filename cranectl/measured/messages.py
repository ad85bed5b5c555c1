"""Read columns of numbers from recorded messages: MCAP files and ROS bags, by topic and field."""

import json
from array import array
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from cranectl.measured.columns import DEEPEST, TableHead, from_arrays
from cranectl.support.arrays import Array

MAX_LIST = 32  # numbers of a list in a message; longer ones are pictures and clouds of points
Series: TypeAlias = "dict[str, array[float]]"


def read_mcap(path: Path, where: str) -> TableHead:
    """Return the head of an MCAP file with rows of signals, JSON or messages of ROS."""
    from mcap.reader import make_reader

    from cranectl.mcap_columns.contents import open_contents
    from cranectl.mcap_columns.rows import columns_of, decode_table, signal_names

    arrays: dict[str, Array] = {}
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    encodings = {channel.message_encoding for channel in summary.channels.values()} if summary else set()
    if encodings & {"cdr", "ros1"}:
        return read_bag(path, where)
    with path.open("rb") as stream:
        contents = open_contents(path, stream)
        for number, column in columns_of(contents, contents.chunks(stream), lambda _: True).items():
            channel = contents.channels[number]
            names = signal_names(channel, contents.schemas[channel.schema_id])
            topic = channel.topic.removeprefix("/")
            arrays[f"{topic}.time"] = 1e-9 * (column.time_ns - column.time_ns[0])
            for name, values in zip(names, decode_table(column.messages, len(names)).T, strict=True):
                arrays[f"{topic}.{name}"] = values.copy()
    return from_arrays(where, arrays | (_read_json(path) if "json" in encodings else {}))


def _read_json(path: Path) -> dict[str, Array]:
    """Return the numbers of the JSON messages of an MCAP file; times are seconds after the file's first."""
    from mcap.reader import make_reader

    series: Series = {}
    with path.open("rb") as stream:
        start: int | None = None
        for _, channel, message in make_reader(stream).iter_messages():
            if channel.message_encoding == "json":
                start = message.log_time if start is None else start
                topic = channel.topic.removeprefix("/")
                _append(series, f"{topic}.time", 1e-9 * (message.log_time - start))
                _append(series, topic, json.loads(message.data))
    return {name: np.array(values) for name, values in series.items()}


def read_bag(path: Path, where: str) -> TableHead:
    """Return the head of a ROS bag; the files of a bag of ROS 2 are in one directory."""
    from rosbags.highlevel import AnyReader

    series: Series = {}
    with AnyReader([path if path.suffix == ".bag" else path.parent]) as reader:
        for connection, time_ns, raw in reader.messages():
            topic = connection.topic.removeprefix("/")
            _append(series, f"{topic}.time", 1e-9 * (time_ns - reader.start_time))
            _append(series, topic, reader.deserialize(raw, connection.msgtype))
    return from_arrays(where, {name: np.array(values) for name, values in series.items()})


def _append(series: Series, name: str, value: Any, depth: int = 0) -> None:
    """Append the numbers of a message to the series of its fields."""
    if isinstance(value, bool | int | float):
        series.setdefault(name, array("d")).append(float(value))
    elif isinstance(value, np.ndarray | list) and len(value) <= MAX_LIST:
        for k, number in enumerate(value.tolist() if isinstance(value, np.ndarray) else value, 1):
            _append(series, f"{name}:{k}", number, DEEPEST)
    elif depth < DEEPEST:
        fields = value if isinstance(value, Mapping) else getattr(value, "__dataclass_fields__", {})
        for field in fields:
            if not field.startswith("__"):
                inner = value[field] if isinstance(value, Mapping) else getattr(value, field)
                _append(series, f"{name}.{field}", inner, depth + 1)

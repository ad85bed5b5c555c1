"""Read columns of numbers from recorded messages: MCAP files and ROS bags, by topic and field.

Each topic has a column `time`, when its messages were recorded, and columns for the stamps in them. All
times are seconds after the first message of the file.
"""

import json
from array import array
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cranectl import mcap_columns
from cranectl.support import Array, TableHead
from cranectl.tools.measured.arrays import DEEPEST, MAX_LEFT_OUT

MAX_LIST = 32  # numbers of a list in a message; longer ones are pictures and clouds of points
STAMPS = ({"sec", "nanosec"}, {"secs", "nsecs"}, {"sec", "nsec"})  # fields of a time, as ROS and others have
NANOSECONDS = 10**9
ROS = {"cdr", "ros1"}  # encodings of messages


class MessageSeries:
    """Numbers of messages, by topic and field."""

    def __init__(self) -> None:
        self._series: dict[str, array[Any]] = {}  # of doubles, or of whole numbers for times [ns]
        self._left_out: dict[str, str] = {}
        self._start: int | None = None  # [ns] of the first message

    def add_message(self, topic: str, time_ns: int, message: Any) -> None:
        """Add the time at which a message was recorded, and its numbers."""
        topic = topic.removeprefix("/")
        self._start = time_ns if self._start is None else self._start
        self._series.setdefault(f"{topic}.time", array("q")).append(time_ns)
        self._add(topic, message)

    def _add(self, name: str, value: Any, depth: int = 0) -> None:
        """Append the numbers of a value to the series of its fields."""
        if isinstance(value, bool | int | float):
            self._series.setdefault(name, array("d")).append(float(value))
            return
        if isinstance(value, np.ndarray | list | tuple):
            if len(value) > MAX_LIST:
                self.leave_out(name, f"lists of {len(value)}")
                return
            for k, number in enumerate(value.tolist() if isinstance(value, np.ndarray) else value, 1):
                self._add(f"{name}:{k}", number, DEEPEST)
            return
        fields = _fields(value)
        if set(fields) in STAMPS:
            seconds, nanoseconds = fields.values()
            stamp = int(seconds) * NANOSECONDS + int(nanoseconds)
            self._series.setdefault(name, array("q")).append(stamp)
            return
        if fields and depth >= DEEPEST:
            self.leave_out(name, f"more than {DEEPEST} levels deep")
        elif not fields and value is not None and not isinstance(value, Mapping):
            self.leave_out(name, "text" if isinstance(value, str) else type(value).__name__)
        for field, inner in fields.items() if depth < DEEPEST else ():
            self._add(f"{name}.{field}", inner, depth + 1)

    def leave_out(self, name: str, what: str) -> None:
        """Remember a field or topic that is no column."""
        if len(self._left_out) < MAX_LEFT_OUT:
            self._left_out.setdefault(name, f"{name} ({what})")

    def head(self, where: str, others: Mapping[str, Array] | None = None) -> TableHead:
        """Return the head of a file with these series and other columns."""
        start = self._start or 0
        columns: dict[str, Array] = dict(others or {})
        for name, series in self._series.items():
            is_time = series.typecode == "q"
            columns[name] = 1e-9 * (np.array(series) - start) if is_time else np.array(series)
        return TableHead.of_arrays(where, columns, left_out=tuple(self._left_out.values()), is_ordered=False)


def _fields(value: Any) -> dict[str, Any]:
    """Return the fields of a message."""
    if isinstance(value, Mapping):
        return dict(value)
    names = getattr(value, "__dataclass_fields__", {})
    return {name: getattr(value, name) for name in names if not name.startswith("__")}


def read_mcap(path: Path, where: str) -> TableHead:
    """Return the head of an MCAP file with rows of signals, JSON or messages of ROS."""
    from mcap.reader import make_reader

    arrays: dict[str, Array] = {}
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    channels = list(summary.channels.values()) if summary else []
    if {channel.message_encoding for channel in channels} & ROS:
        return read_bag(path, where)
    with path.open("rb") as stream:
        file = mcap_columns.McapFile(path, stream)
        rows = file.columns(lambda _: True)
    for number, column in rows.items():
        channel = file.channels[number]
        names = file.signals(channel)
        topic = channel.topic.removeprefix("/")
        arrays[f"{topic}.time"] = 1e-9 * (column.time_ns - column.time_ns[0])
        for name, values in zip(names, column.values(len(names)).T, strict=True):
            arrays[f"{topic}.{name}"] = values.copy()
    series = MessageSeries()
    for number, channel in file.channels.items():
        if number not in rows and channel.message_encoding != "json":
            series.leave_out(channel.topic.removeprefix("/"), f"{channel.message_encoding} messages")
    if any(channel.message_encoding == "json" for channel in file.channels.values()):
        _add_json(series, path)
    return series.head(where, arrays)


def _add_json(series: MessageSeries, path: Path) -> None:
    """Add the JSON messages of an MCAP file."""
    from mcap.reader import make_reader

    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            if channel.message_encoding == "json":
                series.add_message(channel.topic, message.log_time, json.loads(message.data))


def read_bag(path: Path, where: str) -> TableHead:
    """Return the head of a ROS bag; the files of a bag of ROS 2 are in one directory."""
    from rosbags.highlevel import AnyReader

    series = MessageSeries()
    with AnyReader([path if path.suffix == ".bag" else path.parent]) as reader:
        for connection, time_ns, raw in reader.messages():
            series.add_message(connection.topic, time_ns, reader.deserialize(raw, connection.msgtype))
    return series.head(where)

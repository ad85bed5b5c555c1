"""Decode rows of signals: protobuf messages in which every field is an `optional double` and present."""

import functools
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from cranectl.mcap_columns.contents import Contents, open_contents
from cranectl.mcap_columns.records import Column, Content, DamageError, rows_of

MAX_DEFINITION = 2**16  # [bytes] of the message type of a row of signals; our longest have about 1000
Field = descriptor_pb2.FieldDescriptorProto

_FIXED64 = 1  # protobuf wire type of a double


def read_rows(
    path: str | Path, stream: BinaryIO, is_selected: Callable[[str], bool]
) -> tuple[Contents, dict[int, Column]]:
    """Return the contents of a closed file, and by channel the rows of selected topics; raise its errors."""
    contents = open_contents(path, stream)
    return contents, columns_of(contents, contents.chunks(stream), is_selected)


def columns_of(
    contents: Contents, chunks: Iterable[Content], is_selected: Callable[[str], bool]
) -> dict[int, Column]:
    """Return the rows of selected topics by channel; raise DamageError for a message of another length."""
    widths: dict[int, int] = {}
    parts: dict[int, list[Column]] = defaultdict(list)
    for content in chunks:
        for number, channel in contents.channels.items():
            if number not in widths:
                schema = contents.schemas[channel.schema_id]
                widths[number] = row_width(channel, schema) if is_selected(channel.topic) else 0
            if not widths[number]:
                continue
            column = Column(*rows_of(content.data, content.table, number, widths[number]))
            if len(column.messages) < len(column.time_ns):
                raise DamageError(f"a message of {channel.topic} does not have the length of its type")
            parts[number].append(column)
    joined = {}
    for number in list(parts):
        times, messages = zip(*parts.pop(number), strict=True)
        joined[number] = Column(np.concatenate(times), np.concatenate(messages))
    return joined


def row_width(channel: Channel, definition: Schema) -> int:
    """Return the length of a channel's messages [bytes]; 0 if it does not carry rows of signals."""
    try:
        return row_layout(len(signal_names(channel, definition))).itemsize
    except DamageError:
        return 0


def signal_names(channel: Channel, definition: Schema) -> tuple[str, ...]:
    """Return the names of a channel's signals; raise DamageError if it does not carry rows of signals."""
    if {channel.message_encoding, definition.encoding} != {"protobuf"}:
        raise DamageError(f"{channel.topic} is not protobuf")
    if len(definition.data) > MAX_DEFINITION:
        raise DamageError(f"the type of {channel.topic} takes {len(definition.data)} bytes")
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(definition.data).file
    except DecodeError:
        raise DamageError(f"the type of {channel.topic} is not a protobuf type") from None
    types = [
        message.field
        for file in files
        for message in file.message_type
        if f"{file.package}.{message.name}" == definition.name
    ]
    if len(types) != 1:
        raise DamageError(f"the type of {channel.topic} defines {definition.name} {len(types)} times")
    for number, field in enumerate(types[0], start=1):
        signal = (number, Field.TYPE_DOUBLE, Field.LABEL_OPTIONAL)
        # Protobuf returns a name that is not UTF-8 as bytes.
        if (field.number, field.type, field.label) != signal or not isinstance(field.name, str):
            raise DamageError(f"the type of {channel.topic} is not a row of signals: its field {field.name}")
    return tuple(field.name for field in types[0])


@functools.cache
def row_layout(n_signals: int) -> np.dtype[Any]:
    """Return the byte layout of one message: for each field its tag, then the double."""
    fields: list[Any] = []
    for number in range(1, n_signals + 1):
        fields += [(f"tag{number}", "u1", len(tag(number))), (f"value{number}", "<f8")]
    return np.dtype(fields)


def decode_table(data: NDArray[np.uint8], n_signals: int) -> NDArray[np.float64]:
    """Decode messages of `EncodedRows` to values (N, signals); raise ValueError for other messages."""
    rows = data.view(row_layout(n_signals)).reshape(-1)
    values = np.empty((len(rows), n_signals))
    for number in range(1, n_signals + 1):
        if (rows[f"tag{number}"] != np.frombuffer(tag(number), dtype="u1")).any():
            raise ValueError(f"field {number} is missing or out of order")
        values[:, number - 1] = rows[f"value{number}"]
    return values


def tag(number: int) -> bytes:
    """Return the protobuf tag of a double field: a varint of field number and wire type."""
    key, encoded = number << 3 | _FIXED64, bytearray()
    while key >= 0x80:
        encoded.append(key & 0x7F | 0x80)
        key >>= 7
    return bytes([*encoded, key])

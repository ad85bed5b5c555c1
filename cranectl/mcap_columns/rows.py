"""Encode and decode rows of signals: protobuf messages whose fields are all `optional double` and present."""

import functools
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from cranectl.mcap_columns.records import Bytes, DamageError, Integers

MAX_DEFINITION = 2**16  # [bytes] of the message type of a row of signals; our longest have about 1000
Field = descriptor_pb2.FieldDescriptorProto

_FIXED64 = 1  # protobuf wire type of a double
ENCODED_ROWS = 1000  # rows encoded at a time


class Column(NamedTuple):
    """The messages of a channel, all of one length, in the order of the file."""

    time_ns: Integers  # (N,)
    messages: Bytes  # (N, length)

    def values(self, n_signals: int) -> NDArray[np.float64]:
        """Return the signals (N, signals); raise ValueError for messages that are no rows of them."""
        return decode_table(self.messages, n_signals)


class EncodedRows(Sequence[bytes]):
    """Protobuf messages of the rows of an array (N, signals), encoded only when they are read.

    All messages at once would take more memory than the run. An index must be a single integer.
    """

    def __init__(self, values: NDArray[np.float64]) -> None:
        self._values = values

    def __len__(self) -> int:
        return len(self._values)

    def __iter__(self) -> Iterator[bytes]:
        for first in range(0, len(self._values), ENCODED_ROWS):
            yield from _encoded(self._values[first : first + ENCODED_ROWS])

    def __getitem__(self, index: Any) -> Any:
        """Return the message of one row."""
        return _encoded(self._values[index, np.newaxis])[0]


def _encoded(values: NDArray[np.float64]) -> list[bytes]:
    layout = row_layout(values.shape[1])
    rows = np.zeros(len(values), dtype=layout)
    for number in range(1, values.shape[1] + 1):
        rows[f"tag{number}"] = np.frombuffer(tag(number), dtype="u1")
        rows[f"value{number}"] = values[:, number - 1]
    # An element of a void type becomes bytes in a list.
    messages: list[bytes] = rows.view(f"V{layout.itemsize}").tolist()
    return messages


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

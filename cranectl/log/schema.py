"""Message types of a log: protobuf schemas built from the signal table, and their exact byte layout.

Every signal is an `optional double`, always present, so all messages of a type have one length and a whole
column of them is a NumPy structured array: writing and reading need no per-message protobuf work.
"""

import functools
from enum import IntEnum
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError, Message
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from cranectl.log.events import Disturbed, Phase, Saturated
from cranectl.mcap_columns.records import DamageError
from cranectl.signals import SignalGroup
from cranectl.status import RunStatus

PACKAGE = "cranectl"
MAX_DEFINITION = 2**16  # [bytes] of the type of a row of signals; the longest have about 1000
Field = descriptor_pb2.FieldDescriptorProto

# Fields of `cranectl.Status`; None is a bool.
STATUS_FIELDS: dict[str, type[IntEnum] | None] = {
    "status": RunStatus,
    "inside_workspace": None,
    "phase": Phase,
    "disturbed": Disturbed,
    "saturated": Saturated,
}

_FIXED64 = 1  # protobuf wire type of a double


@functools.cache
def group_schema(group: SignalGroup) -> bytes:
    """FileDescriptorSet of a signal group."""
    message = descriptor_pb2.DescriptorProto(name=group.schema)
    for number, name in enumerate(group.names, start=1):
        message.field.add(
            name=name,
            number=number,
            label=Field.LABEL_OPTIONAL,
            type=Field.TYPE_DOUBLE,
            proto3_optional=True,
            oneof_index=number - 1,
        )
        message.oneof_decl.add(name=f"_{name}")
    return _definition(message)


def signal_names(channel: Channel, definition: Schema) -> tuple[str, ...]:
    """The signals of a channel, from its type; raises DamageError if it does not carry rows of signals."""
    if {channel.message_encoding, definition.encoding} != {"protobuf"}:
        raise DamageError(f"{channel.topic} is not protobuf")
    if len(definition.data) > MAX_DEFINITION:
        raise DamageError(f"the type of {channel.topic} takes {len(definition.data)} bytes")
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(definition.data).file
    except DecodeError:
        raise DamageError(f"the type of {channel.topic} is no protobuf") from None
    types = [
        message.field
        for file in files
        for message in file.message_type
        if f"{file.package}.{message.name}" == definition.name
    ]
    if len(types) != 1:
        raise DamageError(f"the type of {channel.topic} has {len(types)} such types: {definition.name}")
    for number, field in enumerate(types[0], start=1):
        signal = (number, Field.TYPE_DOUBLE, Field.LABEL_OPTIONAL)
        # Protobuf hands out a name that is no UTF-8 as bytes.
        if (field.number, field.type, field.label) != signal or not isinstance(field.name, str):
            raise DamageError(f"the type of {channel.topic} is no row of signals: its field {field.name}")
    return tuple(field.name for field in types[0])


@functools.cache
def row_layout(n_signals: int) -> np.dtype[Any]:
    """Byte layout of one message: for each field its tag, then the double."""
    fields: list[Any] = []
    for number in range(1, n_signals + 1):
        fields += [(f"tag{number}", "u1", len(_tag(number))), (f"value{number}", "<f8")]
    return np.dtype(fields)


def encode_rows(values: NDArray[np.float64]) -> list[bytes]:
    """Protobuf messages of the rows of `values` (N, signals)."""
    layout = row_layout(values.shape[1])
    rows = np.zeros(len(values), dtype=layout)
    for number in range(1, values.shape[1] + 1):
        rows[f"tag{number}"] = np.frombuffer(_tag(number), dtype="u1")
        rows[f"value{number}"] = values[:, number - 1]
    messages: list[bytes] = rows.view(f"V{layout.itemsize}").tolist()
    return messages


def decode_table(data: NDArray[np.uint8], n_signals: int) -> NDArray[np.float64]:
    """Values (N, signals) of messages by `encode_rows`, one after the other; ValueError for other bytes."""
    rows = data.view(row_layout(n_signals)).reshape(-1)
    values = np.empty((len(rows), n_signals))
    for number in range(1, n_signals + 1):
        if (rows[f"tag{number}"] != np.frombuffer(_tag(number), dtype="u1")).any():
            raise ValueError(f"field {number} is missing or out of order")
        values[:, number - 1] = rows[f"value{number}"]
    return values


def _tag(number: int) -> bytes:
    """Protobuf tag of a double field, at most the 2047th: a varint of field number and wire type."""
    tag = number << 3 | _FIXED64
    return bytes([tag]) if tag < 0x80 else bytes([tag & 0x7F | 0x80, tag >> 7])


@functools.cache
def status_schema() -> bytes:
    """FileDescriptorSet of `cranectl.Status`: how a run stands, as named enumerations."""
    message = descriptor_pb2.DescriptorProto(name="Status")
    for number, (name, enumeration) in enumerate(STATUS_FIELDS.items(), start=1):
        field = message.field.add(name=name, number=number, label=Field.LABEL_OPTIONAL, type=Field.TYPE_BOOL)
        if enumeration is not None:
            field.type, field.type_name = Field.TYPE_ENUM, f".{PACKAGE}.Status.{enumeration.__name__}"
            values = message.enum_type.add(name=enumeration.__name__).value
            for value in enumeration:
                values.add(name=value.name, number=value.value)
    return _definition(message)


@functools.cache
def text_schema(name: str, fields: tuple[str, ...]) -> bytes:
    """FileDescriptorSet of a message of strings."""
    message = descriptor_pb2.DescriptorProto(name=name)
    for number, field in enumerate(fields, start=1):
        message.field.add(name=field, number=number, label=Field.LABEL_OPTIONAL, type=Field.TYPE_STRING)
    return _definition(message)


def encode(schema: bytes, name: str, values: dict[str, Any]) -> bytes:
    """One message of type `name`, the slow general way."""
    return bytes(_message_type(schema, name)(**values).SerializeToString(deterministic=True))


@functools.cache
def _message_type(schema: bytes, name: str) -> type[Message]:
    files = descriptor_pb2.FileDescriptorSet.FromString(schema)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(files.file[0])
    kind: type[Message] = message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{PACKAGE}.{name}"))
    return kind


def _definition(message: descriptor_pb2.DescriptorProto) -> bytes:
    file = descriptor_pb2.FileDescriptorProto(
        name=f"{PACKAGE}/{message.name}.proto", package=PACKAGE, syntax="proto3", message_type=[message]
    )
    return bytes(descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString(deterministic=True))

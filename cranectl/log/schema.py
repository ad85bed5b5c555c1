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
from numpy.typing import NDArray

from cranectl.log.events import Disturbed, Phase, Saturated
from cranectl.signals import SignalGroup
from cranectl.status import RunStatus

PACKAGE = "cranectl"
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
    file, message = _new_file(group.schema)
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
    return _serialised(file)


def signal_names(definition: bytes, name: str) -> tuple[str, ...]:
    """Field names of a message type that is laid out as a row of signals; ValueError for any other type."""
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(definition)
    except DecodeError:
        raise ValueError(f"the definition of {name} is no protobuf") from None
    types = [m for file in files.file for m in file.message_type if f"{file.package}.{m.name}" == name]
    if len(types) != 1:
        raise ValueError(f"the definition of {name} has {len(types)} such types")
    for number, field in enumerate(types[0].field, start=1):
        if (field.number, field.type, field.label) != (number, Field.TYPE_DOUBLE, Field.LABEL_OPTIONAL):
            raise ValueError(f"{name} is no row of signals: its field {field.name}")
        if not isinstance(field.name, str):  # protobuf hands out what is no UTF-8 as bytes
            raise ValueError(f"{name} has a field without a proper name")
    return tuple(field.name for field in types[0].field)


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
    """Protobuf tag of a double field: a varint of field number and wire type."""
    tag = number << 3 | _FIXED64
    encoded = bytearray()
    while tag >= 0x80:
        encoded.append(tag & 0x7F | 0x80)
        tag >>= 7
    encoded.append(tag)
    return bytes(encoded)


@functools.cache
def status_schema() -> bytes:
    """FileDescriptorSet of `cranectl.Status`: how a run stands, as named enumerations."""
    file, message = _new_file("Status")
    for number, (name, enumeration) in enumerate(STATUS_FIELDS.items(), start=1):
        field = message.field.add(name=name, number=number, label=Field.LABEL_OPTIONAL, type=Field.TYPE_BOOL)
        if enumeration is not None:
            field.type, field.type_name = Field.TYPE_ENUM, f".{PACKAGE}.Status.{enumeration.__name__}"
            values = message.enum_type.add(name=enumeration.__name__).value
            for value in enumeration:
                values.add(name=value.name, number=value.value)
    return _serialised(file)


@functools.cache
def text_schema(name: str, fields: tuple[str, ...]) -> bytes:
    """FileDescriptorSet of a message of strings."""
    file, message = _new_file(name)
    for number, field in enumerate(fields, start=1):
        message.field.add(name=field, number=number, label=Field.LABEL_OPTIONAL, type=Field.TYPE_STRING)
    return _serialised(file)


def encode(schema: bytes, name: str, values: dict[str, Any]) -> bytes:
    """One message of type `name`, the slow general way."""
    return bytes(_message_type(schema, name)(**values).SerializeToString(deterministic=True))


def decode(schema: bytes, name: str, data: bytes) -> dict[str, Any]:
    """The fields of one message, as `encode` takes them."""
    message = _message_type(schema, name).FromString(data)
    return {field.name: value for field, value in message.ListFields()}


@functools.cache
def _message_type(schema: bytes, name: str) -> type[Message]:
    files = descriptor_pb2.FileDescriptorSet.FromString(schema)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(files.file[0])
    kind: type[Message] = message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{PACKAGE}.{name}"))
    return kind


def _new_file(
    name: str,
) -> tuple[descriptor_pb2.FileDescriptorProto, descriptor_pb2.DescriptorProto]:
    file = descriptor_pb2.FileDescriptorProto(
        name=f"{PACKAGE}/{name}.proto", package=PACKAGE, syntax="proto3"
    )
    return file, file.message_type.add(name=name)


def _serialised(file: descriptor_pb2.FileDescriptorProto) -> bytes:
    files = descriptor_pb2.FileDescriptorSet(file=[file])
    return bytes(files.SerializeToString(deterministic=True))

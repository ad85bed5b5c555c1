"""Message types of a log: protobuf schemas built from the signal table, and their exact byte layout.

Every signal is an `optional double`, always present, so all messages of a type have one length and a whole
column of them is a NumPy structured array: writing and reading need no per-message protobuf work.
"""

import functools
import re
from collections.abc import Iterator, Sequence
from enum import IntEnum
from typing import Any, overload

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message
from numpy.typing import NDArray

from cranectl.log.events import Disturbed, Phase, Saturated
from cranectl.mcap_columns.rows import row_layout, tag
from cranectl.signals import SignalGroup
from cranectl.status import RunStatus

PACKAGE = "cranectl"
ENCODED = 1000  # rows at a time
Field = descriptor_pb2.FieldDescriptorProto

# Fields of `cranectl.Status`; None is a bool.
STATUS_FIELDS: dict[str, type[IntEnum] | None] = {
    "status": RunStatus,
    "inside_workspace": None,
    "phase": Phase,
    "disturbed": Disturbed,
    "saturated": Saturated,
}


@functools.cache
def group_schema(group: SignalGroup) -> bytes:
    """Return the FileDescriptorSet of a signal group."""
    message = descriptor_pb2.DescriptorProto(name=group.schema)
    # What protobuf calls fields in JSON: two of one message must differ in it.
    json_names = {re.sub(r"_+(.?)", lambda match: match[1].upper(), name) for name in group.names}
    taken = set(group.names)
    for number, name in enumerate(group.names, start=1):
        message.field.add(
            name=name,
            number=number,
            label=Field.LABEL_OPTIONAL,
            type=Field.TYPE_DOUBLE,
            proto3_optional=True,
            oneof_index=number - 1,
            json_name=name if len(json_names) < len(group) else None,
        )
        oneof = f"_{name}"  # named as protoc does
        while oneof in taken:
            oneof = f"X{oneof}"
        taken.add(oneof)
        message.oneof_decl.add(name=oneof)
    return _definition(message)


class EncodedRows(Sequence[bytes]):
    """Protobuf messages of the rows of an array (N, signals), each encoded when it is asked for.

    All of them at once would take more memory than the run.
    """

    def __init__(self, values: NDArray[np.float64]) -> None:
        self._values = values

    def __len__(self) -> int:
        return len(self._values)

    def __iter__(self) -> Iterator[bytes]:
        for first in range(0, len(self._values), ENCODED):
            yield from _encoded(self._values[first : first + ENCODED])

    @overload
    def __getitem__(self, index: int) -> bytes: ...
    @overload
    def __getitem__(self, index: slice) -> list[bytes]: ...
    def __getitem__(self, index: int | slice) -> bytes | list[bytes]:
        if isinstance(index, slice):
            return _encoded(self._values[index])
        return _encoded(self._values[index][np.newaxis])[0]


def _encoded(values: NDArray[np.float64]) -> list[bytes]:
    layout = row_layout(values.shape[1])
    rows = np.zeros(len(values), dtype=layout)
    for number in range(1, values.shape[1] + 1):
        rows[f"tag{number}"] = np.frombuffer(tag(number), dtype="u1")
        rows[f"value{number}"] = values[:, number - 1]
    messages: list[bytes] = rows.view(f"V{layout.itemsize}").tolist()
    return messages


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

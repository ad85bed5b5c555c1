"""Define the topics of a log and their message types.

Types are protobuf schemas that follow from the table of signals. Every signal is an `optional double` that is
always present, so all messages of a type have one length. Therefore NumPy can write and read all messages of
a topic as one structured array, instead of one after the other by protobuf.
"""

import functools
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, ClassVar

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message
from numpy.typing import NDArray

from cranectl.log.events import StatusChange
from cranectl.signals import Signal, SignalGroup

SORTED_MESSAGES = 1000  # messages of the longest stream that are sorted at a time, which limits memory
PACKAGE = "cranectl"
Field = descriptor_pb2.FieldDescriptorProto

# Fields of `cranectl.Status` in the order of their numbers.
STATUS_FIELDS = {name: kind for name, kind in StatusChange.__annotations__.items() if name != "time_ns"}
FIELD_TYPES = {str: Field.TYPE_STRING, bool: Field.TYPE_BOOL}  # all others are enumerations


@dataclass(frozen=True)
class Stream:
    """All messages of one topic in the order of time."""

    topic: str  # such as /mujoco/state
    schema_name: str  # such as cranectl.State
    schema: bytes  # FileDescriptorSet
    time_ns: NDArray[np.int64]  # (n,) [ns]
    messages: Sequence[bytes]  # n encoded messages
    metadata: dict[str, str] = field(default_factory=dict)  # units and meanings of its signals

    @classmethod
    def of(cls, topic: str, kind: Any, times: Iterable[int], messages: Iterable[Any]) -> "Stream":
        """Return a stream of messages of `kind`, a type of Foxglove's SDK, at their times [ns]."""
        definition, time_ns = kind.get_schema(), np.array(times, dtype=np.int64)
        return cls(
            topic, definition.name, definition.data, time_ns, [message.encode() for message in messages]
        )


def in_order(streams: Sequence[Stream]) -> Iterator[tuple[int, int, bytes]]:
    """Yield stream index, time [ns] and content of all messages, ordered by time and then by stream."""
    waiting = [iter(stream.messages) for stream in streams]
    taken = [0] * len(streams)
    longest = max((stream.time_ns for stream in streams), key=len, default=np.empty(0, np.int64))
    # A few at a time, or their order takes memory.
    for until in (*longest[SORTED_MESSAGES::SORTED_MESSAGES].tolist(), None):
        times, numbers = [], []
        for k, stream in enumerate(streams):
            last = len(stream.time_ns) if until is None else int(np.searchsorted(stream.time_ns, until))
            times.append(stream.time_ns[taken[k] : last])
            numbers.append(np.full(last - taken[k], k))
            taken[k] = last
        time, number = np.concatenate(times), np.concatenate(numbers)
        order = np.lexsort((number, time))
        for k, time_ns in zip(number[order].tolist(), time[order].tolist(), strict=True):
            yield k, time_ns, next(waiting[k])


# Groups whose differences from the reference plant are logged, sample by sample.
DIFFERENCE_GROUPS = (
    SignalGroup("state", "StateDifference", "reference plant minus another", SignalGroup.STATE.signals),
    SignalGroup("load", "LoadDifference", "reference plant minus another", SignalGroup.LOAD.signals),
)

DIFFERENCES = "/diff/"


@dataclass(frozen=True)
class Topics:
    """Names of the topics of a log: those of one run, and as constants those that all runs share.

    Topics of a run begin with its plant, or in an overlay with its label, so that logs can be merged.
    """

    run: str  # its plant or label

    REFERENCE: ClassVar = "/reference/load"  # desired load, with four derivatives
    PATH: ClassVar = "/reference/path"  # drawing of the desired path and the desired load
    WORKSPACE: ClassVar = "/rig/workspace"  # drawing of the workspace and the obstacles
    TRANSFORMS: ClassVar = "/tf"  # frames of the cranes, and of the desired load
    LOG: ClassVar = "/log"  # events as text
    RUN_INFO: ClassVar = "/run/info"  # names, plants and status of the runs, and the software
    DESIGN: ClassVar = "/controller/design"  # the controller in words and numbers
    DISTANCE: ClassVar = SignalGroup(  # how far a run is from another; a name and not a whole topic
        "distance",
        "Distance",
        "how far the plants are apart",
        (
            Signal("load_distance", "|Δz|", "m", "distance of the loads"),
            Signal("angle_distance", "max |Δα|, |Δβ|", "rad", "larger difference of the angles"),
        ),
    )
    STEP: ClassVar = "step"  # the distance between a run of an overlay and the one before it

    def of(self, group: str) -> str:
        """Return the topic of a group of signals."""
        return f"/{self.run}/{group}"

    @property
    def reference(self) -> str:
        """The reference of one run of an overlay; runs of other logs share theirs."""
        return self.of("reference")

    @property
    def status(self) -> str:
        """Status, phase of the reference, and what acts on the run."""
        return self.of("status")

    @property
    def arrows(self) -> str:
        """The arrows of disturbances."""
        return self.of("disturbance_arrow")

    @property
    def drawn(self) -> tuple[str, str, str, str]:
        """All that draws the crane: its solids, rope and trail, and the arrows of disturbances."""
        return self.of("model"), self.of("rope"), self.of("trail"), self.arrows

    @classmethod
    def difference(cls, group: str, plant: str = "") -> str:
        """Return the topic of a difference; `plant` is given if a log compares several plants."""
        return f"{DIFFERENCES}{plant}/{group}" if plant else f"{DIFFERENCES}{group}"


@functools.cache
def channel_metadata(group: SignalGroup) -> dict[str, str]:
    """Return the metadata of a group's channel: symbol, unit and description of each field in one text."""
    return {s.name: f"{s.symbol} [{s.unit}] {s.description}" for s in group.signals}


@functools.cache
def group_schema(group: SignalGroup) -> bytes:
    """Return the FileDescriptorSet of a signal group."""
    message = descriptor_pb2.DescriptorProto(name=group.schema)
    # Protobuf derives these names for JSON, and two fields of a message must not share one.
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
        oneof = f"_{name}"  # the name that protoc gives it
        while oneof in taken:
            oneof = f"X{oneof}"
        taken.add(oneof)
        message.oneof_decl.add(name=oneof)
    return _definition(message)


@functools.cache
def record_schema(name: str, fields: tuple[tuple[str, type], ...]) -> bytes:
    """Return the FileDescriptorSet of a message whose fields are strings, bools and IntEnum classes."""
    message = descriptor_pb2.DescriptorProto(name=name)
    for number, (field_name, kind) in enumerate(fields, start=1):
        added = message.field.add(name=field_name, number=number, label=Field.LABEL_OPTIONAL)
        added.type = FIELD_TYPES.get(kind, Field.TYPE_ENUM)
        if issubclass(kind, IntEnum):
            added.type_name = f".{PACKAGE}.{name}.{kind.__name__}"
            values = message.enum_type.add(name=kind.__name__).value
            for value in kind:
                values.add(name=value.name, number=value.value)
    return _definition(message)


def encode(schema: bytes, name: str, values: dict[str, Any]) -> bytes:
    """Encode one message of type `name` by protobuf, which is slow but takes any fields."""
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

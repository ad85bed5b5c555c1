"""The topics of a log: which signal group goes to which, and one with all its messages."""

import functools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.signals import LOAD, STATE, Signal, SignalGroup

SORTED = 1000  # messages of the longest stream that are put in order at a time


@dataclass(frozen=True)
class Stream:
    """All messages of one topic in the order of time."""

    topic: str
    schema_name: str
    schema: bytes  # FileDescriptorSet
    time_ns: NDArray[np.int64]
    messages: Sequence[bytes]
    metadata: dict[str, str] = field(default_factory=dict)
    encoding: str = "protobuf"  # of messages
    schema_encoding: str = "protobuf"  # empty where there is no schema

    @classmethod
    def of(cls, topic: str, kind: Any, times: Iterable[int], messages: Iterable[Any]) -> "Stream":
        """Return messages of `kind`, one of Foxglove's own, at their times [ns]."""
        definition, time_ns = kind.get_schema(), np.array(times, dtype=np.int64)
        return cls(topic, definition.name, definition.data, time_ns, [each.encode() for each in messages])


def in_order(streams: Sequence[Stream]) -> Iterator[tuple[int, int, bytes]]:
    """Number of the stream, time [ns] and content of all messages in the order of time, then of streams."""
    waiting = [iter(stream.messages) for stream in streams]
    taken = [0] * len(streams)
    longest = max((stream.time_ns for stream in streams), key=len, default=np.empty(0, np.int64))
    for until in [*longest[SORTED::SORTED].tolist(), None]:  # a few at a time, or their order takes memory
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


REFERENCE_LOAD = "/reference/load"
DESIGN = "/controller/design"
RUN_INFO = "/run/info"
LOG = "/log"
TRANSFORMS = "/tf"
REFERENCE_PATH = "/reference/path"
WORKSPACE = "/rig/workspace"
ROPE, ARROW = "rope", "disturbance_arrow"  # what is drawn of a plant, beside its `model` and `trail`
FORMER = ("cable", "push")  # as they were called before 0.3

# What is compared with the reference plant sample by sample.
DIFFERENCE_GROUPS = (
    SignalGroup("state", "StateDifference", "reference plant minus another", STATE.signals),
    SignalGroup("load", "LoadDifference", "reference plant minus another", LOAD.signals),
)

DIFFERENCES = "/diff/"
VERDICT = "verdict"
DISTANCE = SignalGroup(
    "distance",
    "Distance",
    "how far the plants are apart",
    (
        Signal("load_distance", "|Δz|", "m", "distance of the loads"),
        Signal("angle_distance", "max |Δα|, |Δβ|", "rad", "larger difference of the angles"),
    ),
)


def plant_topic(plant: str, group: str) -> str:
    """Topic of a plant's group; always prefixed, so that files of different plants overlay."""
    return f"/{plant}/{group}"


def difference_topic(group: str, plant: str = "") -> str:
    """Topic of the difference from the reference plant; of `plant`, where a log has several others."""
    return f"{DIFFERENCES}{plant}/{group}" if plant else f"{DIFFERENCES}{group}"


@functools.cache
def units(group: SignalGroup) -> dict[str, str]:
    """Channel metadata: what each field is and its unit."""
    return {s.name: f"{s.symbol} [{s.unit}] {s.description}" for s in group.signals}

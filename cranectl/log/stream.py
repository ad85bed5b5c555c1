"""One topic of a log with all its messages."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Stream:
    """All messages of one topic in the order of time."""

    topic: str
    schema_name: str
    schema: bytes  # FileDescriptorSet
    time_ns: NDArray[np.int64]
    messages: list[bytes]
    metadata: dict[str, str] = field(default_factory=dict)


def in_order(streams: Sequence[Stream]) -> Iterator[tuple[int, int, bytes]]:
    """Number of the stream, time [ns] and content of all messages in the order of time, then of streams."""
    time = np.concatenate([stream.time_ns for stream in streams])
    number = np.concatenate([np.full(len(stream.messages), k) for k, stream in enumerate(streams)])
    order = np.lexsort((number, time))
    waiting = [iter(stream.messages) for stream in streams]
    for k, time_ns in zip(number[order].tolist(), time[order].tolist(), strict=True):
        yield k, time_ns, next(waiting[k])

"""One topic of a log with all its messages."""

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

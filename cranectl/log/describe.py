"""What a log file is, apart from the numbers in it."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.log.header import OVERLAY
from cranectl.log.overlay import headers_of
from cranectl.mcap_columns.contents import open_contents, opened
from cranectl.scenario import NANOSECONDS
from cranectl.support.consistency import check_sum


@dataclass(frozen=True)
class TopicDescription:
    """One topic of a log."""

    topic: str
    schema: str
    messages: int
    rate_hz: float | None  # None for topics that are written at events


@dataclass(frozen=True)
class LogDescription:
    """A log as a file."""

    path: str
    size_bytes: int
    format: str
    every: int  # logged every n-th control sample; of an overlay, the first run
    duration_s: float
    messages: int
    versions: dict[str, str]
    topics: tuple[TopicDescription, ...]
    attachments: dict[str, int]  # name: bytes

    def __post_init__(self) -> None:
        """Raise InconsistentError where the messages of the topics do not add up."""
        check_sum("the number of messages", self.messages, [topic.messages for topic in self.topics])

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def describe_log(path: str | Path) -> LogDescription:
    """Describe a log that `read_layers` accepts; raises LogError as that does for what is no closed log."""
    path = Path(path)
    with opened(path) as stream:
        contents, _ = open_contents(path, stream)
        times = [content.table[:, 1] for content in contents.chunks(stream)]
        headers = headers_of(path, contents)
        header = next(iter(headers.values()))
    duration = float(np.ptp(np.concatenate(times))) / NANOSECONDS if contents.messages else 0.0
    topics = []
    for channel in sorted(contents.channels.values(), key=lambda channel: channel.topic):
        count, schema = contents.messages[channel.id], contents.schemas[channel.schema_id].name
        # Only signals carry the units of their fields as metadata; everything else is written at events.
        sampled = bool(channel.metadata) and count > 1 and duration > 0.0
        rate_hz = (count - 1) / duration if sampled else None
        topics.append(TopicDescription(channel.topic, schema, count, rate_hz))
    return LogDescription(
        path=str(path),
        size_bytes=path.stat().st_size,
        format=contents.metadata[OVERLAY if OVERLAY in contents.metadata else "cranectl"]["format"],
        every=header.every,
        duration_s=duration,
        messages=contents.messages.total(),
        versions=dict(header.versions),
        topics=tuple(topics),
        attachments={name: len(attachment.data) for name, attachment in contents.attachments.items()},
    )

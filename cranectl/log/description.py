"""Describe a log file: its size, format and topics."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cranectl.log.header import OVERLAY
from cranectl.log.reader import headers_of
from cranectl.mcap_columns import McapFile
from cranectl.scenario import NANOSECONDS
from cranectl.support import InconsistentError, JSONRecord


@dataclass(frozen=True)
class TopicDescription:
    """Type, size and rate of one topic of a log."""

    topic: str
    schema: str
    messages: int
    rate_hz: float | None  # None for topics with a message at events only


@dataclass(frozen=True)
class LogDescription(JSONRecord):
    """Describe size, format and topics of a log file.

    Parameters
    ----------
    path : str
        The file, as it was named.
    size_bytes : int
        Its size [bytes].
    format : str
        Number of the format, which says what readers understand it.
    every : int
        Every n-th control sample is logged; in an overlay, of the first run.
    duration_s : float
        Time between the first and the last message [s].
    messages : int
        Number of messages of all topics.
    versions : dict of str to str
        Versions of the software that made the runs, by package.
    topics : tuple of TopicDescription
        All topics.
    attachments : dict of str to int
        Sizes of the attached files [bytes], by name.

    Raises
    ------
    InconsistentError
        If the messages of the topics do not add up.
    """

    path: str
    size_bytes: int
    format: str
    every: int  # every n-th control sample is logged; in an overlay, of the first run
    duration_s: float
    messages: int
    versions: dict[str, str]
    topics: tuple[TopicDescription, ...]
    attachments: dict[str, int]  # name: bytes

    def __post_init__(self) -> None:
        """Raise InconsistentError if the messages of the topics do not add up."""
        InconsistentError.check_sum(
            "the number of messages", self.messages, [topic.messages for topic in self.topics]
        )

    @classmethod
    def of(cls, path: str | Path) -> "LogDescription":
        """Describe the log at `path`; raise LogError for a file that `Log.read` does not accept."""
        path = Path(path)
        with McapFile.opened(path) as file:
            times = [chunk.table[:, 1] for chunk in file.chunks()]
            header = next(iter(headers_of(file).values()))
        duration = float(np.ptp(np.concatenate(times))) / NANOSECONDS if file.messages else 0.0
        topics = []
        for channel in sorted(file.channels.values(), key=lambda channel: channel.topic):
            count, schema = file.messages[channel.id], file.schemas[channel.schema_id].name
            # Only topics of signals have units as metadata, and only these have a rate.
            sampled = bool(channel.metadata) and count > 1 and duration > 0.0
            rate_hz = (count - 1) / duration if sampled else None
            topics.append(TopicDescription(channel.topic, schema, count, rate_hz))
        return cls(
            path=str(path),
            size_bytes=file.size,
            format=file.metadata[OVERLAY if OVERLAY in file.metadata else "cranectl"]["format"],
            every=header.every,
            duration_s=duration,
            messages=file.messages.total(),
            versions=dict(header.versions),
            topics=tuple(topics),
            attachments={name: len(attachment.data) for name, attachment in file.attachments.items()},
        )

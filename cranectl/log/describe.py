"""What a log file is, apart from the numbers in it."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from cranectl.scenario import NANOSECONDS
from cranectl.support.errors import LogError


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
    every: int  # logged every n-th control sample
    duration_s: float
    messages: int
    versions: dict[str, str]
    topics: tuple[TopicDescription, ...]
    attachments: dict[str, int]  # name: bytes

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def describe_log(path: str | Path) -> LogDescription:
    """Describe a log that `read_log` accepts; raises LogError for a file without a summary."""
    path = Path(path)
    with path.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            raise LogError(f"{path} has no summary", remedy="run the scenario again")
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {a.name: len(a.data) for a in reader.iter_attachments()}
    statistics = summary.statistics
    duration = (statistics.message_end_time - statistics.message_start_time) / NANOSECONDS
    topics = []
    for channel in sorted(summary.channels.values(), key=lambda channel: channel.topic):
        count = statistics.channel_message_counts.get(channel.id, 0)
        # Only signals carry the units of their fields as metadata; everything else is written at events.
        sampled = bool(channel.metadata) and count > 1 and duration > 0.0
        topics.append(
            TopicDescription(
                topic=channel.topic,
                schema=summary.schemas[channel.schema_id].name,
                messages=count,
                rate_hz=(count - 1) / duration if sampled else None,
            )
        )
    return LogDescription(
        path=str(path),
        size_bytes=path.stat().st_size,
        format=metadata["cranectl"]["format"],
        every=int(metadata["cranectl"]["every"]),
        duration_s=duration,
        messages=statistics.message_count,
        versions=dict(metadata["versions"]),
        topics=tuple(topics),
        attachments=attachments,
    )

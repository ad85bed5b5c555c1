"""Send streams to everything that listens to a context: viewers, and the recording that is open."""

from collections import Counter
from collections.abc import Iterable, Sequence

import foxglove
import numpy as np
from foxglove._foxglove_py import BaseChannel

from cranectl.log import topics
from cranectl.log.stream import Stream
from cranectl.log.writer import open_channel


class Outlet:
    """One channel a topic; callers send in the order of time."""

    def __init__(self, context: foxglove.Context) -> None:
        self.sent: Counter[str] = Counter()  # messages by topic
        self._context = context
        self._channels: dict[str, BaseChannel] = {}
        self._latest: dict[str, bytes] = {}
        self._time_ns = 0

    @property
    def time_ns(self) -> int:
        """Of the newest message."""
        return self._time_ns

    def send(self, streams: Sequence[Stream], *, at_ns: int | None = None) -> None:
        """Send all messages in the order of time, or all of them as of `at_ns`."""
        if not streams:
            return
        for stream in streams:
            self._open(stream)
            if stream.messages and not stream.metadata and stream.topic != topics.LOG:
                self._latest[stream.topic] = stream.messages[-1]
        index = np.concatenate([np.full(len(stream.messages), k) for k, stream in enumerate(streams)])
        time = np.concatenate([stream.time_ns for stream in streams])
        order = np.lexsort((index, time)) if at_ns is None else np.arange(len(time))
        waiting = [iter(stream.messages) for stream in streams]
        for k, time_ns in zip(index[order].tolist(), time[order].tolist(), strict=True):
            self._log(streams[k].topic, next(waiting[k]), time_ns if at_ns is None else at_ns)

    def resend(self, asked: Iterable[str]) -> None:
        """Send the newest messages of topics again, for viewers that came after them.

        Not those of signals and text: they are what happened at their time, not how things stand.
        """
        for topic in sorted(self._latest.keys() & set(asked)):
            self._log(topic, self._latest[topic], self._time_ns)

    def _log(self, topic: str, message: bytes, time_ns: int) -> None:
        self._channels[topic].log(message, log_time=time_ns)
        self._time_ns = time_ns
        self.sent[topic] += 1

    def _open(self, stream: Stream) -> None:
        channel = self._channels.get(stream.topic)
        if channel is not None and channel.schema_name() != stream.schema_name:
            # Another robustifier, another message type. Viewers refuse a second channel of the same topic.
            channel.close()
            channel = None
        if channel is None:
            self._channels[stream.topic] = open_channel(self._context, stream)

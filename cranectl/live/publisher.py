"""Send streams to everything that listens to a context: viewers, and the recording that is open."""

from collections import Counter
from collections.abc import Iterable, Sequence

import foxglove
from foxglove._foxglove_py import BaseChannel

from cranectl.log import topics
from cranectl.log.topics import Stream, in_order
from cranectl.log.writer import open_channel


class Publisher:
    """One channel a topic; callers send in the order of time."""

    def __init__(self, context: foxglove.Context) -> None:
        self.sent: Counter[str] = Counter()  # messages by topic
        self.time_ns = 0  # of the newest message
        self._context = context
        self._channels: dict[str, BaseChannel] = {}
        self._latest: dict[str, bytes] = {}

    def send(self, streams: Sequence[Stream]) -> None:
        """Send all messages in the order of time."""
        if not streams:
            return
        for stream in streams:
            self._open(stream)
            if stream.messages and not stream.metadata and stream.topic != topics.LOG:
                self._latest[stream.topic] = stream.messages[-1]
        for k, time_ns, message in in_order(streams):
            self._log(streams[k].topic, message, time_ns)

    def resend(self, topics: Iterable[str]) -> None:
        """Send the newest messages of topics again, for viewers that came after them.

        Not those of signals and text: they are what happened at their time, not how things are.
        """
        for topic in sorted(self._latest.keys() & set(topics)):
            self._log(topic, self._latest[topic], self.time_ns)

    def _log(self, topic: str, message: bytes, time_ns: int) -> None:
        self._channels[topic].log(message, log_time=time_ns)
        self.time_ns = time_ns
        self.sent[topic] += 1

    def _open(self, stream: Stream) -> None:
        channel = self._channels.get(stream.topic)
        if channel is not None and channel.schema_name() == stream.schema_name:
            return
        if channel is not None:
            # Another robustifier, another message type. Viewers refuse a second channel of the same topic.
            channel.close()
        self._channels[stream.topic] = open_channel(self._context, stream)

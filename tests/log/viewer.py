"""A viewer for tests: a client of the Foxglove WebSocket protocol that stores all messages."""

import base64
import functools
import json
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from cranectl.mcap_columns.rows import decode_table
from tests.pace import HANG

RESUBSCRIBE_TIME = 3.0  # [s] after which the viewer subscribes to its topics again


class Viewer:
    """A client in one thread; `until` receives messages until a condition is true."""

    def __init__(self, port: int) -> None:
        self._connection = connect(
            f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"], max_size=None, max_queue=None
        )
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self.services: dict[str, dict[str, Any]] = {}
        self.parameters: dict[str, Any] = {}
        self.messages: list[tuple[str, int, bytes]] = []
        self.answers: dict[int, bytes] = {}
        self.clock_ns: list[int] = []
        self._topics: dict[int, str] = {}  # by subscription
        self._wanted: set[str] = set()
        self._calls = 0

    def __enter__(self) -> "Viewer":
        self._socket = self._connection.__enter__()
        self.until(lambda: self.info and self.services)
        return self

    def __exit__(self, *details: Any) -> None:
        self._connection.__exit__(*details)

    def until(self, condition: Callable[[], object]) -> None:
        """Receive messages until a condition is true."""
        end = time.monotonic() + HANG
        next_try = time.monotonic() + RESUBSCRIBE_TIME
        while not condition():
            assert time.monotonic() < end, "the condition never became true"
            self._receive(0.2)
            if time.monotonic() > next_try:
                # A channel may be removed between its advertisement and our subscription.
                next_try = time.monotonic() + RESUBSCRIBE_TIME
                for topic in self._wanted & set(self.channels):
                    self._subscribe(topic)

    def rest(self, seconds: float) -> None:
        """Receive messages for some time."""
        end = time.monotonic() + seconds
        while (remaining := end - time.monotonic()) > 0.0:
            self._receive(remaining)

    def until_closed(self) -> None:
        try:
            while True:
                self._handle(self._socket.recv(HANG))
        except ConnectionClosed:
            pass

    def subscribe(self, *topics: str) -> None:
        """Subscribe to topics, also when they are advertised again; by default to all present ones."""
        for topic in topics or self.channels:
            self._wanted.add(topic)
            self._subscribe(topic)

    def set(self, **changes: object) -> None:
        """Set parameters, and wait until all values have come back."""
        self.parameters = {}
        self._send(
            op="setParameters",
            id="set",
            parameters=[{"name": name, "value": value} for name, value in changes.items()],
        )
        self.until(lambda: self.parameters)

    def get(self, *names: str) -> dict[str, Any]:
        self.parameters = {}
        self._send(op="getParameters", id="get", parameterNames=list(names))
        self.until(lambda: self.parameters)
        return self.parameters

    def watch(self, *names: str) -> None:
        """Request a message for each change of parameters."""
        self._send(op="subscribeParameterUpdates", parameterNames=list(names))

    def call(self, service: str, request: object = None) -> dict[str, Any]:
        self._calls += 1
        call, encoding, data = self._calls, b"json", json.dumps(request or {}).encode()
        head = struct.pack("<BIII", 2, self.services[service]["id"], call, len(encoding))
        self._socket.send(head + encoding + data)
        self.until(lambda: call in self.answers)
        answer: dict[str, Any] = json.loads(self.answers[call])
        return answer

    def advertise(self, topic: str, *, encoding: str = "json") -> None:
        """Advertise a topic, as a panel that publishes does."""
        channel = {"id": 1, "topic": topic, "encoding": encoding, "schemaName": "geometry_msgs/Twist"}
        self._send(op="advertise", channels=[channel])

    def publish(self, message: object) -> None:
        """Publish on the advertised topic; bytes are sent unchanged."""
        data = message if isinstance(message, bytes) else json.dumps(message).encode()
        self._socket.send(struct.pack("<BI", 1, 1) + data)

    def send_nonsense(self, times: int) -> None:
        for _ in range(times):
            self._socket.send("nonsense")

    def of(self, topic: str) -> list[tuple[int, bytes]]:
        """Return times and messages of a topic."""
        return [(time_ns, data) for name, time_ns, data in self.messages if name == topic]

    def decoded(self, topic: str) -> list[Any]:
        """Return the messages of a topic, decoded with its own schema."""
        kind = message_type(
            self.channels[topic]["schemaName"], base64.b64decode(self.channels[topic]["schema"])
        )
        return [kind.FromString(data) for _, data in self.of(topic)]

    def wait_for(self, topic: str, is_expected: Callable[[Any], object] = lambda _: True) -> Any:
        """Wait until the newest message of a topic is as expected; return it."""
        self.until(lambda: self.of(topic) and is_expected(self.decoded(topic)[-1]))
        return self.decoded(topic)[-1]

    def events(self) -> list[str]:
        """Return the messages of `/log`."""
        return [line.message for line in self.decoded("/log")]

    def wait_for_event(self, text: str) -> None:
        """Wait until a message of `/log` contains a text."""
        self.until(lambda: any(text in event for event in self.events()))

    def clear_messages(self) -> None:
        self.messages.clear()

    def _subscribe(self, topic: str) -> None:
        number = len(self._topics) + 1
        self._topics[number] = topic
        self._send(op="subscribe", subscriptions=[{"id": number, "channelId": self.channels[topic]["id"]}])

    def _send(self, **message: object) -> None:
        self._socket.send(json.dumps(message))

    def _receive(self, timeout: float) -> None:
        try:
            self._handle(self._socket.recv(timeout))
        except TimeoutError:
            return

    def _handle(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            self._handle_binary(message)
            return
        data = json.loads(message)
        if data["op"] == "serverInfo":
            self.info = data
        elif data["op"] == "advertise":
            for channel in data["channels"]:
                assert channel["topic"] not in self.channels, "viewers refuse a second channel of a topic"
                self.channels[channel["topic"]] = channel
                if channel["topic"] in self._wanted:
                    self._subscribe(channel["topic"])
        elif data["op"] == "unadvertise":
            removed = set(data["channelIds"])
            self.channels = {topic: c for topic, c in self.channels.items() if c["id"] not in removed}
        elif data["op"] == "advertiseServices":
            self.services = {service["name"]: service for service in data["services"]}
        elif data["op"] == "parameterValues":
            self.parameters |= {p["name"]: p["value"] for p in data["parameters"]}

    def _handle_binary(self, message: bytes) -> None:
        kind = message[0]
        if kind == 1:
            number, time_ns = struct.unpack_from("<IQ", message, 1)
            self.messages.append((self._topics[number], time_ns, message[13:]))
        elif kind == 2:
            self.clock_ns.append(struct.unpack_from("<Q", message, 1)[0])
        elif kind == 3:
            _, call, length = struct.unpack_from("<III", message, 1)
            self.answers[call] = message[13 + length :]


@functools.cache
def message_type(name: str, definition: bytes) -> Any:
    """Return the class of a protobuf message from a FileDescriptorSet."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(definition).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


def messages_of(log: Path, topic: str) -> list[tuple[int, Any]]:
    """Return times [ns] and messages of a topic of a log, decoded with the types in the log."""
    with log.open("rb") as stream:
        return [
            (message.log_time, message_type(schema.name, schema.data).FromString(message.data))
            for schema, _, message in make_reader(stream).iter_messages(topic)
            if schema is not None
        ]


def decode_rows(messages: list[bytes], n_signals: int) -> np.ndarray:
    """Return the signals (N, signals) in the messages of a group."""
    return decode_table(np.frombuffer(b"".join(messages), dtype=np.uint8), n_signals)

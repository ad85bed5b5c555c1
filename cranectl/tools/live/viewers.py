"""Connect viewers: the server, its parameters and services, and the channels to viewers and recording."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from queue import SimpleQueue

import foxglove
from foxglove.websocket import (
    Capability,
    ChannelView,
    Client,
    ClientChannel,
    MessageSchema,
    Parameter,
    ServerListener,
    Service,
    ServiceRequest,
    ServiceSchema,
    WebSocketServer,
)

from cranectl.log import Channels
from cranectl.support import InputError
from cranectl.tools.live.commands import Controls, Value, drain
from cranectl.tools.live.guard import Guard, hidden_host

VELOCITY_TOPIC = "/wish"  # the topic on which clients drive by hand
BACKLOG = 8192  # messages that wait for a slow viewer, almost two seconds; it loses any further ones


@dataclass(frozen=True)
class Address:
    """Where the server listens (port 0: any free port), and which other web pages may connect."""

    host: str = "127.0.0.1"
    port: int = 8765
    origins: tuple[str, ...] = ()


class Listener(ServerListener):
    """Receives the requests of viewers; the server's threads call its methods."""

    def __init__(self, controls: Controls) -> None:
        self._controls = controls
        self._subscribed: SimpleQueue[str] = SimpleQueue()
        self._velocity_channels: set[tuple[int, int]] = set()  # clients and their channels

    def on_client_advertise(self, client: Client, channel: ClientChannel) -> None:
        if channel.topic == VELOCITY_TOPIC and channel.encoding == "json":
            self._velocity_channels.add((client.id, channel.id))
        else:
            self._controls.refuse(
                f"messages on {channel.topic} in {channel.encoding}", f"JSON on {VELOCITY_TOPIC}"
            )

    def on_client_unadvertise(self, client: Client, client_channel_id: int) -> None:
        self._velocity_channels.discard((client.id, client_channel_id))

    def on_message_data(self, client: Client, client_channel_id: int, data: bytes) -> None:
        if (client.id, client_channel_id) in self._velocity_channels:
            self._controls.drive_by_hand(data)

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002 (SDK's signature)
        self._subscribed.put(channel.topic)

    def on_get_parameters(
        self,
        client: Client,  # noqa: ARG002 (SDK's signature)
        param_names: list[str],
        request_id: str | None = None,  # noqa: ARG002
    ) -> list[Parameter]:
        values = self._controls.values()
        return as_parameters(
            {name: value for name, value in values.items() if name in (param_names or values)}
        )

    def on_set_parameters(
        self,
        client: Client,  # noqa: ARG002 (SDK's signature)
        parameters: list[Parameter],
        request_id: str | None = None,  # noqa: ARG002
    ) -> list[Parameter]:
        self._controls.set({parameter.name: parameter.get_value() for parameter in parameters})
        return as_parameters(self._controls.values())

    def subscribed(self) -> set[str]:
        """Return the topics that have new subscribers since the last call."""
        return set(drain(self._subscribed))

    def services(self) -> list[Service]:
        """Return the services that viewers can call; all but `go` take an empty request `{}`."""
        controls, number = self._controls, {"type": "number"}
        return [
            _service("pulse", lambda _: controls.pulse(), "pulse_alpha and pulse_beta say how strong"),
            _service("reset", lambda _: controls.reset(), "the scenario starts again, time goes on"),
            _service("pause", lambda _: controls.set({"pause": True}), "/resume goes on"),
            _service("resume", lambda _: controls.set({"pause": False}), "the run goes on"),
            _service("go", controls.go, "/log says if it cannot", dict.fromkeys("xyz", number)),
        ]


def listen(
    address: Address, name: str, listener: Listener, channels: Channels
) -> tuple[WebSocketServer, Guard]:
    """Start the server and its guard; raise InputError if they cannot listen at the address."""
    host = hidden_host()
    server = foxglove.start_server(
        name=f"cranectl live {name}",
        host=host,
        port=0,
        capabilities=[Capability.Parameters, Capability.Services, Capability.Time, Capability.ClientPublish],
        server_listener=listener,
        supported_encodings=["json"],
        services=listener.services(),
        context=channels.context,
        message_backlog_size=BACKLOG,
    )
    try:
        return server, Guard((address.host, address.port), (host, server.port), address.origins)
    except (OSError, OverflowError, UnicodeError) as error:
        server.stop()
        raise InputError(
            f"cannot listen on {address.host}, port {address.port}: {error}",
            allowed="an address of this machine and a port that no other program uses",
            remedy="end the other program, or choose another port with --port (0: any free one)",
        ) from None


def as_parameters(values: Mapping[str, Value]) -> list[Parameter]:
    """Convert values to the parameters that the server sends."""
    return [Parameter(name, value=value) for name, value in values.items()]


def _service(
    name: str, act: Callable[[bytes], None], answer: str, fields: Mapping[str, object] = {}
) -> Service:
    def handle(request: ServiceRequest) -> bytes:
        act(request.payload)
        return json.dumps({"message": answer}).encode()

    title = name.capitalize()
    text = {"message": {"type": "string"}}
    return Service(
        f"/{name}",
        schema=ServiceSchema(
            f"cranectl.{title}",
            request=_json_schema(f"{title}Request", fields),
            response=_json_schema(f"{title}Response", text),
        ),
        handler=handle,
    )


def _json_schema(name: str, properties: Mapping[str, object]) -> MessageSchema:
    data = json.dumps({"type": "object", "properties": properties}).encode()
    full_name = f"cranectl.{name}"
    return MessageSchema(
        encoding="json", schema=foxglove.Schema(name=full_name, encoding="jsonschema", data=data)
    )

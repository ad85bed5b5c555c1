"""Where viewers connect: server, parameters, services."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from queue import SimpleQueue

import foxglove
from foxglove.websocket import (
    Capability,
    ChannelView,
    Client,
    MessageSchema,
    Parameter,
    ServerListener,
    Service,
    ServiceRequest,
    ServiceSchema,
    WebSocketServer,
)

from cranectl.live.commands import Controls, Value, taken
from cranectl.live.guard import Guard, hidden_host
from cranectl.log import schema
from cranectl.support.errors import InputError

BACKLOG = 8192  # messages a slow viewer may fall behind before it loses some: almost two seconds


@dataclass(frozen=True)
class Address:
    """Where to listen, port 0 is any free one; and which web pages may connect besides Foxglove's own."""

    host: str = "127.0.0.1"
    port: int = 8765
    origins: tuple[str, ...] = ()


class Listener(ServerListener):
    """Hears what viewers ask for; called from the server's threads."""

    def __init__(self, controls: Controls) -> None:
        self._controls = controls
        self._subscribed: SimpleQueue[str] = SimpleQueue()

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
        """Topics that have new subscribers since the last call."""
        return set(taken(self._subscribed))

    def services(self) -> list[Service]:
        """What viewers can call, with a request of `{}`."""
        return [
            _service("pulse", self._controls.pulse, "pulse_alpha and pulse_beta say how strong"),
            _service("reset", self._controls.reset, "the scenario starts again, time goes on"),
            _service("pause", lambda: self._controls.set({"pause": True}), "/resume goes on"),
            _service("resume", lambda: self._controls.set({"pause": False}), "the run goes on"),
        ]


def listen(
    address: Address, name: str, listener: Listener, context: foxglove.Context
) -> tuple[WebSocketServer, Guard]:
    """Start the server and the guard before it; raises InputError for an address that cannot be had."""
    host = hidden_host()
    server = foxglove.start_server(
        name=f"cranectl live {name}",
        host=host,
        port=0,
        capabilities=[Capability.Parameters, Capability.Services, Capability.Time],
        server_listener=listener,
        supported_encodings=["json"],
        services=listener.services(),
        context=context,
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
    """As the server sends them."""
    return [Parameter(name, value=value) for name, value in values.items()]


def _service(name: str, act: Callable[[], None], answer: str) -> Service:
    def handle(_request: ServiceRequest) -> bytes:
        act()
        return json.dumps({"message": answer}).encode()

    title = name.capitalize()
    text = {"message": {"type": "string"}}
    return Service(
        f"/{name}",
        schema=ServiceSchema(
            f"{schema.PACKAGE}.{title}",
            request=_json_schema(f"{title}Request", {}),
            response=_json_schema(f"{title}Response", text),
        ),
        handler=handle,
    )


def _json_schema(name: str, properties: Mapping[str, object]) -> MessageSchema:
    data = json.dumps({"type": "object", "properties": properties}).encode()
    full_name = f"{schema.PACKAGE}.{name}"
    return MessageSchema(
        encoding="json", schema=foxglove.Schema(name=full_name, encoding="jsonschema", data=data)
    )

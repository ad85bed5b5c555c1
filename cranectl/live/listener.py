"""Where viewers connect and ask: server, parameters, services. Called from the server's threads."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from queue import Empty, SimpleQueue

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

from cranectl.live.commands import Controls, Value
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


class Desk(ServerListener):
    """Where viewers ask for things; called from the server's threads."""

    def __init__(self, controls: Controls) -> None:
        self._controls = controls
        self._asked: SimpleQueue[str] = SimpleQueue()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002 (SDK's signature)
        self._asked.put(channel.topic)

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

    def asked(self) -> set[str]:
        """Topics that have new subscribers since the last call."""
        found = set()
        while True:
            try:
                found.add(self._asked.get_nowait())
            except Empty:
                return found

    def services(self) -> list[Service]:
        """What viewers can call, with a request of `{}`."""
        return [
            _service("kick", self._controls.kick, "kick_alpha and kick_beta say how hard"),
            _service("reset", self._controls.reset, "the scenario starts again, time goes on"),
            _service("pause", lambda: self._controls.set({"pause": True}), "/resume goes on"),
            _service("resume", lambda: self._controls.set({"pause": False}), "the run goes on"),
        ]


def listen(
    address: Address, name: str, desk: Desk, context: foxglove.Context
) -> tuple[WebSocketServer, Guard]:
    """Start the server and the guard before it; raises InputError for an address that cannot be had."""
    host = hidden_host()
    server = foxglove.start_server(
        name=f"cranectl live {name}",
        host=host,
        port=0,
        capabilities=[Capability.Parameters, Capability.Services, Capability.Time],
        server_listener=desk,
        supported_encodings=["json"],
        services=desk.services(),
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


def _service(name: str, act: Callable[[], None], said: str) -> Service:
    def handle(_request: ServiceRequest) -> bytes:
        act()
        return json.dumps({"message": said}).encode()

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

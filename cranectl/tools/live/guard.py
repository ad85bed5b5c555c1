"""Decide which network clients may connect to the live server.

The server's library accepts every client, even a web page that a user happens to visit. This guard stands
before it. A browser names the page that wants to connect in the header Origin, and the requested host in the
header Host. The guard refuses web pages of other machines unless the user allows them. If it listens on a
loopback address, it also refuses requests to any other host name (DNS rebinding). Programs other than
browsers usually send no Origin, so they pass. The library itself listens at an address that is hard to
guess: see `hidden_host`.
"""

import contextlib
import http.client
import io
import ipaddress
import logging
import os
import secrets
import socket
import socketserver
import struct
import threading
from collections.abc import Callable, Collection, Iterator
from urllib.parse import urlsplit

from cranectl.support import InputError, printable

FOXGLOVE = frozenset({"https://app.foxglove.dev", "https://studio.foxglove.dev"})
MAX_HEAD_BYTES = 16 * 1024  # [bytes] of a request; browsers send one or two
REQUEST_TIMEOUT = 10.0  # [s] to send a request, or to close the connection
SEND_TIMEOUT = 60  # [s] after which a viewer that accepts no data is disconnected
MAX_VIEWERS = 64  # connected at the same time; each needs two threads and two sockets
RECEIVE_BUFFER = 64 * 1024  # [bytes]

_LOGGER = logging.getLogger(__name__)


class Guard(socketserver.ThreadingTCPServer):
    """Listens in place of a server and forwards only permitted connections to it."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = 64
    allow_reuse_address = os.name == "posix"  # on Windows, reuse would take ports from other programs

    def __init__(
        self, address: tuple[str, int], server: tuple[str, int], origins: Collection[str] = ()
    ) -> None:
        """Listen at `address`; raise OSError or OverflowError if that is impossible."""
        self.host, self.server, self.origins = address[0], server, origins
        self.free_connections = threading.BoundedSemaphore(MAX_VIEWERS)
        (self.address_family, *_), *_ = socket.getaddrinfo(*address, type=socket.SOCK_STREAM)
        super().__init__(address, _ConnectionHandler)
        self.port = int(self.server_address[1])
        threading.Thread(target=self.serve_forever, args=[0.05], daemon=True).start()

    def stop(self) -> None:
        """Stop accepting connections."""
        self.shutdown()
        self.server_close()

    def handle_error(self, *_: object) -> None:
        """Ignore a viewer that disconnects during the handshake."""


class _ConnectionHandler(socketserver.BaseRequestHandler):
    server: Guard
    request: socket.socket

    def handle(self) -> None:
        if not self.server.free_connections.acquire(blocking=False):
            _LOGGER.warning("%d viewers are connected already; another one was refused", MAX_VIEWERS)
            self._respond("503 Service Unavailable")
            return
        try:
            self._check_and_forward()
        finally:
            self.server.free_connections.release()

    def _check_and_forward(self) -> None:
        self.request.settimeout(REQUEST_TIMEOUT)
        head = b""
        while b"\r\n\r\n" not in head:
            data = self.request.recv(RECEIVE_BUFFER)
            head += data
            if not data or len(head) > MAX_HEAD_BYTES:
                return
        reason = refusal(head, self.server.host, self.server.origins)
        if reason:
            _LOGGER.warning("%s", reason)
            self._respond("403 Forbidden")
        else:
            with socket.create_connection(self.server.server) as server:
                self._forward(server, head)

    def _respond(self, status: str) -> None:
        head = f"HTTP/1.1 {status}\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
        self.request.sendall(head.encode())

    def _forward(self, server: socket.socket, head: bytes) -> None:
        """Forward data in both directions until one side closes the connection."""
        is_posix = os.name == "posix"
        timeout = struct.pack("ll", SEND_TIMEOUT, 0) if is_posix else struct.pack("L", 1000 * SEND_TIMEOUT)
        for end in (self.request, server):
            end.settimeout(None)
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, timeout)
        server.sendall(head)
        to_server = threading.Thread(target=_copy_data, args=[self.request, server], daemon=True)
        to_server.start()
        _copy_data(server, self.request)
        to_server.join(REQUEST_TIMEOUT)
        with contextlib.suppress(OSError):
            self.request.shutdown(socket.SHUT_RDWR)


def _copy_data(source: socket.socket, sink: socket.socket) -> None:
    try:
        while data := source.recv(RECEIVE_BUFFER):
            sink.sendall(data)
    except BlockingIOError:
        _LOGGER.warning("a viewer that accepted no data for %d s was disconnected", SEND_TIMEOUT)
    except OSError:
        pass
    with contextlib.suppress(OSError):
        sink.shutdown(socket.SHUT_WR)


def refusal(head: bytes, host: str, origins: Collection[str]) -> str:
    """Return why the guard refuses a request (RFC 9112) to `host`, or an empty text if it does not."""
    headers = http.client.parse_headers(io.BytesIO(head.partition(b"\r\n")[2]))
    for origin in headers.get_all("Origin", []):
        if not _is_allowed_origin(origin, origins):
            return (
                f"the web page {printable(origin)} was refused; "
                f"if you trust it, start again with --allow-origin {printable(origin)}"
            )
    for name in headers.get_all("Host", []):
        if _is_loopback(host) and not _is_loopback(called := _host_of(f"//{name}")) and called != host:
            return f"a request to {printable(name)} was refused: {host} serves only this machine"
    return ""


def checked_origin(text: str) -> str:
    """Return `text` in the form that browsers send; raise InputError if it is no web origin."""
    origin = text.lower().rstrip("/")
    scheme, _, authority = origin.partition("://")
    if scheme not in ("http", "https") or not _host_of(origin) or set(authority) & set("/?#@*"):
        raise InputError(
            f"--allow-origin {text}",
            allowed="scheme and host of a web page, with its port if the address has one",
            remedy="write it as in https://viewer.example.org or http://192.168.1.20:8080",
        )
    return origin


def _is_allowed_origin(origin: str, origins: Collection[str]) -> bool:
    """Return True for Foxglove, listed origins, pages of this machine, and schemes other than http(s)."""
    if origin in FOXGLOVE or origin in origins:
        return True
    scheme = origin.partition(":")[0].lower()  # a browser sends `null` to hide the page
    return _is_loopback(_host_of(origin)) if scheme in ("http", "https") else origin.lower() != "null"


def _host_of(address: str) -> str:
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""


def _is_loopback(host: str) -> bool:
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


def hidden_host() -> str:
    """Return a random loopback address that web pages can hardly guess; 127.0.0.1 if none can be bound."""
    host = f"127.{secrets.randbelow(254) + 1}.{secrets.randbelow(256)}.{secrets.randbelow(254) + 1}"
    with contextlib.suppress(OSError), socket.socket() as probe:
        probe.bind((host, 0))
        return host
    return "127.0.0.1"


LOGGERS = ("foxglove.websocket", "cranectl.tools.live.guard")


class _Counter(logging.Handler):
    """Reports the first warning and counts all, because clients can send wrong messages very fast."""

    def __init__(self, report: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self.count = 0
        self._report = report

    def emit(self, record: logging.LogRecord) -> None:
        self.count += 1
        if self.count == 1:
            self._report(f"{printable(record.getMessage())}; further warnings are only counted")


@contextlib.contextmanager
def report_warnings(report: Callable[[str], None]) -> Iterator[None]:
    """Report the first warning of the server during the block, and at the end the number of all warnings."""
    counter = _Counter(report)
    for name in LOGGERS:
        logging.getLogger(name).addHandler(counter)
    try:
        yield
    finally:
        for name in LOGGERS:
            logging.getLogger(name).removeHandler(counter)
        if counter.count > 1:
            report(f"{counter.count} warnings about clients in total")

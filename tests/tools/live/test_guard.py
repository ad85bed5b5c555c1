"""Only programs, and web pages of Foxglove, this machine or allowed origins, may connect to a session."""

import contextlib
import logging
import socket
import threading
from collections.abc import Iterator

import pytest

from cranectl.support.errors import InputError
from cranectl.tools.live import guard
from cranectl.tools.live.guard import Guard, checked_origin, hidden_host, refusal
from tests.pace import HANG


def request(**headers: str) -> bytes:
    lines = ["GET / HTTP/1.1", *(f"{name}: {value}" for name, value in headers.items())]
    return "\r\n".join([*lines, "", ""]).encode()


@pytest.mark.parametrize(
    "origin",
    [
        "https://app.foxglove.dev", "https://studio.foxglove.dev", "http://localhost:8080",
        "https://127.0.0.1", "http://[::1]:8080", "https://mine.example", "file://", "app://lichtblick",
        "vscode-webview://1a2b",
    ],
)  # fmt: skip
def test_allowed_origins_may_connect(origin: str) -> None:
    assert refusal(request(Host="127.0.0.1:8765", Origin=origin), "127.0.0.1", ["https://mine.example"]) == ""


@pytest.mark.parametrize(
    "origin",
    [
        "https://evil.example", "null", "NULL", "http://app.foxglove.dev",
        "https://app.foxglove.dev.evil.example", "https://localhost.evil.example",
        "https://mine.example:444", "http://127.0.0.1.evil.example", "http://[::1", "https://",
        "HTTPS://evil.example", "http://192.168.1.2",
    ],
)  # fmt: skip
@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_other_origins_are_refused(origin: str, host: str) -> None:
    reason = refusal(request(Host="127.0.0.1:8765", Origin=origin), host, ["https://mine.example"])
    assert f"--allow-origin {origin}" in reason


def test_every_origin_header_must_be_allowed() -> None:
    head = b"GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: file://\r\norigin: https://evil.example\r\n\r\n"
    assert "evil.example" in refusal(head, "127.0.0.1", [])


@pytest.mark.parametrize(
    ("requested_host", "host", "refused"),
    [
        ("localhost:8765", "127.0.0.1", False),
        ("127.0.0.1", "localhost", False),
        ("[::1]:8765", "::1", False),
        ("127.1.2.3:8765", "127.0.0.1", False),
        ("evil.example:8765", "127.0.0.1", True),
        ("localhost.evil.example", "127.0.0.1", True),
        ("evil.example", "::1", True),
        ("", "127.0.0.1", True),
        ("lab-pc:8765", "0.0.0.0", False),  # this machine may have any name in its network
        ("lab-pc:8765", "192.168.1.20", False),
    ],
)
def test_only_local_names_lead_to_a_local_session(requested_host: str, host: str, refused: bool) -> None:
    assert bool(refusal(request(Host=requested_host), host, [])) == refused


def test_a_refusal_contains_no_control_characters() -> None:
    assert "\x1b" not in refusal(request(Origin="https://a\x1b[2J" + "b" * 5000), "127.0.0.1", [])
    assert len(refusal(request(Origin="https://" + "b" * 5000), "127.0.0.1", [])) < 2000


def test_origins_are_normalised_or_refused() -> None:
    assert checked_origin("HTTPS://Mine.Example/") == "https://mine.example"
    assert checked_origin("http://10.0.0.7:8080") == "http://10.0.0.7:8080"
    for wrong in ("*", "mine.example", "https://*.example", "https://mine.example/page", "null", "file://"):
        with pytest.raises(InputError, match="--allow-origin"):
            checked_origin(wrong)


def test_hidden_addresses_differ_and_can_be_bound() -> None:
    hosts = {hidden_host() for _ in range(10)}
    assert len(hosts) > 5
    for host in hosts:
        with socket.socket() as probe:
            probe.bind((host, 0))


REQUEST = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"


@contextlib.contextmanager
def guarded_server() -> Iterator[tuple[socket.socket, Guard]]:
    """Listen as the server behind a guard."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(HANG)
        guard_of_server = Guard(("127.0.0.1", 0), server.getsockname())
        try:
            yield server, guard_of_server
        finally:
            guard_of_server.stop()


def test_a_viewer_that_does_not_read_is_disconnected(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It does not close its connection either; its thread and its socket are released."""
    monkeypatch.setattr(guard, "SEND_TIMEOUT", 1)
    before = threading.active_count()
    with guarded_server() as (server, proxy):
        with socket.create_connection(("127.0.0.1", proxy.port)) as viewer:
            viewer.sendall(REQUEST)
            connection, _ = server.accept()
            monkeypatch.setattr(guard, "REQUEST_TIMEOUT", 1.0)  # the request has been received
            connection.settimeout(HANG)
            with connection, pytest.raises(ConnectionError):
                connection.sendall(bytes(1 << 26))
            for thread in threading.enumerate():
                if thread.name.endswith("(process_request_thread)"):
                    thread.join(HANG)
        (message,) = [record.getMessage() for record in caplog.records]
        assert message == "a viewer that accepted no data for 1 s was disconnected"
    assert threading.active_count() <= before + 1


def test_excess_viewers_are_turned_away(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(guard, "MAX_VIEWERS", 2)
    with guarded_server() as (server, proxy), contextlib.ExitStack() as stack:
        address = ("127.0.0.1", proxy.port)

        def connect_viewer() -> socket.socket:
            viewer = stack.enter_context(socket.create_connection(address, HANG))
            viewer.sendall(REQUEST)
            return viewer

        def accept() -> socket.socket:
            return stack.enter_context(server.accept()[0])

        first_viewer = connect_viewer()
        first_connection = accept()
        connect_viewer()
        accept()
        assert connect_viewer().recv(100).startswith(b"HTTP/1.1 503 ")
        assert [record.levelno for record in caplog.records] == [logging.WARNING]
        first_viewer.close()
        first_connection.close()
        while True:  # until the guard has noticed that the first viewer has left
            viewer = stack.enter_context(socket.create_connection(address, HANG))
            viewer.sendall(REQUEST)
            server.settimeout(0.2)
            with contextlib.suppress(TimeoutError):
                accept()
                break

"""Who may connect to a live session: programs, and web pages of Foxglove, of this machine or allowed."""

import contextlib
import logging
import socket
import threading
from collections.abc import Iterator

import pytest

from cranectl.live import guard
from cranectl.live.guard import Guard, checked_origin, hidden_host, refusal
from cranectl.support.errors import InputError
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
def test_who_may(origin: str) -> None:
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
def test_who_may_not(origin: str, host: str) -> None:
    reason = refusal(request(Host="127.0.0.1:8765", Origin=origin), host, ["https://mine.example"])
    assert f"--allow-origin {origin}" in reason


def test_one_good_origin_does_not_hide_a_bad_one() -> None:
    head = b"GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: file://\r\norigin: https://evil.example\r\n\r\n"
    assert "evil.example" in refusal(head, "127.0.0.1", [])


@pytest.mark.parametrize(
    ("called", "host", "refused"),
    [
        ("localhost:8765", "127.0.0.1", False),
        ("127.0.0.1", "localhost", False),
        ("[::1]:8765", "::1", False),
        ("127.1.2.3:8765", "127.0.0.1", False),
        ("evil.example:8765", "127.0.0.1", True),
        ("localhost.evil.example", "127.0.0.1", True),
        ("evil.example", "::1", True),
        ("", "127.0.0.1", True),
        ("lab-pc:8765", "0.0.0.0", False),  # it has names that are not known here
        ("lab-pc:8765", "192.168.1.20", False),
    ],
)
def test_names_that_lead_to_a_session_of_this_machine(called: str, host: str, refused: bool) -> None:
    assert bool(refusal(request(Host=called), host, [])) == refused


def test_what_a_page_says_cannot_act_on_a_terminal() -> None:
    assert "\x1b" not in refusal(request(Origin="https://a\x1b[2J" + "b" * 5000), "127.0.0.1", [])
    assert len(refusal(request(Origin="https://" + "b" * 5000), "127.0.0.1", [])) < 2000


def test_origins_to_allow() -> None:
    assert checked_origin("HTTPS://Mine.Example/") == "https://mine.example"
    assert checked_origin("http://10.0.0.7:8080") == "http://10.0.0.7:8080"
    for wrong in ("*", "mine.example", "https://*.example", "https://mine.example/page", "null", "file://"):
        with pytest.raises(InputError, match="--allow-origin"):
            checked_origin(wrong)


def test_the_hidden_address_differs_each_time_and_can_be_had() -> None:
    hosts = {hidden_host() for _ in range(10)}
    assert len(hosts) > 5
    for host in hosts:
        with socket.socket() as probe:
            probe.bind((host, 0))


ASKED = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"


@contextlib.contextmanager
def guarded() -> Iterator[tuple[socket.socket, Guard]]:
    """Listen as the server that hides behind a guard."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(HANG)
        behind = Guard(("127.0.0.1", 0), server.getsockname())
        try:
            yield server, behind
        finally:
            behind.stop()


def test_a_viewer_that_takes_nothing_is_disconnected(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It neither reads nor goes; what it held is free again."""
    monkeypatch.setattr(guard, "STALLED", 1)
    before = threading.active_count()
    with guarded() as (server, behind):
        with socket.create_connection(("127.0.0.1", behind.port)) as viewer:
            viewer.sendall(ASKED)
            inside, _ = server.accept()
            monkeypatch.setattr(guard, "REQUEST_TIMEOUT", 1.0)  # what was sent has come
            inside.settimeout(HANG)
            with inside, pytest.raises(ConnectionError):
                inside.sendall(bytes(1 << 26))
            for thread in threading.enumerate():
                if thread.name.endswith("(process_request_thread)"):
                    thread.join(HANG)
        (said,) = [record.getMessage() for record in caplog.records]
        assert said == "a viewer that took nothing for 1 s was disconnected"
    assert threading.active_count() <= before + 1


def test_more_viewers_than_there_is_room_for_are_turned_away(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(guard, "VIEWERS", 2)
    with guarded() as (server, behind), contextlib.ExitStack() as stack:
        address = ("127.0.0.1", behind.port)

        def come() -> socket.socket:
            viewer = stack.enter_context(socket.create_connection(address, HANG))
            viewer.sendall(ASKED)
            return viewer

        def meet() -> socket.socket:
            return stack.enter_context(server.accept()[0])

        one = come()
        insides = [meet()]
        come()
        insides.append(meet())
        assert come().recv(100).startswith(b"HTTP/1.1 503 ")
        assert [record.levelno for record in caplog.records] == [logging.WARNING]
        one.close()
        for inside in insides[:1]:
            inside.close()
        while True:  # until the guard has noticed
            viewer = stack.enter_context(socket.create_connection(address, HANG))
            viewer.sendall(ASKED)
            server.settimeout(0.2)
            with contextlib.suppress(TimeoutError):
                meet()
                break

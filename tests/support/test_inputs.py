"""Pipes in place of files: one that nobody writes into ends a command instead of making it wait."""

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from cranectl.loaders.opening import open_controller
from cranectl.log.reader import read_log
from cranectl.planning import load_scenario
from cranectl.support.documents import TOML
from cranectl.support.errors import InputError
from cranectl.support.files import File
from cranectl.tools.benchmark.table import BenchmarkTable
from tests.pace import HANG

FILE = """
name = "of-a-file"
duration = 1.0
reference.start = [0.0, 0.0, -1.0]
[[reference.segments]]
kind = "samples"
file = "pipe.csv"
"""


def ended(call: Callable[[], object], pipe: Path) -> object:
    """Return what `call` raises; end it where it waits for `pipe`."""
    came: list[object] = []

    def catch() -> None:
        try:
            came.append(call())
        except InputError as error:
            came.append(error)

    thread = threading.Thread(target=catch, daemon=True)
    thread.start()
    thread.join(HANG)
    if thread.is_alive():
        os.close(os.open(pipe, os.O_WRONLY | os.O_NONBLOCK))
        thread.join()
        pytest.fail("it waits for somebody who writes")
    return came[0]


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("pipe.toml", lambda pipe: load_scenario(str(pipe))),
        ("pipe.toml", lambda pipe: load_scenario("fixed-position", rig=str(pipe))),
        ("pipe.csv", lambda pipe: load_scenario(str(pipe.with_name("scenario.toml")))),
        ("pipe.mcap", read_log),
        ("pipe.parquet", BenchmarkTable.read),
        ("pipe.so", lambda pipe: open_controller(str(pipe))),
    ],
)
def test_a_pipe_that_nobody_writes_into_is_refused(
    name: str, read: Callable[[Path], object], tmp_path: Path
) -> None:
    pipe = tmp_path / name
    os.mkfifo(pipe)
    (tmp_path / "scenario.toml").write_text(FILE)
    error = ended(lambda: read(pipe), pipe)
    assert isinstance(error, InputError)
    assert f"{pipe} is a pipe" in error.found
    assert name != "pipe.toml" or error.remedy == "name a readable TOML file"


def test_what_a_shell_pipes_in_is_read(tmp_path: Path) -> None:
    """As with `<(command)`: a writer that has ended, and one that has not yet begun."""
    source, sink = os.pipe()
    os.write(sink, b"x = 1\n")
    os.close(sink)
    assert TOML.read(Path(f"/dev/fd/{source}")) == {"x": 1}
    os.close(source)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    both = os.open(pipe, os.O_RDWR)
    found: list[bytes] = []

    def read() -> None:
        with File(pipe).open(piped=10) as stream:
            found.append(stream.read())

    thread = threading.Thread(target=read)
    thread.start()
    os.write(both, b"0123456789abc")
    thread.join(HANG)
    os.close(both)
    assert found == [b"0123456789"]


def test_a_writer_that_stays_silent_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """As any program it waits for as long as the writer lives, and says so."""
    monkeypatch.setattr("cranectl.support.interrupts.SLOW", 0.01)
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    both, found = os.open(pipe, os.O_RDWR), list[object]()
    thread = threading.Thread(target=lambda: found.append(TOML.read(pipe)))
    thread.start()
    told, end = "", time.monotonic() + HANG
    while "whose writer" not in told and time.monotonic() < end:
        told += capfd.readouterr().err
    os.write(both, b"x = 1\n")
    os.close(both)
    thread.join(HANG)
    assert f"{pipe} is a pipe whose writer has neither written nor ended" in told
    assert "Ctrl-C ends the command" in told
    assert found == [{"x": 1}]

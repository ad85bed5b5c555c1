"""The oracle detects every violation that it is responsible for."""

import contextlib
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fuzz import oracle
from tests.fuzz.child_process import OUT_OF_MEMORY, Result, check


def raises() -> int:
    raise KeyError


def says(text: str, *, error: bool = False) -> Callable[[], int]:
    def command() -> int:
        print(text, file=sys.stderr if error else sys.stdout)
        return 2 if error else 0

    return command


OUTSIDE_FILE = Path(tempfile.gettempdir(), f"fuzz-{os.getpid()}")


def writes(name: str) -> Callable[[], int]:
    return lambda: Path(name).write_text("x") * 0


def computes() -> int:
    end = time.process_time() + 5.0
    while time.process_time() < end:
        pass
    return 0


def swallows() -> int:
    try:
        return computes()
    except Exception:
        return 0


FAULTS: dict[str, Callable[[], int]] = {
    "an undocumented exit code": lambda: 70,
    "an escape sequence": says("\x1b[2J"),
    "a carriage return": says("a\rb"),
    "an error without explanation": says("oh dear", error=True),
    "an endless error": says("found: " + "a" * 30_000, error=True),
    "invalid JSON": says("{'a': 1}"),
    "JSON with NaN": says('{"a": NaN}'),
    "a changed input": writes("s.toml"),
    "a file of another kind": writes("old.json"),
    "a file named -": writes("-"),
    "an unfinished file": writes("x.mcap.1.part"),
    "a file outside the directory": writes(str(OUTSIDE_FILE)),
    "a removed file": lambda: os.remove("notes.txt") or 0,  # noqa: PTH107
    "a hang": computes,
    "a hang that catches exceptions": swallows,
}


@pytest.mark.parametrize("name", FAULTS)
def test_the_oracle_detects_each_fault(template: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(oracle, "main", lambda _: FAULTS[name]())
    monkeypatch.setattr(oracle, "FIRST_TIME_LIMIT", 0.5)
    monkeypatch.setattr(oracle, "TIME_LIMIT", 0.1)
    with pytest.raises(AssertionError):
        oracle.check_command(template, ["--out", "old.json", *(["--json", "-"] if "JSON" in name else [])])
    OUTSIDE_FILE.unlink(missing_ok=True)


def test_the_oracle_detects_an_overwritten_input(template: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An input is protected even if it is a file of the kind that the command writes."""
    monkeypatch.setattr(oracle, "main", lambda _: Path("old.json").write_text("{\n") * 0)
    for line in (
        ["--json", "old.json", "sub/../old.json"],
        ["--json", "new.json", "old.json"],
        ["--json", "-"],
    ):
        with pytest.raises(AssertionError):
            oracle.check_command(template, ["info", *line])


def test_the_oracle_passes_exceptions_on(template: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(oracle, "main", lambda _: raises())
    with pytest.raises(KeyError):
        oracle.check_command(template, ["run"])


def test_the_oracle_accepts_correct_commands(template: Path) -> None:
    line = ["run", "s.toml", "--out", "x.mcap", "--json", "old.json"]
    code, files = oracle.check_command(template, line)
    assert code == 0
    assert files["here/x.mcap"] != (template / "x.mcap").read_bytes()
    repeated = ["list", "--json", "old.json", "--json", "./old.json"]
    assert oracle.check_command(template, repeated)[0] == 0
    repeated = ["run", "s.toml", "--json", "x.mcap", "--json", "new.json", "--out", "x.mcap"]
    assert oracle.check_command(template, repeated)[0] == 0
    assert oracle.check_command(template, ["run", "s.toml", "--rig", "no.toml"])[0] == 2


@pytest.mark.parametrize(
    ("code", "message", "allowed"),
    [
        (-signal.SIGABRT, f"Fatal Python error: _PyErr_NormalizeException: {OUT_OF_MEMORY[0]} while …", True),
        (-signal.SIGABRT, "free(): invalid pointer", False),
        (-signal.SIGSEGV, OUT_OF_MEMORY[1], False),
    ],
)
def test_only_python_itself_may_abort_without_memory(code: int, message: str, allowed: bool) -> None:
    with contextlib.nullcontext() if allowed else pytest.raises(AssertionError):
        check(Result(code, "", message), ["run"])

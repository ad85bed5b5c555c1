"""The oracle sees what it is there to see."""

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
from tests.fuzz.forked import NO_MEMORY, Told, check


def raises() -> int:
    raise KeyError


def says(text: str, *, error: bool = False) -> Callable[[], int]:
    def command() -> int:
        print(text, file=sys.stderr if error else sys.stdout)
        return 2 if error else 0

    return command


ELSEWHERE = Path(tempfile.gettempdir(), f"fuzz-{os.getpid()}")


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


MISDEEDS: dict[str, Callable[[], int]] = {
    "an exit code that is none": lambda: 70,
    "an escape": says("\x1b[2J"),
    "a line that forges": says("a\rb"),
    "an error without shape": says("oh dear", error=True),
    "an endless error": says("found: " + "a" * 30_000, error=True),
    "JSON that is none": says("{'a': 1}"),
    "JSON with NaN": says('{"a": NaN}'),
    "a changed input": writes("s.toml"),
    "a file of another kind": writes("old.json"),
    "a file named -": writes("-"),
    "an unfinished file": writes("x.mcap.1.part"),
    "a file elsewhere": writes(str(ELSEWHERE)),
    "a lost file": lambda: os.remove("notes.txt") or 0,  # noqa: PTH107
    "no end": computes,
    "an end that is swallowed": swallows,
}


@pytest.mark.parametrize("name", MISDEEDS)
def test_misdeeds_are_seen(template: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(oracle, "main", lambda _: MISDEEDS[name]())
    monkeypatch.setattr(oracle, "PATIENCE", 0.5)
    monkeypatch.setattr(oracle, "SECONDS", 0.1)
    with pytest.raises(AssertionError):
        oracle.check_command(template, ["--out", "old.json", *(["--json", "-"] if "JSON" in name else [])])
    ELSEWHERE.unlink(missing_ok=True)


def test_an_input_that_is_written_is_seen(template: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it is a file of the kind that the command writes."""
    monkeypatch.setattr(oracle, "main", lambda _: Path("old.json").write_text("{\n") * 0)
    for line in (
        ["--json", "old.json", "sub/../old.json"],
        ["--json", "new.json", "old.json"],
        ["--json", "-"],
    ):
        with pytest.raises(AssertionError):
            oracle.check_command(template, ["info", *line])


def test_errors_are_seen(template: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(oracle, "main", lambda _: raises())
    with pytest.raises(KeyError):
        oracle.check_command(template, ["run"])


def test_good_deeds_are_none(template: Path) -> None:
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
    ("code", "said", "may"),
    [
        (-signal.SIGABRT, f"Fatal Python error: _PyErr_NormalizeException: {NO_MEMORY} while …", True),
        (-signal.SIGABRT, "free(): invalid pointer", False),
        (-signal.SIGSEGV, NO_MEMORY, False),
    ],
)
def test_only_python_itself_may_abort_for_lack_of_memory(code: int, said: str, may: bool) -> None:
    with contextlib.nullcontext() if may else pytest.raises(AssertionError):
        check(Told(code, "", said), ["run"])

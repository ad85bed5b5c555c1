"""What a newcomer sees of the make commands: what goes on, also through a pipe, and what a limit says."""

import re
import subprocess
import sys

import pytest

from cranectl.cli import output
from tests.conftest import ROOT

LIMITED = (sys.executable, str(ROOT / ".ci" / "limited.py"))
SLEEP = (sys.executable, "-c", "import time; time.sleep(600)")


def limited(*arguments: str, limit: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*LIMITED, *arguments], env={"LIMIT": limit}, capture_output=True, text=True, check=False
    )


def test_a_limit_that_strikes_says_so_and_what_to_do() -> None:
    done = limited("validate", "1", *SLEEP)
    assert done.returncode == 124
    assert "make validate: ended after 1 s, its limit" in done.stderr
    assert "Run 'make validate' again" in done.stderr
    assert "'make validate LIMIT=4'" in done.stderr


def test_the_remedy_of_a_limit_replaces_it() -> None:
    """Exit codes of the command come through; LIMIT is what make exports."""
    assert limited("validate", "600", *SLEEP, limit="1").returncode == 124
    assert (
        limited("validate", "0.001", sys.executable, "-c", "raise SystemExit(3)", limit="0").returncode == 3
    )
    assert re.search(r"^export LIMIT$", (ROOT / "Makefile").read_text(), re.MULTILINE)


def test_a_silent_command_is_spoken_for() -> None:
    done = limited("--say", "installing", "setup", "600", sys.executable, "-c", "print('done')")
    assert (done.stdout, done.stderr) == ("done\n", "make setup: installing\n")


def test_no_target_is_ended_without_a_word() -> None:
    """By timeout(1), say; what runs the package or its tests has a limit."""
    lines = (ROOT / "Makefile").read_text().splitlines()
    assert not [line for line in lines if re.search(r"\btimeout\b", line)]
    recipes = [
        line for line in lines if re.search(r"^\t.*(-m pytest|cranectl validate|-m tests.kernels)", line)
    ]
    assert len(recipes) >= 8
    assert not [line for line in recipes if "$(call " not in line and ".ci/limited.py" not in line]


BOUNDS = (
    r"timeout=\s*[\d.]+[,)]",
    r"\b(settimeout|process\.join|process\.wait)\([\d.]+\)",
    r"assert .*\b(monotonic|perf_counter|time)\(\) - .* <",
)
TRIED_AGAIN = {"server.settimeout(0.2)"}  # until it succeeds


def test_no_test_has_a_bound_in_seconds_of_its_own() -> None:
    """A machine ten times slower would break it: what hangs ends after `tests.pace.HANG`."""
    files = [*(ROOT / "tests").rglob("*.py"), *(ROOT / "viewer").glob("*.py")]
    lines = {
        line.strip(): file.name for file in files for line in file.read_text(encoding="utf-8").splitlines()
    }
    bounded = {line for line in lines if any(re.search(bound, line) for bound in BOUNDS)}
    assert {line for line in bounded if lines[line] != "test_first_minutes.py"} == TRIED_AGAIN


def test_progress_goes_into_a_pipe_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(output, "LINE_EVERY", 0.01)
    told = ""
    with output.progress_bar(20.0, "fixed-position, lqr") as advance:
        advance(5.0)
        while "cranectl: fixed-position, lqr  5/20 s simulated\n" not in told:  # for ever, if it is not said
            told += capsys.readouterr().err

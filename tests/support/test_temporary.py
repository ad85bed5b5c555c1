"""Temporary directories, and what becomes of them when their process ends."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from cranectl.support import directories

# A process that has a directory for a controller, says where, and waits for a line before it looks again.
PROCESS = """
import sys
from pathlib import Path
from cranectl.loaders.opening import ControllerFile, copy_of
copy = copy_of(ControllerFile("law.so", Path("law.so"), "", b"code"))
print(copy.parents[1], flush=True)
sys.stdin.readline()
sys.exit(copy.read_bytes() != b"code")
"""
Start = Callable[[], subprocess.Popen[str]]


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Start:
    """Start such a process, whose directory will be in `tmp_path`."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    command = [sys.executable, "-c", PROCESS]
    return lambda: subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def place_of(process: subprocess.Popen[str]) -> Path:
    """Wait until a process has its directory."""
    assert process.stdout is not None
    return Path(process.stdout.readline().strip())


def end(process: subprocess.Popen[str]) -> int:
    process.communicate("\n")
    return process.returncode


def left_in(folder: Path) -> list[Path]:
    """Return what is in the directory of this user."""
    (above,) = folder.iterdir()
    assert above.name == f"cranectl-{os.geteuid()}"
    return sorted(above.iterdir())


def test_a_directory_is_removed_by_its_process_or_else_by_a_later_one(tmp_path: Path, start: Start) -> None:
    """Processes that start at once leave each other's directories."""
    killed = start()
    left = place_of(killed)
    killed.kill()
    assert end(killed) == -signal.SIGKILL
    assert left_in(tmp_path) == [left]
    for number in range(20):
        (left.parent / f"laws-{number}").mkdir()
    begun = [start() for _ in range(4)]
    places = [place_of(process) for process in begun]
    assert left_in(tmp_path) == sorted(places), "each living process keeps its own"
    assert [end(process) for process in begun] == [0] * len(begun)
    assert left_in(tmp_path) == []


def test_a_new_directory_that_another_process_removes_is_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between its making and its lock another process may take it for abandoned."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    lock, seen = directories._lock, []

    def remove_and_lock(directory: Path) -> int | None:
        seen.append(directory)
        if len(seen) == 1:
            directory.rmdir()
        return lock(directory)

    monkeypatch.setattr(directories, "_lock", remove_and_lock)
    made = directories.temporary_directory("laws")
    assert seen[-1] == made != seen[0]
    assert left_in(tmp_path) == [made]


@pytest.mark.parametrize("prepared", ["open to all", "a link", "of another user"])
def test_a_place_that_another_user_may_have_prepared_is_not_used(
    prepared: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    user = os.geteuid() + (prepared == "of another user")
    monkeypatch.setattr(os, "geteuid", lambda: user)
    above, target = tmp_path / f"cranectl-{user}", tmp_path / "elsewhere"
    (target / "laws-1").mkdir(mode=0o700, parents=True)
    if prepared == "a link":
        target.chmod(0o700)
        above.symlink_to(target)
    else:
        above.mkdir()
        above.chmod(0o777 if prepared == "open to all" else 0o700)
    made = directories.temporary_directory("laws")
    assert made.parent == tmp_path
    assert not list(above.glob("laws-[!1]*"))
    assert (target / "laws-1").is_dir()

"""Linux without what only POSIX systems have, and with the rules of Windows for open files."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.pace import HANG

# Each Python process that finds this module starts like one on Windows.
SITE = r"""
import multiprocessing, os, select, selectors, signal, socket, sys
from multiprocessing import context

sys.modules["fcntl"] = sys.modules["resource"] = None
for name in ("fork", "setpgid", "killpg", "geteuid", "getuid", "sched_getaffinity", "setsid", "mkfifo"):
    delattr(os, name)
for name in ("SIGHUP", "pthread_sigmask", "pthread_kill"):
    delattr(signal, name)
del select.poll


def select_sockets(*lists, wait=select.select):
    for each in (each for files in lists[:3] for each in files):
        if not isinstance(each, socket.socket):
            raise OSError(10038, "an operation was attempted on something that is not a socket")
    return wait(*lists)


select.select = select_sockets
context._default_context._default_context = context._concrete_contexts["spawn"]
multiprocessing.get_all_start_methods = lambda: ["spawn"]


def is_open(path):
    for name in os.listdir("/proc/self/fd"):
        try:
            if os.path.samestat(os.stat(f"/proc/self/fd/{name}"), os.stat(path)):
                return True
        except OSError:
            pass
    return False


def refuse_open(act):
    def acts(*paths, **given):
        for path in paths[:2]:
            if not isinstance(path, int) and os.path.isfile(path) and is_open(path):
                raise PermissionError(13, "the file is open", os.fspath(path))
        return act(*paths, **given)
    return acts


def fsync(descriptor, flush=os.fsync):
    with open(f"/proc/self/fdinfo/{descriptor}") as file:
        flags = next(int(line.split()[1], 8) for line in file if line.startswith("flags"))
    if flags & 3 == os.O_RDONLY:
        raise OSError(9, "Bad file descriptor")
    flush(descriptor)


for name in ("replace", "rename", "unlink", "remove"):
    setattr(os, name, refuse_open(getattr(os, name)))
os.fsync = fsync
"""
SHORT = ["--set", "duration=0.5", "--set", "disturbances.0.start=0.1", "--set", "disturbances.1.start=0.2"]
TWO = ["--plants", "analytic,mujoco"]


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Return the environment of processes as on Windows; the working directory is empty."""
    site, work = tmp_path / "site", tmp_path / "work"
    site.mkdir()
    work.mkdir()
    (site / "sitecustomize.py").write_text(SITE, encoding="utf-8")
    monkeypatch.chdir(work)
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}  # text files are ASCII by default
    return {**os.environ, **plain, "PYTHONPATH": f"{site}{os.pathsep}{ROOT}"}


def cranectl(environment: dict[str, str], *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "cranectl", *arguments],
        env=environment, capture_output=True, text=True, encoding="utf-8", timeout=HANG, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_run_gives_the_same_log(elsewhere: dict[str, str]) -> None:
    cranectl(elsewhere, "run", "fixed-position", *SHORT, *TWO, "--out", "there.mcap")
    here = {**os.environ, "PYTHONPATH": str(ROOT)}
    cranectl(here, "run", "fixed-position", *SHORT, *TWO, "--out", "here.mcap")
    assert Path("there.mcap").read_bytes() == Path("here.mcap").read_bytes()
    cranectl(elsewhere, "report", "there.mcap")
    cranectl(elsewhere, "log", "export", "there.mcap", "--out", "there.parquet")
    assert {path.name for path in Path().iterdir()} == {
        "there.mcap", "here.mcap", "there.html", "there.parquet"
    }  # fmt: skip


@pytest.mark.slow
def test_cases_run_in_processes_that_are_not_forked(elsewhere: dict[str, str]) -> None:
    out = cranectl(
        elsewhere, "validate", "fixed-position", "--controller", "lqr", *SHORT, *TWO, "--jobs", "2",
        "--drive", "both", "--junit", "junit.xml",
    )  # fmt: skip
    assert "validation passed" in out
    assert Path("junit.xml").is_file()


@pytest.mark.slow
def test_a_controller_of_a_file_runs_without_a_child(elsewhere: dict[str, str]) -> None:
    cranectl(elsewhere, "new", "controller", "mine")
    law = "mine.py:CONTROLLER"
    cranectl(elsewhere, "run", "fixed-position", *SHORT, "--plants", "analytic", "--controller", law)
    assert len(list(Path("logs").rglob("*.mcap"))) == 1


@pytest.mark.slow
def test_a_campaign_is_written_and_written_again(elsewhere: dict[str, str]) -> None:
    given = ["campaign", "run", "lab-rig", "--controller", "lqr", "--plants", "mujoco", "--out", "result"]
    cranectl(elsewhere, *given, "--runs", "2")
    cranectl(elsewhere, *given, "--runs", "3", "--overwrite")
    cranectl(elsewhere, "campaign", "report", "result")
    assert Path("result.html").is_file()


def test_every_text_file_is_opened_with_its_encoding() -> None:
    """That of the system is not UTF-8 everywhere."""
    ruff = [Path(sys.executable).parent / "ruff", "check", "--preview", "--select", "PLW1514", "--no-cache"]
    command = [*ruff, "cranectl", "validation", "examples"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_code_never_asks_for_what_windows_lacks_unless_it_is_there() -> None:
    """A module that names one of these at its top could not be imported."""
    missing = re.compile(r"^(import|from) (fcntl|resource|pwd|grp|termios|pty)\b", re.MULTILINE)
    found = [
        path.name for path in (ROOT / "cranectl").rglob("*.py") if missing.search(path.read_text("utf-8"))
    ]
    assert found == []

"""Commands in a process of their own, which has fewer means than this one, or is killed.

A server forks it, which has loaded what commands need, so that a case takes no second to import. The process
of the tests forks none: a child has none of its threads, and would wait for them, as for those that draw.
"""

import contextlib
import importlib
import os
import re
import resource
import signal
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import NamedTuple

from cranectl.cli import exit_codes
from cranectl.cli.main import main
from cranectl.support.interrupts import came_of_interrupt
from tests.fuzz.oracle import FORESEEN, UNFIT
from tests.pace import HANG

# What commands import, which takes memory: where that lacks, nothing of them is tried.
LOADED = (
    "control", "mujoco", "numba", "pyarrow.parquet", "scipy.signal", "scipy.stats",
    "cranectl.cases.case", "cranectl.cases.workers", "cranectl.campaign.workers",
    "cranectl.log.reader", "cranectl.log.recover", "cranectl.plants.analytic",
    "cranectl.plants.elastic.plant", "cranectl.plants.mujoco.plant", "cranectl.report.run.page",
)  # fmt: skip
OURS = re.compile(r"^(cranectl: |found: |allowed: |remedy: ).*$", re.MULTILINE)


NO_MEMORY = "Cannot recover from MemoryErrors"  # of Python, which then aborts its process itself
KILLED = (-signal.SIGKILL, -signal.SIGTERM, -signal.SIGHUP)  # the last two before a command takes them


class Told(NamedTuple):
    """What came of a command: its exit code, -N after signal N, and what it wrote."""

    code: int
    out: str
    err: str


def forked(
    directory: Path,
    arguments: Sequence[str],
    *,
    limit: Callable[[], None] | None = None,
    kill: tuple[float, signal.Signals] | None = None,
) -> Told:
    """Run a command in `directory`, after `limit` has taken means from its process.

    `limit` can be pickled. `kill` sends a signal after so many seconds. The process is killed after `HANG`,
    which fails.
    """
    with tempfile.TemporaryDirectory() as place:
        out, err = Path(place, "out"), Path(place, "err")
        given = directory, list(arguments), limit or enough, out, err, dict(os.environ)
        context = get_context("forkserver")
        context.set_forkserver_preload(list(LOADED))  # unless it has been started
        child = context.Process(target=_work, args=given)
        child.start()
        code = _ended(child, kill)
        return Told(code, _read(out).decode(), _read(err).decode("utf-8", "replace"))


def _read(file: Path) -> bytes:
    """Return what a command wrote; a process that was killed at once has written no file."""
    return file.read_bytes() if file.exists() else b""


def enough() -> None:
    """Take no means."""


def check(told: Told, arguments: Sequence[str], *, killed: bool = False, unheard: bool = False) -> None:
    """Raise AssertionError where a command ends in another way than it may, whatever it was given.

    `unheard`: what it says may be cut off.
    """
    said = f"{list(arguments)} exits {told.code}\n{told.out[-1000:]}\n{told.err[-4000:]}"
    given_up = told.code == -signal.SIGABRT and NO_MEMORY in told.err
    assert told.code in FORESEEN or given_up or (killed and told.code in KILLED), said
    assert "Traceback" not in told.err, said
    assert not any(UNFIT.search(line) for line in OURS.findall(told.err)), said
    explained = unheard or re.search(r"^(found: |Error: )", told.err, re.MULTILINE)
    assert told.code != exit_codes.BAD_INPUT or explained, said


def _ended(child: BaseProcess, kill: tuple[float, signal.Signals] | None) -> int:
    if kill is not None and not wait([child.sentinel], kill[0]):
        os.kill(child.pid or 0, kill[1])
    hangs = not wait([child.sentinel], HANG)
    if hangs:
        child.kill()
    child.join()
    assert not hangs, "it never ended"
    return child.exitcode or 0


def _work(
    directory: Path,
    arguments: Sequence[str],
    limit: Callable[[], None],
    out: Path,
    err: Path,
    environment: Mapping[str, str],
) -> None:
    """Run the command in the child, in the environment of the tests."""
    code = 99
    try:
        os.environ.clear()
        os.environ.update(environment)
        for name in LOADED:
            importlib.import_module(name)
        os.chdir(directory)
        for number, file in ((1, out), (2, err)):
            os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT), number)
        sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
        limit()
        code = main(["--traceback", *arguments])
    except BaseException as error:  # a signal that came before the command could take it
        code = exit_codes.INTERRUPTED if came_of_interrupt(error) else code
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)


@dataclass(frozen=True)
class Less:
    """Takes means from the process that calls it."""

    take: Callable[[int], None]
    left: int

    def __call__(self) -> None:
        self.take(self.left)


def memory(more: int) -> None:
    """Leave this process so many bytes more than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more,) * 2)


def disk(size: int) -> None:
    """Let no file be longer than `size` bytes, as on a disk that is full."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def handles(more: int) -> None:
    """Leave this process so many file handles more than it has."""
    highest = max(int(each.name) for each in Path("/proc/self/fd").iterdir())
    resource.setrlimit(resource.RLIMIT_NOFILE, (highest + more,) * 2)

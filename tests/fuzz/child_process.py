"""Run commands in a child process that has less memory, disk or file handles, or is killed.

A fork server that has imported all modules forks the child. Otherwise each case would need a second for
imports. The test process itself must not fork: its threads do not exist in the child, which would wait for
them without end.
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
from multiprocessing import get_context
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import NamedTuple

from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.main import main
from cranectl.support.interrupts import Interruption
from tests.fuzz.oracle import DOCUMENTED_CODES, UNSAFE_CHARACTERS
from tests.pace import HANG

# Modules that commands import. They are loaded before memory is limited, or commands would fail at once.
PRELOADED_MODULES = (
    "control", "mujoco", "numba", "pyarrow.parquet", "scipy.signal", "scipy.stats",
    "cranectl.cases.case", "cranectl.cases.workers", "cranectl.campaign.workers",
    "cranectl.log.reader", "cranectl.log.recover", "cranectl.plants.analytic",
    "cranectl.plants.elastic.plant", "cranectl.plants.mujoco.plant", "cranectl.report.run.page",
)  # fmt: skip
ERROR_LINES = re.compile(r"^(cranectl: |found: |allowed: |remedy: ).*$", re.MULTILINE)


# What Python, C++ libraries and LLVM print before they abort a process without memory.
OUT_OF_MEMORY = ("Cannot recover from MemoryErrors", "std::bad_alloc", "LLVM ERROR: out of memory")
KILLED = (-signal.SIGKILL, -signal.SIGTERM, -signal.SIGHUP)  # the last two before a command handles them


class Result(NamedTuple):
    """The exit code of a command, -N after signal N, and its output."""

    code: int
    out: str
    err: str


def run_in_child(
    directory: Path,
    arguments: Sequence[str],
    *,
    limit: Callable[[], None] | None = None,
    kill: tuple[float, signal.Signals] | None = None,
) -> Result:
    """Run a command in `directory`, after `limit` has reduced the resources of its process.

    `limit` must be picklable. `kill` is a time [s] and the signal that is sent then. The test fails if the
    process still runs after `HANG` seconds.
    """
    with tempfile.TemporaryDirectory() as folder:
        out, err = Path(folder, "out"), Path(folder, "err")
        args = directory, list(arguments), limit or limit_nothing, out, err, dict(os.environ)
        context = get_context("forkserver")
        context.set_forkserver_preload(list(PRELOADED_MODULES))  # no effect once the server runs
        child = context.Process(target=_work, args=args)
        child.start()
        code = _wait(child, kill)
        return Result(code, _read(out).decode(), _read(err).decode("utf-8", "replace"))


def _read(file: Path) -> bytes:
    """Return the content of a file, or nothing if the process was killed before it opened the file."""
    return file.read_bytes() if file.exists() else b""


def limit_nothing() -> None:
    """Leave the resources of the process as they are."""


def check(result: Result, arguments: Sequence[str], *, killed: bool = False, truncated: bool = False) -> None:
    """Raise AssertionError if a command ended in a way that no input justifies.

    `truncated`: its output may be incomplete.
    """
    details = f"{list(arguments)} exits {result.code}\n{result.out[-1000:]}\n{result.err[-4000:]}"
    out_of_memory = result.code == -signal.SIGABRT and any(text in result.err for text in OUT_OF_MEMORY)
    assert result.code in DOCUMENTED_CODES or out_of_memory or (killed and result.code in KILLED), details
    assert "Traceback" not in result.err, details
    assert not any(UNSAFE_CHARACTERS.search(line) for line in ERROR_LINES.findall(result.err)), details
    explained = truncated or re.search(r"^(found: |Error: )", result.err, re.MULTILINE)
    assert result.code != ExitCode.BAD_INPUT or explained, details


def _wait(child: BaseProcess, kill: tuple[float, signal.Signals] | None) -> int:
    if kill is not None and not wait([child.sentinel], kill[0]):
        os.kill(child.pid or 0, kill[1])
    hangs = not wait([child.sentinel], HANG)
    if hangs:
        child.kill()
    child.join()
    assert not hangs, "the command hangs"
    return child.exitcode or 0


def _work(
    directory: Path, arguments: Sequence[str], limit: Callable[[], None], out: Path, err: Path,
    environment: Mapping[str, str],
) -> None:  # fmt: skip
    """Run the command in the child process, with the environment variables of the test process."""
    code = 99
    try:
        os.environ.clear()
        os.environ.update(environment)
        for name in PRELOADED_MODULES:
            importlib.import_module(name)
        os.chdir(directory)
        for number, file in ((1, out), (2, err)):
            os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT), number)
        sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
        limit()
        code = main(["--traceback", *arguments])
    except BaseException as error:  # a signal before the command could handle it
        code = ExitCode.INTERRUPTED if Interruption.is_cause_of(error) else code
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)


def limit_memory(additional: int) -> None:
    """Limit this process to `additional` bytes more than it uses now."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + additional,) * 2)


def limit_disk(size: int) -> None:
    """Limit each file to `size` bytes, as a full disk does."""
    # Python would leave compiled modules of the environment cut off, here and in further processes.
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def limit_handles(additional: int) -> None:
    """Limit this process to `additional` file handles more than it has open."""
    highest = max(int(handle.name) for handle in Path("/proc/self/fd").iterdir())
    resource.setrlimit(resource.RLIMIT_NOFILE, (highest + additional,) * 2)

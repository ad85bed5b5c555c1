"""Read foreign binary files in a child process, whose death, memory and time are refusals of the file.

The libraries that read such files are not made for files that are damaged or meant to harm.
"""

import contextlib
import importlib
import os
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from cranectl.support import Child, FileKind, InputError, MachineError, Parent, ReadColumn, TableHead

SMALL_FILE = 2**26  # [bytes] up to which the next two limits hold; those of larger files grow in proportion
MAX_READER_BYTES = 2**30  # [bytes] of the process
MAX_PROCESSOR_TIME = 30  # [s]
MAX_SILENCE = 600.0  # [s] of the process, without time in which it waits for a processor
GRACE = 5  # [s] between the signal that ends the process and the one that kills it
# Threads and arenas reserve addresses that would count as memory.
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}

Reader = Callable[..., TableHead]  # of path, name for messages, and more


def read_isolated(reader: Reader, libraries: Sequence[str], path: Path, where: str, *more: Any) -> TableHead:
    """Return what `reader`, called with path, `where` and `more`, returns in a child process.

    `libraries` are imported before memory is limited. The process lives as long as the head, and reads its
    columns. Raises InputError if the reader does, or if the process dies or needs too much memory or time.
    """
    process = _Process(path, where, libraries)
    names, units, left_out, is_ordered = process.ask(reader, path, where, *more)
    return TableHead(where, names, process.load, units, left_out, is_ordered)


class _Process:
    """A process that reads one file."""

    def __init__(self, path: Path, where: str, libraries: Sequence[str]) -> None:
        share = max(path.stat().st_size / SMALL_FILE, 1.0)
        self._where = where
        self._memory, self._seconds = int(share * MAX_READER_BYTES), int(share * MAX_PROCESSOR_TIME)
        with path.open("rb") as stream:
            kind = FileKind.named(stream.read(16)) or "a MATLAB file of version 4"
        self._child = Child.spawn(_serve, where, kind, tuple(libraries), (self._memory, self._seconds))
        weakref.finalize(self, self._child.end)

    def ask(self, *question: Any) -> Any:
        """Return the answer of the process; raise InputError for what it refuses, and if it dies."""
        try:
            self._child.send(question)
            return self._child.receive(MAX_SILENCE)
        except Child.Error as error:
            if error.is_killed:
                raise MachineError.of(f"the process that reads {self._where} was killed") from None
            is_slow = error.is_silent or "SIGXCPU" in str(error)
            why = f"needs more than {self._seconds} s of processor time" if is_slow else str(error)
            raise _refusal(self._where, why, self._memory, self._seconds) from None

    def load(self, column: int, is_clock: bool) -> ReadColumn:
        """Return a column by its index."""
        read: ReadColumn = self.ask(None, column, is_clock)
        return read


def _refusal(where: str, why: str, memory: int, seconds: int) -> InputError:
    return InputError(
        f"cannot read {where}: its reader {why}",
        allowed=f"whole files that are read within {seconds} s and {memory / 2**30:.3g} GiB",
        remedy="write the columns that are needed as CSV or Parquet",
    )


def _serve(parent: Parent, where: str, kind: str, libraries: Sequence[str], limits: tuple[int, int]) -> None:
    """Answer the questions of the parent: first what the file holds, then columns."""
    os.environ.update(ENVIRONMENT)
    null = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # libraries print warnings, and why they abort
        os.dup2(null, stream)
    for library in libraries:
        with contextlib.suppress(ImportError):  # the reader says so, if it needs it
            importlib.import_module(library)
    memory, seconds = limits
    _limit(memory, seconds)
    too_large = _refusal(where, f"needs more than {memory / 2**30:.3g} GiB of memory", memory, seconds)
    answer = _Answers(where, kind)
    for question in parent.requests():
        try:
            parent.send(answer(*question))
        except MemoryError:  # before anything was sent
            parent.send(too_large)


class _Answers:
    """What a reader answers, in its process."""

    def __init__(self, where: str, kind: str) -> None:
        self._where, self._kind = where, kind
        self._head: TableHead | None = None

    def __call__(self, reader: Reader | None, *inputs: Any) -> Any:
        """Return what the file holds if there is a `reader`, else a column; or what was refused."""
        try:
            with TableHead.reading(self._where, self._kind):
                if reader is None:
                    assert self._head is not None
                    return self._head.read(inputs[0], is_clock=inputs[1])
                self._head = head = reader(*inputs)
                return head.names, head.units, head.left_out, head.is_ordered
        except InputError as error:
            return error


def _limit(memory: int, seconds: int) -> None:
    """Limit the memory and the processor time of this process, where there are such limits."""
    try:
        import resource
    except ImportError:
        return
    pages = Path("/proc/self/statm").read_text("ascii").split()
    addresses, resident = (int(number) * resource.getpagesize() for number in pages[:2])
    most = addresses + max(memory - resident, 0)  # libraries reserve addresses that they do not use
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + GRACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

"""Tell failures of the machine from failures of the controller or plant under test.

A failure of the machine, such as a lack of memory, is never a result. What it hit is tried again, and if it
fails again the command ends and keeps what was finished before.
"""

import errno
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TypeVar

from cranectl.support.errors import InputError, describe_error

TRIES = 3  # of what the machine does not let end
T = TypeVar("T")
_tell_of_start: list[Callable[[], object]] = []  # in a process of runs
_ends_with_machine: list[Callable[[BaseException], object]] = []  # in a process of runs

_ERRNOS = {
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "ENOMEM", "EMFILE", "ENFILE", "EIO", "EROFS", "EAGAIN", "EFBIG")
    if hasattr(errno, name)
}
_UNMAPPED = re.compile("failed to map segment|[Cc]annot allocate memory")
_KILLED = {-signal.SIGTERM, -getattr(signal, "SIGKILL", 9)}


class MachineError(InputError):
    """The machine did not let something end; it says nothing about the controller or the plant."""

    @classmethod
    def of(cls, what: str) -> "MachineError":
        """Return the error for `what` happened, a phrase."""
        return cls(
            f"the machine failed: {what}",
            allowed="enough memory and disk space, and processes that nobody kills",
            remedy="free memory or disk space, or use fewer workers, and give the command again",
        )


def is_of_machine(error: BaseException) -> bool:
    """Return True if `error`, or what caused it, is a lack of memory, disk space or file handles."""
    seen: set[int] = set()
    cause: BaseException | None = error
    while cause is not None and id(cause) not in seen:
        seen.add(id(cause))
        if isinstance(cause, (MachineError, MemoryError)):
            return True
        if isinstance(cause, ImportError) and _UNMAPPED.search(str(cause)):  # a library, such as NumPy's
            return True
        if isinstance(cause, OSError) and cause.errno in _ERRNOS:
            return True
        cause = cause.__cause__ or cause.__context__
    return False


def end_with_machine(end: Callable[[BaseException], object]) -> None:
    """Have `end` end this process, which only runs controllers, at an error of the machine in a step."""
    _ends_with_machine[:] = [end]


def tell_of_starts_by(tell: Callable[[], object]) -> None:
    """Have `tell` tell the parent of this process, which only runs controllers, when a program starts."""
    _tell_of_start[:] = [tell]


@contextmanager
def starting() -> Iterator[None]:
    """Wait for a program to start, which no patience of a run bounds: it may import or compile."""
    for tell in _tell_of_start:
        tell()
    yield
    for tell in _tell_of_start:
        tell()


def tell_of_machine(error: BaseException) -> None:
    """End a process that only runs controllers if `error` is one of the machine."""
    if is_of_machine(error):
        for end in _ends_with_machine:
            end(error)


@contextmanager
def _machine_errors() -> Iterator[None]:
    """Raise MachineError in place of an error of the machine; an InputError says more and stays."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if is_of_machine(error):
            raise MachineError.of(describe_error(error).rstrip(": ")) from error
        raise


def was_killed(exit_code: int) -> bool:
    """Return True if a process with this exit code, -N after signal N, was ended from outside."""
    return exit_code in _KILLED


def tried_again(attempt: Callable[[], T]) -> T:
    """Return what `attempt` returns; it is repeated after an error of the machine.

    Raises MachineError if the last try has such an error too.
    """
    for _ in range(TRIES - 1):
        with suppress(MachineError), _machine_errors():
            return attempt()
    with _machine_errors():
        return attempt()

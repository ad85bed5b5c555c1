"""One process at a time may write a result."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cranectl.errors import InputError

LOCK_FILE = ".lock"


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Hold the lock of `directory`; raises InputError if another process has it.

    The operating system lets go of it when its process ends, however that happens.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(directory / LOCK_FILE)
    try:
        lock.acquire(blocking=False)
    except Timeout:
        raise InputError(
            f"another process is writing {directory}",
            allowed="one process for each result",
            remedy="wait for it, or choose another place with --out",
        ) from None
    except OSError as error:
        raise InputError.unwritable(directory, error, remedy="choose another place with --out") from None
    try:
        yield
    finally:
        lock.release()

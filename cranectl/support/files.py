"""Write files as a whole or not at all: write to a temporary file and rename it once complete.

A command checks its output places before it reads or computes anything. Reading a pipe without a writer fails
at once instead of waiting.
"""

import contextlib
import glob
import io
import os
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import BinaryIO

from cranectl.support.errors import InputError
from cranectl.support.interrupts import reported_when_slow

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


@dataclass(frozen=True)
class File:
    """A file of the user, which is read, or written as a whole or not at all."""

    path: Path  # as the user names it

    def exists(self) -> bool:
        """Return True if something exists at the path; an error counts as nothing there."""
        try:
            return self.path.exists()
        except (OSError, ValueError):
            return False

    def open(self, *, piped: int = 0, buffering: int = -1) -> BinaryIO:
        """Open the file to read it; of a pipe, such as the shell's `<(command)`, read up to `piped` bytes.

        If the writer of a pipe is slow, this waits and reports the delay. Raises OSError, also for a pipe
        without a writer and for any pipe if `piped` is zero. Raises ValueError for a null character in the
        name.
        """
        if not self.path.is_fifo():
            return self.path.open("rb", buffering=buffering)
        if not piped:
            raise OSError(f"{self.path} is a pipe, and this kind of file is not read in order")
        return io.BytesIO(_read_pipe(self.path, piped))

    @contextlib.contextmanager
    def writing(
        self, *, remedy: str = "choose another place", error: type[InputError] = InputError
    ) -> Iterator[None]:
        """Raise `error` if the block raises OSError, or a ValueError for a null character in `path`."""
        try:
            yield
        except (OSError, ValueError) as failure:
            if isinstance(failure, ValueError) and "\0" not in str(self.path):  # which no name may have
                raise
            raise error.unwritable(self.path, failure, remedy=remedy) from None

    @contextlib.contextmanager
    def replacing(self, *, keep_after: tuple[type[Exception], ...] = ()) -> Iterator[Path]:
        """Yield a file beside this one; rename it to this one if the block succeeds, else remove it.

        After an error of a class in `keep_after` the file keeps its temporary name. Raises OSError if this
        file cannot be replaced. If processes or threads write the same file at once, the last to finish wins,
        with a complete file.
        """
        _refuse_devices(self.path)
        part = _part(self.path)
        with contextlib.ExitStack() as claim:
            if fcntl is not None:  # Windows, which has no such locks, renames no file that is open
                _lock(claim.enter_context(part.open("rb")))
            try:
                yield part
                # A power cut after this could leave an empty file. Windows flushes what may be written.
                with part.open("rb+") as written:
                    os.fsync(written.fileno())
                part.replace(self.path)
            except keep_after:
                raise
            except BaseException:
                with contextlib.suppress(OSError):
                    part.unlink(missing_ok=True)
                raise

    def check_replaceable(self) -> None:
        """Raise OSError or ValueError now if `replacing` would fail; make missing directories."""
        _refuse_devices(self.path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        _part(self.path).unlink()  # to make a file there is the only sure test

    def is_being_written(self) -> bool:
        """Return True if a `replacing` is active; files of killed processes do not count."""
        for part in self.path.parent.glob(f"{glob.escape(self.path.name)}.*.part"):
            with contextlib.suppress(FileNotFoundError), part.open("rb") as file:
                if not _lock(file):
                    return True
        return False

    def write_text(self, text: str) -> None:
        """Write `text` in one atomic step, or directly to a device or a pipe.

        Bytes of a file's name that are not UTF-8 become escapes.
        """
        content = text.encode("utf-8", "backslashreplace")
        if self.path.exists() and not self.path.is_file():
            self.path.write_bytes(content)
            return
        with self.replacing() as part:
            part.write_bytes(content)


def _refuse_devices(path: Path) -> None:
    """Raise OSError for a device or a pipe, which a renamed file would destroy."""
    if path.exists() and not path.is_file():
        raise OSError(f"{path} exists and is no regular file")


def _part(path: Path) -> Path:
    """Make a new empty file beside `path`; a counter separates threads, which share a process number."""
    for k in count(1):
        part = path.parent / f"{path.name}.{os.getpid()}{f'-{k}' if k > 1 else ''}.part"
        with contextlib.suppress(FileExistsError):
            part.touch(exist_ok=False)  # in one step, or two threads could take the same name
            break
    return part


def _lock(file: BinaryIO) -> bool:
    """Lock `file` until it is closed, where there are such locks; return False if it is locked already."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _read_pipe(path: Path, max_bytes: int) -> bytes:
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        first = os.read(descriptor, max_bytes)
        if not first:
            raise OSError(f"{path} is a pipe into which nobody writes")
    except BlockingIOError:  # a writer has opened it but not written yet
        first = b""
    except OSError:
        os.close(descriptor)
        raise
    os.set_blocking(descriptor, True)
    waits = f"{path} is a pipe whose writer has neither written nor ended"
    with os.fdopen(descriptor, "rb") as stream, reported_when_slow(waits):
        return first + stream.read(max_bytes - len(first))

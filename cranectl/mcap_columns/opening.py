"""Open MCAP files: what cannot be read, is cut off or damaged becomes an error for people."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from cranectl.mcap_columns.contents import Contents, End, read_end
from cranectl.mcap_columns.records import BUFFER, MAGIC, DamageError
from cranectl.support.errors import LogError

ALLOWED = "closed logs that cranectl wrote"


@contextlib.contextmanager
def opened(path: str | Path, *, remedy: str = "") -> Iterator[BinaryIO]:
    """The file at `path`; every mishap with it becomes a LogError."""
    with contextlib.ExitStack() as stack:
        try:
            stream = stack.enter_context(Path(path).open("rb", buffering=BUFFER))
        except (OSError, ValueError) as error:  # ValueError: a null character in the name
            raise _unreadable(path, error) from None
        try:
            yield stream
        except (OSError, MemoryError) as error:
            raise _unreadable(path, error) from None
        except DamageError as error:
            remedy = remedy or _recover(path)
            raise LogError(f"{path} is damaged: {error}", allowed=ALLOWED, remedy=remedy) from None


def check_begin(path: str | Path, stream: BinaryIO) -> None:
    """Raise LogError for a file that does not begin as an MCAP file."""
    begin = stream.read(len(MAGIC))
    if not begin:
        raise LogError(f"{path} is empty", allowed=ALLOWED, remedy="run the scenario again")
    if not MAGIC.startswith(begin):
        raise LogError(f"{path} is no MCAP file", allowed=ALLOWED, remedy="name a log that cranectl wrote")


def open_contents(path: str | Path, stream: BinaryIO) -> tuple[Contents, End]:
    """Of a closed log, before its data are read; raises LogError for another file, DamageError."""
    check_begin(path, stream)
    size = stream.seek(0, 2)
    stream.seek(max(size - len(MAGIC), 0))
    if size == len(MAGIC) or stream.read() != MAGIC:
        error = f"{path} is truncated: it does not end as a closed log does"
        raise LogError(error, allowed=ALLOWED, remedy=_recover(path))
    return Contents(size), read_end(stream, size)


def _unreadable(path: str | Path, error: Exception) -> LogError:
    return LogError(f"cannot read {path}: {error}", allowed=ALLOWED, remedy="name a log that cranectl wrote")


def _recover(path: str | Path) -> str:
    return f"run the scenario again, or save what is whole with: cranectl log recover {path}"

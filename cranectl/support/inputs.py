"""Open files to read: what a pipe without a writer would hold is not waited for."""

import io
import os
from pathlib import Path
from typing import BinaryIO

from cranectl.support.waiting import reported_when_slow


def open_input(path: Path, *, piped: int = 0, buffering: int = -1) -> BinaryIO:
    """Open the file at `path`. Of a pipe, as a shell gives for `<(command)`, up to `piped` bytes are read.

    A writer that stays silent is waited for, as by any program, and reported.
    Raises OSError, also for a pipe into which nobody writes, or any where `piped` is zero; ValueError for a
    null character in the name.
    """
    if not path.is_fifo():
        return path.open("rb", buffering=buffering)
    if not piped:
        raise OSError(f"{path} is a pipe, and this kind of file is not read in order")
    return io.BytesIO(_read_pipe(path, piped))


def _read_pipe(path: Path, most: int) -> bytes:
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        first = os.read(descriptor, most)
        if not first:
            raise OSError(f"{path} is a pipe into which nobody writes")
    except BlockingIOError:  # somebody is about to
        first = b""
    except OSError:
        os.close(descriptor)
        raise
    os.set_blocking(descriptor, True)
    waits = f"{path} is a pipe whose writer has neither written nor ended"
    with os.fdopen(descriptor, "rb") as stream, reported_when_slow(waits):
        return first + stream.read(most - len(first))

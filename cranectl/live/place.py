"""Where a live session records: `FILE`, `FILE.segment2`, …, its own for as long as it lasts.

What another session recorded is never removed or replaced.
"""

import contextlib
import os
import re
from collections.abc import Iterator
from itertools import chain, count
from pathlib import Path

from filelock import FileLock, Timeout

from cranectl.support.errors import LogError
from cranectl.support.files import check_replaceable, writing

REMEDY = "choose another place with --record"
LOCK = ".lock"


@contextlib.contextmanager
def own_place(path: Path, *, numbered: bool = False) -> Iterator[Path]:
    """Keep a place for the block; gives its first file, which does not exist yet.

    Where there is a recording or another session records, LogError, or, if `numbered`, the first of `FILE-2`,
    `FILE-3`, … that is free. Raises LogError if nothing can be written there. The operating system lets go of
    a place when its process ends, however that happens.
    """
    with writing(path, remedy=REMEDY, error=LogError):
        check_replaceable(path)
        for place in _numbered(path) if numbered else [path]:
            lock = FileLock(place.with_name(place.name + LOCK))
            obstacle = _obstacle(place, lock)
            if not obstacle:
                break
        else:
            raise LogError(obstacle, allowed="a place where nothing is recorded", remedy=REMEDY)
    try:
        yield place
    finally:
        _let_go(lock)


def next_file(place: Path) -> Path:
    """The first file of a session's place that does not exist."""
    more = (place.with_suffix(f".segment{number}{place.suffix}") for number in count(2))
    return next(file for file in chain([place], more) if not os.path.lexists(file))


def _numbered(path: Path) -> Iterator[Path]:
    return chain([path], (path.with_stem(f"{path.stem}-{number}") for number in count(2)))


def _obstacle(place: Path, lock: FileLock) -> str:
    """Why a session cannot record at `place`; empty if it can, which then has the lock."""
    try:
        lock.acquire(blocking=False)
    except Timeout:
        return f"another session records at {place}"
    # Before 0.3 the segments of a session were called takes.
    segments = re.compile(rf"{re.escape(place.stem)}(\.(segment|take)\d+)?{re.escape(place.suffix)}")
    recorded = sorted(file.name for file in place.parent.iterdir() if segments.fullmatch(file.name))
    if recorded:
        _let_go(lock)
        return f"{place.parent / recorded[0]} is there already"
    return ""


def _let_go(lock: FileLock) -> None:
    # Removed while it is held: who opens it until it is released finds out that it is gone.
    with contextlib.suppress(OSError):
        Path(lock.lock_file).unlink(missing_ok=True)
    lock.release()

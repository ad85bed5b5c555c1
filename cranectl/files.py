"""Files that are whole or not there: written beside their place and renamed once complete."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A place beside `path` to write to; renamed to `path` if the block ends well, removed if not.

    Raises OSError if `path` cannot be replaced. Of two processes that write the same file, the last to
    finish wins, whole.
    """
    part = _part(path)
    _refuse_devices(path, part)
    try:
        yield part
        part.replace(path)
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def check_replaceable(path: Path) -> None:
    """Raise OSError or ValueError now if `replacing(path)` would fail; makes missing directories."""
    part = _part(path)
    _refuse_devices(path, part)
    path.parent.mkdir(parents=True, exist_ok=True)
    part.touch()
    part.unlink()


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path`: whole or not at all, but straight into a device or a pipe."""
    if path.exists() and not path.is_file():
        path.write_text(text, encoding="utf-8")
        return
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def _refuse_devices(*places: Path) -> None:
    """Renaming a file over a device or a pipe would destroy it."""
    for place in places:
        if place.exists() and not place.is_file():
            raise OSError(f"{place} exists and is no regular file")


def _part(path: Path) -> Path:
    """Of each process its own."""
    return path.parent / f"{path.name}.{os.getpid()}.part"

"""Files that are whole or not there: written beside their place and renamed once complete."""

import contextlib
import glob
import os
from collections.abc import Iterator
from itertools import chain, count
from pathlib import Path
from typing import BinaryIO

from cranectl.support.errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


@contextlib.contextmanager
def writing(
    path: Path, *, remedy: str = "choose another place", error: type[InputError] = InputError
) -> Iterator[None]:
    """For a block that writes `path` or finds out whether it could: raises `error` where it cannot."""
    try:
        yield
    except (OSError, ValueError) as failure:
        if isinstance(failure, ValueError) and "\0" not in str(path):  # no name of a file has that character
            raise
        raise error.unwritable(path, failure, remedy=remedy) from None


@contextlib.contextmanager
def replacing(path: Path, *, keep_after: tuple[type[Exception], ...] = ()) -> Iterator[Path]:
    """A place beside `path` to write to; renamed to `path` if the block ends well, removed if not.

    After an error of a class in `keep_after` it stays under its own name. Raises OSError if `path` cannot be
    replaced. Of processes or threads that write the same file at once, the last to finish wins, whole.
    """
    _refuse_devices(path)
    part = _part(path)
    with part.open("rb") as claim:
        _lock(claim)
        try:
            yield part
            _put_on_disk(part)
            part.replace(path)
        except keep_after:
            raise
        except BaseException:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
            raise


def check_replaceable(path: Path) -> None:
    """Raise OSError or ValueError now if `replacing(path)` would fail; makes missing directories."""
    _refuse_devices(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    _part(path).unlink()


def being_written(path: Path) -> bool:
    """Whether a `replacing(path)` is under way somewhere; parts that a killed process left do not count."""
    for part in path.parent.glob(f"{glob.escape(path.name)}.*.part"):
        with contextlib.suppress(FileNotFoundError), part.open("rb") as file:
            if not _lock(file):
                return True
    return False


def exists(path: Path) -> bool:
    """Whether something is seen at `path`; nothing is where no name can be, or nobody may look."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path`: whole or not at all, but straight into a device or a pipe."""
    if path.exists() and not path.is_file():
        path.write_text(text, encoding="utf-8")
        return
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def _refuse_devices(path: Path) -> None:
    """Renaming a file over a device or a pipe would destroy it."""
    if path.exists() and not path.is_file():
        raise OSError(f"{path} exists and is no regular file")


def _part(path: Path) -> Path:
    """An empty file beside `path` that nobody else has; process numbers come again, threads share one."""
    names = (f"{path.name}.{os.getpid()}{again}.part" for again in chain([""], (f"-{k}" for k in count(2))))
    return next(part for part in map(path.parent.joinpath, names) if _made(part))


def _made(part: Path) -> bool:
    """Make `part` unless it is there: in one step, or two threads could take the same name."""
    try:
        part.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def _lock(file: BinaryIO) -> bool:
    """Lock `file` until it is closed; False if somebody else has. Without such locks nobody ever has."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _put_on_disk(part: Path) -> None:
    """Without it a power cut after the renaming could leave an empty file under the good name."""
    with part.open("rb") as file:
        os.fsync(file.fileno())

"""Provide private directories of the user: a cache for compiled code, and temporary directories.

Files in the cache are unpickled and run, so a directory that other users may open is never used. Temporary
directories last as long as the process. A process holds a lock on each of its own. The operating system
releases the lock when the process ends, in whatever way. A later start removes the directories that a killed
process left. All of them lie in one directory, so that nothing else is searched.
"""

import atexit
import contextlib
import functools
import os
import shutil
import stat
import sys
import tempfile
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_PACKAGE = Path(__file__).parents[1]
_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_held: list[int] = []  # descriptors of locked directories, open until the process ends


@functools.cache
def cache_directory() -> Path:
    """Return the first usable directory: from $NUMBA_CACHE_DIR, or in the package or the user's cache.

    If there is none, it makes a temporary one for this process and its children and says so on standard
    error.
    """
    refused = {}
    for directory in _candidates():
        refused[directory] = _obstacle(directory)
        if not refused[directory]:
            return directory
    reasons = " or ".join(f"in {directory} ({reason})" for directory, reason in refused.items())
    print(
        f"cranectl: compiled code cannot be kept {reasons}; each start compiles for a minute until "
        "NUMBA_CACHE_DIR names a directory of yours that can be written",
        file=sys.stderr,
    )
    os.environ["NUMBA_CACHE_DIR"] = str(temporary_directory("kernels"))
    (directory,) = _candidates()  # if the variable is set, there is no other
    _obstacle(directory)  # makes the directory
    return directory


def is_own(status: os.stat_result) -> bool:
    """Return True if a file belongs to the user of this process, or if the system has no owners."""
    return not hasattr(os, "geteuid") or status.st_uid == os.geteuid()


def _candidates() -> list[Path]:
    """Return the directories to try, as absolute paths that hold only compiled code."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        user = (
            f"-{os.geteuid()}" if hasattr(os, "geteuid") else ""
        )  # other users may have chosen the same directory
        return [Path(chosen).absolute() / f"cranectl{user}"]
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    places = [_PACKAGE / "__pycache__" / "kernels", Path(home) / "cranectl"]
    return [path for path in places if path.is_absolute()]


def _obstacle(directory: Path) -> str:
    """Make the directory, and return why code cannot be kept there, or an empty text if it can."""
    try:
        directory.mkdir(mode=stat.S_IRWXU, parents=True, exist_ok=True)
        status = directory.stat()
        if not is_own(status):
            return "it belongs to another user"
        if hasattr(os, "geteuid") and status.st_mode & _OTHERS:
            directory.chmod(stat.S_IRWXU)
            if directory.stat().st_mode & _OTHERS:  # some file systems have no permissions
                return "others may open it"
        with tempfile.TemporaryFile(dir=directory):
            return ""
    except OSError as error:
        return error.strerror or str(error)


def temporary_directory(kind: str) -> Path:
    """Make a directory that is removed when this process ends, and remove those of ended processes.

    Raises OSError if no directory can be made.
    """
    above = _users_directory()
    if above is None:
        made = Path(tempfile.mkdtemp(prefix=f"cranectl-{kind}-"))
    else:
        _remove_abandoned(above)
        made = _make(above, kind)
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def _users_directory() -> Path | None:
    """Return this user's directory for temporary files; None if it is not private or has no locks."""
    if fcntl is None:
        return None
    path = Path(tempfile.gettempdir(), f"cranectl-{os.geteuid()}")
    path.mkdir(mode=stat.S_IRWXU, exist_ok=True)
    status = path.lstat()  # not `stat`: another user may have put a link there
    is_private = stat.S_ISDIR(status.st_mode) and not status.st_mode & _OTHERS
    return path if is_private and is_own(status) else None


def _make(above: Path, kind: str) -> Path:
    """Make and lock a directory; another process may remove it before it is locked."""
    while True:
        made = Path(tempfile.mkdtemp(prefix=f"{kind}-", dir=above))
        try:
            descriptor = _lock(made)
        except FileNotFoundError:
            continue
        except OSError:  # a file system without locks, where nobody else can lock it either
            return made
        if descriptor is not None:
            _held.append(descriptor)
            return made


def _remove_abandoned(above: Path) -> None:
    """Remove the directories whose processes are gone."""
    for directory in above.iterdir():
        with contextlib.suppress(OSError):  # another process removes it, or there are no locks
            if (descriptor := _lock(directory)) is not None:
                shutil.rmtree(directory, ignore_errors=True)
                os.close(descriptor)


def _lock(directory: Path) -> int | None:
    """Lock a directory; return the descriptor, or None if another process locks or removes it."""
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    with contextlib.ExitStack() as unless_locked:
        unless_locked.callback(os.close, descriptor)
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(descriptor), directory.lstat()):
                unless_locked.pop_all()
                return descriptor
    return None

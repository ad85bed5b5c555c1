"""Temporary directories for as long as a process runs; of one that was killed, a later start removes them.

A process holds a lock on each of its directories. The operating system lets go of the lock when the process
ends, however that happens. All lie in one directory of the user, so that nothing else is looked at.
"""

import atexit
import contextlib
import os
import shutil
import stat
import tempfile
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_held: list[int] = []  # descriptors of locked directories, open until the process ends


def temporary_directory(kind: str) -> Path:
    """Make a directory that is removed when this process ends, and remove those that nobody has any more.

    Raises OSError where none can be made.
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
    """Return the directory of this user in that of the system; None where it is not safe, or has no locks."""
    if fcntl is None:
        return None
    path = Path(tempfile.gettempdir(), f"cranectl-{os.geteuid()}")
    path.mkdir(mode=stat.S_IRWXU, exist_ok=True)
    status = path.lstat()
    is_private = stat.S_ISDIR(status.st_mode) and not status.st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    return path if is_private and status.st_uid == os.geteuid() else None


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
    """Lock a directory until the descriptor is closed; return None where another process has or removes it.

    Raises OSError where there is none, or no locks.
    """
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        is_there = os.path.samestat(os.fstat(descriptor), directory.lstat())
    except BlockingIOError:
        is_there = False
    except OSError:
        os.close(descriptor)
        raise
    if is_there:
        return descriptor
    os.close(descriptor)
    return None

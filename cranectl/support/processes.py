"""Start Python processes that import nothing from the working directory, and keep that directory.

`python -c`, by which `multiprocessing` starts every process, puts the working directory first in the search
path. A file such as `struct.py` there would run in place of the module that its name says.
"""

import contextlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path

SAFE_PATH = "PYTHONSAFEPATH"  # any text keeps the working directory out of the search path
MARK = "cranectl"  # the text that says that it was set here, and not by the user

_lock = threading.Lock()
_blocks = 0  # that are open, in any thread


@contextlib.contextmanager
def safe_path() -> Iterator[None]:
    """Keep the working directory out of the search path of the processes that the block starts.

    What these find on the path is otherwise what this process finds. They call `forget_safe_path`, so that a
    script that they start finds the modules beside it.
    """
    global _blocks
    with _lock:
        _blocks += 1
        if not os.environ.get(SAFE_PATH):
            os.environ[SAFE_PATH] = MARK
    try:
        yield
    finally:
        with _lock:
            _blocks -= 1
            if not _blocks:
                forget_safe_path()


def forget_safe_path() -> None:
    """Let scripts that start from now on import from their own folder, unless the user forbids it."""
    if os.environ.get(SAFE_PATH) == MARK:
        del os.environ[SAFE_PATH]


@contextlib.contextmanager
def directory_kept() -> Iterator[None]:
    """Go back to the working directory at the end of the block, where foreign code has left it."""
    before = _directory()
    try:
        yield
    finally:
        if before is not None and _directory() != before:
            os.chdir(before)


def _directory() -> Path | None:
    try:
        return Path.cwd()
    except OSError:  # it was removed
        return None


def users_environment() -> dict[str, str]:
    """Return the environment for a program of the user, without what `safe_path` adds."""
    return {name: value for name, value in os.environ.items() if (name, value) != (SAFE_PATH, MARK)}

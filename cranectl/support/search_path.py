"""Keep the working directory out of the search path of Python processes that this one starts.

Python puts it first for `python -c`, which `multiprocessing` and libraries use. A file `struct.py` there
would replace the standard module.
"""

import contextlib
import os
import threading
from collections.abc import Iterator

SAFE_PATH = "PYTHONSAFEPATH"  # any text keeps the working directory out of the search path
MARK = "cranectl"  # the value that marks it as set here, and not by the user
_lock = threading.Lock()
_blocks = 0  # of `safe_path` that are open, in any thread


@contextlib.contextmanager
def safe_path() -> Iterator[None]:
    """Keep the working directory out of the import path of the processes that the block starts.

    The processes call `forget_safe_path`, so that scripts that they start can import from their own folder.
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


def users_environment() -> dict[str, str]:
    """Return the environment for a program of the user, without what `safe_path` adds."""
    return {name: value for name, value in os.environ.items() if (name, value) != (SAFE_PATH, MARK)}

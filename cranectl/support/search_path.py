"""Keep the working directory out of the search path of Python processes that this one starts.

Python puts it first for `python -c`, which `multiprocessing` and libraries use. A file `struct.py` there
would replace the standard module.
"""

import os
import threading
from typing import ClassVar

SAFE_PATH = "PYTHONSAFEPATH"  # any text keeps the working directory out of the search path
MARK = "cranectl"  # the value that marks it as set here, and not by the user


class SafePath:
    """Keeps the working directory out of the import path of the processes that a block starts.

    The processes call `SafePath.forget`, so that scripts that they start can import from their own folder.
    """

    _lock: ClassVar = threading.Lock()
    _blocks: ClassVar = 0  # that are open, in any thread

    def __enter__(self) -> None:
        with self._lock:
            SafePath._blocks += 1
            if not os.environ.get(SAFE_PATH):
                os.environ[SAFE_PATH] = MARK

    def __exit__(self, *_: object) -> None:
        with self._lock:
            SafePath._blocks -= 1
            if not SafePath._blocks:
                self.forget()

    @staticmethod
    def forget() -> None:
        """Let scripts that start from now on import from their own folder, unless the user forbids it."""
        if os.environ.get(SAFE_PATH) == MARK:
            del os.environ[SAFE_PATH]

    @staticmethod
    def users_environment() -> dict[str, str]:
        """Return the environment for a program of the user, without what a block adds."""
        return {name: value for name, value in os.environ.items() if (name, value) != (SAFE_PATH, MARK)}

"""Keep the working directory out of the search path of Python processes that this one starts.

Python puts it first for `python -c`, which `multiprocessing` and libraries use. A file `struct.py` there
would replace the standard module.
"""

import os
import threading
from typing import ClassVar


class SafePath:
    """A `with` block that keeps the working directory out of the import path of the processes it starts.

    The processes call `forget`, so that scripts that they start can import from their own folder.
    """

    VARIABLE = "PYTHONSAFEPATH"  # any text keeps the working directory out of the search path
    MARK = "cranectl"  # the value that marks it as set here, and not by the user
    _lock = threading.Lock()
    _open: ClassVar[list["SafePath"]] = []  # in any thread

    def __enter__(self) -> None:
        with self._lock:
            self._open.append(self)
            if not os.environ.get(self.VARIABLE):
                os.environ[self.VARIABLE] = self.MARK

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._open.remove(self)
            if not self._open:
                self.forget()

    @classmethod
    def forget(cls) -> None:
        """Let scripts that start from now on import from their own folder, unless the user forbids it."""
        if os.environ.get(cls.VARIABLE) == cls.MARK:
            del os.environ[cls.VARIABLE]

    @classmethod
    def users_environment(cls) -> dict[str, str]:
        """Return the environment for a program of the user, without what the block adds."""
        return {
            name: value for name, value in os.environ.items() if (name, value) != (cls.VARIABLE, cls.MARK)
        }

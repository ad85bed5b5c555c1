"""Run Python code of somebody else in this process, without letting it end or change the process silently."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from cranectl.support.float_environment import environment_kept
from cranectl.support.processes import directory_kept

_lock = threading.Lock()
_inside: list[int] = []  # the threads that run foreign code, one entry for each block
_before: list[Any] = []  # standard output, `os._exit` and the process before the first block


@contextmanager
def contained() -> Iterator[None]:
    """Protect this process from the foreign code that the block runs; threads may be in blocks at once.

    Its output goes to standard error, since standard output is the command's own. The floating point
    environment and the working directory are restored afterwards. `os._exit` raises SystemExit.
    """
    here = threading.get_ident()
    with _lock:
        if not _inside:
            _before[:] = [sys.stdout, os._exit, os.getpid()]
            sys.stdout, os._exit = sys.stderr, _refuse  # type: ignore[assignment]
        _inside.append(here)
    try:
        with environment_kept(), directory_kept():
            yield
    finally:
        with _lock:
            _inside.remove(here)
            if not _inside:
                sys.stdout, os._exit, _ = _before


def _refuse(code: int) -> None:
    """Raise in a thread of this process that runs foreign code; elsewhere, as in a forked child, end it."""
    _, leave, process = _before
    if os.getpid() != process or threading.get_ident() not in _inside:
        leave(code)
    raise SystemExit(code)

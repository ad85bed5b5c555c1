"""Ctrl-C and SIGTERM wait while a file is finished."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


@contextlib.contextmanager
def interrupts_wait() -> Iterator[None]:
    """Signals that come during the block take effect at its end; for blocks of less than a second.

    Python delivers signals to the main thread only, so other threads need nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[tuple[int, FrameType | None]] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    replaced = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in replaced:
        signal.signal(number, lambda *which: came.append(which))
    try:
        yield
    finally:
        for number, handler in replaced.items():
            signal.signal(number, handler)
        if came:
            replaced[signal.Signals(came[0][0])](*came[0])

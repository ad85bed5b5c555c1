"""Say what the user waits for, where nothing but the user ends it."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from cranectl.support.errors import printable

SLOW = 10.0  # [s] after which what has not ended is reported


@contextmanager
def reported_when_slow(what: str) -> Iterator[None]:
    """Say on standard error that `what`, such as "law.py has been loading", takes long, and end nothing."""
    warning = f"cranectl: {printable(what)} for {SLOW:g} s now; Ctrl-C ends the command\n"
    slow = threading.Timer(SLOW, lambda: os.write(2, warning.encode()))
    slow.daemon = True
    slow.start()
    try:
        yield
    finally:
        slow.cancel()

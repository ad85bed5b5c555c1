"""What server and guard say of clients: the first complaint is told, the others are counted."""

import contextlib
import logging
from collections.abc import Callable, Iterator

from cranectl.support.text import printable

LOGGERS = ("foxglove.websocket", "cranectl.live.guard")

Tell = Callable[[str], None]


class _Counter(logging.Handler):
    """Clients can send nonsense as fast as the network carries it."""

    def __init__(self, tell: Tell) -> None:
        super().__init__(logging.WARNING)
        self.count = 0
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        self.count += 1
        if self.count == 1:
            self._tell(f"{printable(record.getMessage())}; more of this kind is only counted")


@contextlib.contextmanager
def complaints(tell: Tell) -> Iterator[None]:
    """`tell` of the first during the block, and at its end how many there were."""
    counter = _Counter(tell)
    for name in LOGGERS:
        logging.getLogger(name).addHandler(counter)
    try:
        yield
    finally:
        for name in LOGGERS:
            logging.getLogger(name).removeHandler(counter)
        if counter.count > 1:
            tell(f"{counter.count} complaints of clients in all")

"""Warnings of server and guard about clients: the first is passed on, the others are counted."""

import contextlib
import logging
from collections.abc import Callable, Iterator

from cranectl.support.text import printable

LOGGERS = ("foxglove.websocket", "cranectl.live.guard")


class _Counter(logging.Handler):
    """Clients can send nonsense as fast as the network carries it."""

    def __init__(self, report: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self.count = 0
        self._report = report

    def emit(self, record: logging.LogRecord) -> None:
        self.count += 1
        if self.count == 1:
            self._report(f"{printable(record.getMessage())}; more of this kind is only counted")


@contextlib.contextmanager
def complaints(report: Callable[[str], None]) -> Iterator[None]:
    """`report` the first during the block, and at its end how many there were."""
    counter = _Counter(report)
    for name in LOGGERS:
        logging.getLogger(name).addHandler(counter)
    try:
        yield
    finally:
        for name in LOGGERS:
            logging.getLogger(name).removeHandler(counter)
        if counter.count > 1:
            report(f"{counter.count} complaints of clients in all")

"""Readers that do what libraries do with files that are made to harm."""

import os
import signal
import time
from pathlib import Path

from cranectl.support.tables.columns import ReadColumn
from cranectl.support.tables.head import TableHead


def die(_: Path, where: str) -> TableHead:
    os.kill(os.getpid(), signal.SIGSEGV)
    raise AssertionError(where)


def abort(_: Path, where: str) -> TableHead:
    os.abort()
    raise AssertionError(where)


def leave(_: Path, where: str) -> TableHead:
    os._exit(0)
    raise AssertionError(where)


def never_end(_: Path, where: str) -> TableHead:
    while time.process_time() < 100.0:
        pass
    raise AssertionError(where)


def sleep(_: Path, where: str) -> TableHead:
    time.sleep(100.0)
    raise AssertionError(where)


def fill_memory(_: Path, where: str) -> TableHead:
    held = [bytearray(2**24) for _ in range(2**10)]
    raise AssertionError(where, len(held))


def recurse(_: Path, where: str) -> TableHead:
    return recurse(_, where)


def die_later(_: Path, where: str) -> TableHead:
    def load(_: int, __: bool) -> ReadColumn:
        os.kill(os.getpid(), signal.SIGBUS)
        raise AssertionError

    return TableHead(where, ("x",), load)

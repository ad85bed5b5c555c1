"""Blocks of a run in a child process: a law that ends the process, or never returns, ends only its run.

The record is memory that both share; the child tells how far it is after each block. Where processes cannot
be forked the blocks run here.
"""

import contextlib
import faulthandler
import mmap
import multiprocessing
import os
import select
import signal
import struct
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import numpy as np

from cranectl.status import RunStatus
from cranectl.support.arrays import Array
from cranectl.support.interrupts import SIGNALS

PATIENCE = 10.0  # [s] for a block, by default
CAN_FORK = hasattr(os, "fork")
_REPORT = struct.Struct("=qqq")  # complete rows, sample it ended at, status

Advance = Callable[[int], tuple[int, int, int]]  # from a row on by a block: (complete rows, end, status)


def shared_zeros(shape: tuple[int, int]) -> Array:
    """Memory that a child shares."""
    count = shape[0] * shape[1]
    return np.frombuffer(mmap.mmap(-1, max(8 * count, 1)), dtype=np.float64, count=count).reshape(shape)


def blocks_here(advance: Advance, total: int) -> Iterator[tuple[int, int, int]]:
    """What `advance` returns, block by block, until `total` rows are complete or a status ends the run."""
    rows, status = 0, int(RunStatus.RUNNING)
    while rows < total and status == RunStatus.RUNNING:
        rows, end, status = advance(rows)
        yield rows, end, status


def blocks_in_child(
    advance: Advance, total: int, name: str, patience: float
) -> Iterator[tuple[int, int, int]]:
    """As `blocks_here`, in a child.

    If it dies, or takes longer than `patience` [s] for a block, it says so and the run ends as
    `controller-failed`.
    """
    reading, writing = os.pipe()
    child = _fork()
    if child == 0:
        os.close(reading)
        _work(advance, total, writing)
    os.close(writing)
    with contextlib.suppress(PermissionError, ProcessLookupError):
        os.setpgid(child, child)  # as the child does: whoever is first
    rows = 0
    try:
        while True:
            ready, _, _ = select.select([reading], [], [], patience)
            report = os.read(reading, _REPORT.size) if ready else b""
            if len(report) < _REPORT.size:
                code, child = _end(child), -1
                why = how_it_ended(code) if ready else f"took more than {patience:g} s for a block"
                print(f"cranectl: {name} {why}", file=sys.stderr)
                yield rows, rows, int(RunStatus.CONTROLLER_FAILED)
                return
            rows, end, status = _REPORT.unpack(report)
            yield rows, end, status
            if rows >= total or status != RunStatus.RUNNING:
                return
    finally:
        os.close(reading)
        if child > 0:
            _end(child)


def spawned(work: Callable[..., None], *given: Any) -> tuple[BaseProcess, Connection]:
    """A process that does `work` with what is `given` and its end of a pipe, and the other end."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=work, args=(*given, there), daemon=True)
    process.start()
    there.close()
    return process, here


def how_it_ended(exit_code: int) -> str:
    """What became of a process with this exit code, -N after signal N."""
    how = signal.Signals(-exit_code).name if exit_code < 0 else f"exit code {exit_code}"
    return f"ended its process with {how}"


def _end(child: int) -> int:
    """End it and what it has started; returns its exit code."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _fork() -> int:
    with warnings.catch_warnings():  # of threads, none of which the child needs
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def _work(advance: Advance, total: int, writing: int) -> None:
    """In the child: all blocks; whatever goes wrong in here is told by its end."""
    os.setpgid(0, 0)  # what it starts ends with it
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)  # the parent alone takes them
    faulthandler.disable()  # the parent says how it ended
    parent = os.getppid()

    def end_with_parent() -> None:
        while os.getppid() == parent:
            threading.Event().wait(1.0)
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
    code = 1
    try:
        for report in blocks_here(advance, total):
            os.write(writing, _REPORT.pack(*report))
        code = 0
    except Exception as error:
        os.write(2, f"cranectl: {type(error).__name__}: {error}\n".encode())
    finally:
        os._exit(code)

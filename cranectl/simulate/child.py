"""Run blocks in a child process: a controller that ends it, or never returns, ends only its run.

The record is memory that both share; the child tells how far it is after each block. Where processes cannot
be forked the blocks run here.
"""

import ctypes
import mmap
import os
import sys
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection

import numpy as np

from cranectl.status import RunStatus
from cranectl.support.arrays import Array
from cranectl.support.errors import MachineError, printable

CAN_FORK = hasattr(os, "fork")
# [s] for a block, by default: it only ends what hangs. A predictive controller takes ten seconds for a block
# on a usual machine.
BLOCK_TIMEOUT = 120.0

Advance = Callable[[int], tuple[int, int, int]]  # from a row on by a block: (complete rows, end, status)


def shared_zeros(shape: tuple[int, int]) -> Array:
    """Memory that a child shares."""
    count = shape[0] * shape[1]
    return np.frombuffer(mmap.mmap(-1, max(8 * count, 1)), dtype=np.float64, count=count).reshape(shape)


def blocks_here(advance: Advance, total: int) -> Iterator[tuple[int, int, int]]:
    """Yield the results of `advance`, block by block, until all rows are complete or the run ends."""
    rows, status = 0, int(RunStatus.RUNNING)
    while rows < total and status == RunStatus.RUNNING:
        rows, end, status = advance(rows)
        yield rows, end, status


def blocks_in_child(
    advance: Advance, total: int, name: str, patience: float
) -> Iterator[tuple[int, int, int]]:
    """Yield what `blocks_here` yields, computed in a child process.

    If it dies, or takes longer than `patience` [s] for a block, it says so and the run ends as
    `controller-failed`. Time in which it waits for a processor, or for a program to start, does not count.
    Raises MachineError if it is killed from outside, or lacks memory or disk space.
    """
    from cranectl.support.children import ChildError, fork_child  # which only laws from outside need

    def work(connection: Connection) -> None:
        libc = ctypes.CDLL(None)
        for report in blocks_here(advance, total):
            libc.fflush(None)  # what the law has printed in C
            connection.send(report)

    rows, status, child = 0, int(RunStatus.RUNNING), fork_child(work)
    try:
        while rows < total and status == RunStatus.RUNNING:
            rows, end, status = child.receive(patience)
            yield rows, end, status
    except ChildError as error:
        if error.is_killed:
            raise MachineError.of(f"the run with {name} {error}, from outside") from None
        hint = "; --patience allows more" if error.is_silent else ""
        print(printable(f"cranectl: {name} {error}{hint}"), file=sys.stderr)
        yield rows, rows, int(RunStatus.CONTROLLER_FAILED)
    except MachineError:
        what = f"the run with {name} lacks memory, disk space or file handles"
        raise MachineError.of(what) from None
    finally:
        child.end()

"""Run blocks of samples in a child process, so that a controller that crashes or hangs ends only its run.

Both processes share the memory of the record, and the child reports after each block. On systems that cannot
fork processes the blocks run in this one.
"""

import ctypes
import mmap
import os
import sys
from collections.abc import Callable, Iterator

import numpy as np

from cranectl import support
from cranectl.status import RunStatus
from cranectl.support import Array, MachineError, Parent, printable

CAN_FORK = hasattr(os, "fork")
# [s] for a block by default, to end only controllers that hang: a predictive controller takes ten seconds for
# a block on a usual machine.
BLOCK_TIMEOUT = 120.0

Advance = Callable[[int], tuple[int, int, int]]  # first row of a block → (complete rows, end, status)


def shared_zeros(shape: tuple[int, int]) -> Array:
    """Return an array of zeros in memory that child processes share."""
    count = shape[0] * shape[1]
    # Without a file, a map is shared with forked processes. It must not be empty, as an array may be.
    return np.frombuffer(mmap.mmap(-1, max(8 * count, 1)), dtype=np.float64, count=count).reshape(shape)


def blocks_here(advance: Advance, total: int) -> Iterator[tuple[int, int, int]]:
    """Yield the results of `advance`, block by block, until all rows are complete or the run ends."""
    rows, status = 0, int(RunStatus.RUNNING)
    while rows < total and status == RunStatus.RUNNING:
        rows, end, status = advance(rows)
        yield rows, end, status


def blocks_in_child(
    advance: Advance, total: int, name: str, timeout: float
) -> Iterator[tuple[int, int, int]]:
    """Yield the results of `advance`, block by block, computed in a child process.

    If the child dies, or takes longer than `timeout` [s] for a block, a message is printed and the run ends
    as `controller-failed`. Time that it waits for a processor or for a program to start does not count.
    Raises MachineError if the child is killed from outside, or lacks memory or disk space.
    """

    def work(parent: Parent) -> None:
        libc = ctypes.CDLL(None)
        for report in blocks_here(advance, total):
            libc.fflush(None)  # text that the controller has printed in C
            parent.send(report)

    rows, status, child = 0, int(RunStatus.RUNNING), support.Child.fork(work)
    try:
        while rows < total and status == RunStatus.RUNNING:
            rows, end, status = child.receive(timeout)
            yield rows, end, status
    except support.Child.Error as error:
        if error.is_killed:
            raise MachineError.of(f"the run with {name} {error}, from outside") from None
        hint = "; --timeout allows more" if error.is_silent else ""
        print(printable(f"cranectl: {name} {error}{hint}"), file=sys.stderr)
        yield rows, rows, int(RunStatus.CONTROLLER_FAILED)
    except MachineError:
        what = f"the run with {name} lacks memory, disk space or file handles"
        raise MachineError.of(what) from None
    finally:
        child.end()

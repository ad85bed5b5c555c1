"""Run block by block in the same few rows: what each block was is looked at, not kept."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.simulate.loop_inputs import LoopInputs
from cranectl.simulate.loops import AdvanceBlock
from cranectl.simulate.plan import Plan
from cranectl.simulate.signal_path import SignalPath
from cranectl.status import RunStatus

Array = NDArray[np.float64]


class PreparedRun(NamedTuple):
    """A run at its first sample."""

    advance: AdvanceBlock
    inputs: LoopInputs
    path: SignalPath | None
    memory: Array


class Block(NamedTuple):
    """Consecutive complete samples; its rows are written over by the next block."""

    time_ns: NDArray[np.int64]  # (n,)
    record: Array  # (n, columns of `signals` without those of the signal path)
    reference: Array  # (n, 15)
    path: Array  # (n, PATH_WIDTH) what the signal path recorded; without one, `record`


def stream_run(
    run: PreparedRun, plan: Plan, record: Array, look: Callable[[Block], None]
) -> tuple[int, RunStatus]:
    """Run `plan` to its end, `len(record)` samples at a time; returns when it ended [ns], and how.

    The signal path must have a record of as many rows. Sample by sample the same as a run in one piece.
    """
    total, size = len(plan.time_ns), len(record)
    for first in range(0, total, size):
        piece = slice(first, min(first + size, total))
        reference = plan.reference[piece]
        inputs = run.inputs._replace(
            reference=reference, disturbance=plan.disturbance[piece], wind=plan.wind[piece]
        )
        rows, end, code = run.advance(inputs, run.path, record, run.memory, 0, len(reference))
        path = record if run.path is None else run.path.record
        look(Block(plan.time_ns[first : first + rows], record[:rows], reference[:rows], path[:rows]))
        if code != RunStatus.RUNNING:
            return int(plan.time_ns[first + end]), RunStatus(code)
    return int(plan.time_ns[-1]), RunStatus.COMPLETED

"""Advance a plant by a block of samples: one loop, in plain Python or compiled with the kernels of a plant.

Both give the same bits; a test holds them to it. A block returns often enough for progress, Ctrl-C and live
changes.
"""

import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cranectl.plants.plant import Kernels, Plant
from cranectl.signals import DISTURBANCE_COLUMN, LOAD_COLUMN, STATE_COLUMN
from cranectl.simulate.loop_inputs import (
    RUNNING,
    LoopInputs,
    command_of,
    complete_rows,
    control_sample,
    judge_sample,
)
from cranectl.simulate.signal_path import SignalPath
from cranectl.status import RunStatus
from cranectl.support.jit import jit_loop

Array = NDArray[np.float64]

ENGINE_WARNING = int(RunStatus.ENGINE_WARNING)

# (inputs, path, record, memory, first, last) → (complete rows, sample it ended at, status)
AdvanceBlock = Callable[[LoopInputs, SignalPath | None, Array, Array, int, int], tuple[int, int, int]]


def compiled_loop(plant: Plant) -> AdvanceBlock:
    """The loop compiled with the kernels of `plant`."""
    return functools.partial(_compiled(plant.name, plant.kernels), plant.handle)


def python_loop(plant: Plant) -> AdvanceBlock:
    """The loop as it stands here; slower, and easy to step through."""
    return functools.partial(advance_block, plant)


@functools.cache
def _compiled(name: str, kernels: Kernels) -> Callable[..., tuple[int, int, int]]:
    return jit_loop(advance_block, name, **kernels._asdict())


def measure(plant: Plant, state: Array) -> None:
    """The joints of `plant`; its kernel takes this place in the compiled loop, as for the next two."""
    plant.measure(state)


def advance(plant: Plant, command: Array, disturbance: Array, wind: Array, load: Array) -> None:
    """One control period of `plant`."""
    plant.advance(np.array(command), disturbance, wind, load)


def warnings(plant: Plant) -> int:
    """Numerical warnings of `plant`."""
    return plant.warnings()


def advance_block(plant, inputs, path, record, memory, first, last):
    """Samples `first` to `last` - 1; returns (complete rows, sample it ended at, status)."""
    for k in range(first, last):
        row = record[k]
        measure(plant, row[STATE_COLUMN : STATE_COLUMN + 10])
        status = control_sample(inputs, path, k, row, memory)
        if status != RUNNING:
            return k, k, status
        command = command_of(inputs, path, k, row)
        disturbance = row[DISTURBANCE_COLUMN : DISTURBANCE_COLUMN + 2]
        advance(plant, command, disturbance, inputs.wind[k], row[LOAD_COLUMN : LOAD_COLUMN + 7])
        status = judge_sample(inputs, row)
        if status == RUNNING and warnings(plant) > 0:
            status = ENGINE_WARNING
        if status != RUNNING:
            return complete_rows(k, status), k, status
    return last, last, RUNNING

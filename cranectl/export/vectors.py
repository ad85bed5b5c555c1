"""Test vectors of a controller: samples of a simulated run, and what the compiled step makes of them."""

from collections.abc import Iterable, Iterator
from ctypes import POINTER, c_double
from typing import NamedTuple

import numpy as np

from cranectl.controllers.addressed import CompiledController
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.support.jit import STEP

PARTS_OF_A_RUN, SAMPLES_IN_A_ROW = 5, 200  # samples in a row, spread over the run


class Sample(NamedTuple):
    """What a step gets and what it returns."""

    measured: Array  # (12,)
    reference: Array  # (15 for each row that a step gets,)
    before: Array  # memory before the step; the next step overwrites it
    command: Array  # (3,)
    status: int


def replay(
    address: int, compiled: CompiledController, inputs: Iterable[tuple[Array, Array]]
) -> Iterator[Sample]:
    """Yield what the step at an address does with measurements and references, from the start of a run."""
    step, pointer = STEP(address), POINTER(c_double)
    parameters, memory, command = compiled.parameters.copy(), compiled.start.copy(), np.zeros(3)
    before = memory.copy()
    for measured, reference in inputs:
        before[:] = memory
        arrays = (parameters, measured, reference, memory, command)
        status = step(*(array.ctypes.data_as(pointer) for array in arrays))
        yield Sample(measured, reference, before, command.copy(), status)


def inputs_of(run: Run, compiled: CompiledController, preview: int) -> list[tuple[Array, Array]]:
    """Return what each step of a run measures, and its rows of the reference."""
    states = run.block("measurement" if run.has("measurement") else "state")
    measured = np.zeros((len(states), 12))
    if compiled.encoders:
        measured[:, :5] = states[:, :10:2]
    else:
        measured[:, : states.shape[1]] = states
    return [
        (measured[k], compiled.reference[k : k + 1 + preview].ravel())
        for k in range(0, len(states), compiled.every)
    ]


def record_blocks(samples: Iterable[Sample], total: int) -> list[list[Sample]]:
    """Return blocks of samples in a row, spread evenly over a run of `total` steps."""
    length = min(SAMPLES_IN_A_ROW, total)
    starts = np.unique(np.linspace(0, total - length, PARTS_OF_A_RUN).astype(int)).tolist()
    blocks: list[list[Sample]] = [[] for _ in starts]
    for k, sample in enumerate(samples):
        for start, block in zip(starts, blocks, strict=True):
            if start <= k < start + length:
                block.append(sample if k > start else sample._replace(before=sample.before.copy()))
    return blocks

"""Test vectors: what each control sample of a run gets, and what the compiled function makes of it."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from cranectl.controllers import JOINTS
from cranectl.signals import ROPE
from cranectl.simulate import Encoders, PreparedController, Run
from cranectl.support import Array, CompiledStep
from cranectl.tools.export.sample import ControlSample

PARTS_OF_A_RUN, SAMPLES_IN_A_ROW = 5, 200  # samples in a row, spread over the run


class Sample(NamedTuple):
    """What a step gets and what it returns."""

    measured: Array
    reference: Array  # (15 for each row that a step gets,)
    before: Array  # memory before the step; the next step overwrites it
    command: Array  # (3,)
    status: int


def replay(
    address: int, parameters: Array, start: Array, inputs: Iterable[tuple[Array, Array]]
) -> Iterator[Sample]:
    """Yield what the step at an address does with measurements and references, from its memory at `start`."""
    parameters, memory, command = parameters.copy(), start.copy(), np.zeros(3)
    before = memory.copy()
    for measured, reference in inputs:
        before[:] = memory
        status = CompiledStep.call(address, parameters, measured, reference, memory, command)
        yield Sample(measured, reference, before, command.copy(), status)


def inputs_of(
    run: Run, sample: ControlSample, prepared: PreparedController, preview: int
) -> list[tuple[Array, Array]]:
    """Return what each control sample of a run measures, and its rows of the reference."""
    measured = readings_of(run) if sample.measured == JOINTS else _states_of(run)
    reference = prepared.compiled.reference
    return [(row, reference[k : k + 1 + preview].ravel()) for k, row in enumerate(measured)]


def readings_of(run: Run) -> Array:
    """Return the readings (N, 5) of the encoders in a run with them."""
    sensing, setting = run.scenario.effects.sensing, run.scenario.effects.installation
    assert sensing is not None
    readings = run.state.joints.copy()
    readings[:, ROPE // 2] += setting.rope_offset if setting else 0.0
    return Encoders.of(sensing, run.scenario.steps + 1).read(readings)


def _states_of(run: Run) -> Array:
    """Return the states (N, 10) that the controller of a run without encoders measures."""
    states = run.block("measurement" if run.has("measurement") else "state")
    return states[:, : 2 * JOINTS].copy()


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

"""Advance a plant by a block of samples: compiled, or in plain Python over the same compiled kernel.

Both give the same bits; a test holds them to it. A block returns often enough for progress, Ctrl-C and live
changes.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cranectl.plants.plant import Plant
from cranectl.signals import DISTURBANCE_COLUMN, LOAD_COLUMN, STATE_COLUMN
from cranectl.simulate.loop_inputs import (
    RUNNING,
    Sampling,
    command_of,
    complete_rows,
    control_sample,
    judge_sample,
)
from cranectl.simulate.signal_path import Stages
from cranectl.status import RunStatus

Array = NDArray[np.float64]

# (sampling, stages, record, memory, first, last) → (complete rows, sample it ended at, status)
AdvanceBlock = Callable[[Sampling, Stages | None, Array, Array, int, int], tuple[int, int, int]]


def compiled_loop(plant: Plant) -> AdvanceBlock:
    """The compiled block loop of `plant`."""
    if plant.name == "analytic":
        return _compiled_analytic(plant)
    return _compiled_mujoco(plant)


def _compiled_analytic(plant: Plant) -> AdvanceBlock:
    from cranectl.plants.analytic import AnalyticPlant
    from cranectl.simulate import analytic_loop

    assert isinstance(plant, AnalyticPlant)
    work = (plant.rig, plant.state, plant.stages, plant.stage_state)
    return lambda *arguments: analytic_loop.advance_block(*work, *arguments)


def _compiled_mujoco(plant: Plant) -> AdvanceBlock:
    from cranectl.plants.mujoco.plant import MujocoPlant
    from cranectl.simulate import mujoco_loop

    assert isinstance(plant, MujocoPlant)
    return lambda *arguments: mujoco_loop.advance_block(plant.rig, *arguments)


def python_loop(plant: Plant) -> AdvanceBlock:
    """The same loop in plain Python, for any plant; slower, and easy to step through."""

    def advance_block(
        sampling: Sampling, stages: Stages | None, record: Array, memory: Array, first: int, last: int
    ) -> tuple[int, int, int]:
        for k in range(first, last):
            row = record[k]
            plant.measure(row[STATE_COLUMN : STATE_COLUMN + 10])
            status = control_sample(sampling, stages, k, row, memory)
            if status != RUNNING:
                return k, k, status
            command = np.array(command_of(sampling, stages, k, row))
            disturbance = row[DISTURBANCE_COLUMN : DISTURBANCE_COLUMN + 2]
            plant.advance(command, disturbance, sampling.wind[k], row[LOAD_COLUMN : LOAD_COLUMN + 7])
            status = judge_sample(sampling, row)
            if status == RUNNING and plant.warnings():
                status = int(RunStatus.ENGINE_WARNING)
            if status != RUNNING:
                return complete_rows(k, status), k, status
        return last, last, RUNNING

    return advance_block

"""The compiled loop over the MuJoCo plant; calls the engine's step without going through Python."""

from cranectl.plants.mujoco.plant import advance_mujoco, measure_joints
from cranectl.signals import DISTURBANCE_COLUMN, LOAD_COLUMN, STATE_COLUMN
from cranectl.simulate.loop_inputs import RUNNING, command_of, complete_rows, control_sample, judge_sample
from cranectl.status import RunStatus
from cranectl.support.jit import jit_loop

ENGINE_WARNING = int(RunStatus.ENGINE_WARNING)


@jit_loop
def advance_block(rig, sampling, stages, record, memory, first, last):
    """Samples `first` to `last` - 1; returns (complete rows, sample it ended at, status)."""
    for k in range(first, last):
        row = record[k]
        measure_joints(rig, row[STATE_COLUMN : STATE_COLUMN + 10])
        status = control_sample(sampling, stages, k, row, memory)
        if status != RUNNING:
            return k, k, status
        command = command_of(sampling, stages, k, row)
        disturbance = row[DISTURBANCE_COLUMN : DISTURBANCE_COLUMN + 2]
        load = row[LOAD_COLUMN : LOAD_COLUMN + 7]
        advance_mujoco(rig, command, disturbance, sampling.wind[k], load)
        status = judge_sample(sampling, row)
        if status == RUNNING and rig.warnings.any():
            status = ENGINE_WARNING
        if status != RUNNING:
            return complete_rows(k, status), k, status
    return last, last, RUNNING

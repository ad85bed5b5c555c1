"""The compiled loop over the analytic plant."""

from cranectl.plants.analytic import advance_analytic
from cranectl.signals import DISTURBANCE_COLUMN, LOAD_COLUMN, STATE_COLUMN
from cranectl.simulate.loop_inputs import RUNNING, command_of, complete_rows, control_sample, judge_sample
from cranectl.support.jit import jit_loop


@jit_loop
def advance_block(rig, state, work, work_state, sampling, stages, record, memory, first, last):
    """Samples `first` to `last` - 1; returns (complete rows, sample it ended at, status)."""
    for k in range(first, last):
        row = record[k]
        for i in range(10):
            row[STATE_COLUMN + i] = state[i]
        status = control_sample(sampling, stages, k, row, memory)
        if status != RUNNING:
            return k, k, status
        command = command_of(sampling, stages, k, row)
        disturbance = row[DISTURBANCE_COLUMN : DISTURBANCE_COLUMN + 2]
        load = row[LOAD_COLUMN : LOAD_COLUMN + 7]
        advance_analytic(rig, state, command, disturbance, sampling.wind[k], load, work, work_state)
        status = judge_sample(sampling, row)
        if status != RUNNING:
            return complete_rows(k, status), k, status
    return last, last, RUNNING

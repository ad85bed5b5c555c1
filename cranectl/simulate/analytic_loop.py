"""The compiled loop over the analytic plant."""

from cranectl.jit import jit
from cranectl.plants.analytic import advance_analytic
from cranectl.signals import DISTURBANCE_COLUMN, LOAD_COLUMN, STATE_COLUMN
from cranectl.simulate.sample import RUNNING, complete_rows, control_sample, judge_sample


@jit
def advance_block(rig, state, stages, stage_state, sampling, record, memory, first, last):
    """Samples `first` to `last` - 1; returns (complete rows, sample it ended at, status)."""
    for k in range(first, last):
        row = record[k]
        row[STATE_COLUMN : STATE_COLUMN + 10] = state
        status = control_sample(sampling, k, row, memory)
        if status != RUNNING:
            return k, k, status
        command = row[sampling.command_column : sampling.command_column + 3]
        disturbance = row[DISTURBANCE_COLUMN : DISTURBANCE_COLUMN + 2]
        load = row[LOAD_COLUMN : LOAD_COLUMN + 7]
        advance_analytic(rig, state, command, disturbance, sampling.wind[k], load, stages, stage_state)
        status = judge_sample(sampling, row)
        if status != RUNNING:
            return complete_rows(k, status), k, status
    return last, last, RUNNING

"""Between plant and tracker on a real rig: encoders and observer before it, limits and transport after it.

A run without them gets None, for which the compiled loop has no code at all.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.effects.delay import make_line, transport
from cranectl.effects.installation import Misreading, make_misreading
from cranectl.effects.limits import SetpointLimits, limited, make_limits
from cranectl.effects.sensing import Encoders, make_encoders, read_encoder
from cranectl.effects.settings import Sensing
from cranectl.jit import jit
from cranectl.observer import (
    DISTURBANCE,
    JOINTS,
    POSITION,
    VELOCITY,
    Observer,
    correct,
    initial_estimate,
    make_observer,
    predict,
)
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import COMMAND_COLUMN, INPUT_COLUMN, STAGE_WIDTH, STATE_COLUMN
from cranectl.tracker import SETPOINT

Array = NDArray[np.float64]

ROPE = 2  # among the joints


class Stages(NamedTuple):
    """The stages of one run, with their memories and their part of the record."""

    sensed: bool  # else the tracker is told the true state
    encoders: Encoders
    observer: Observer
    estimate: Array  # the observer's memory
    misreading: Misreading
    limits: SetpointLimits
    previous: Array  # (3,) last command given
    line: Array  # (samples of delay, 3) commands under way
    clock: NDArray[np.int64]  # (1,) samples since the start
    record: Array  # (N, STAGE_WIDTH)


def make_stages(
    scenario: Scenario,
    start: Array,
    *,
    drive: str,
    samples: int,
    known: Scenario | None = None,
    record: Array | None = None,
) -> Stages | None:
    """The stages of a run that starts at `start` (10,); None if the scenario has none of their effects.

    The observer is designed for `known`, by default the scenario itself. `record`: where they write, by
    default whole memory for `samples`.
    """
    effects = scenario.effects
    if not effects.staged:
        return None
    period = scenario.period_ns / NANOSECONDS
    known = known or scenario
    sensing = effects.sensing or Sensing()
    bandwidth = (known.effects.sensing or sensing).observer_bandwidth
    first = start[1:6:2] if drive == "velocity" else np.zeros(3)
    return Stages(
        sensed=effects.sensing is not None,
        encoders=make_encoders(sensing, samples if effects.sensing else 1),
        observer=make_observer(bandwidth, period=period, gravity=known.rig.gravity),
        estimate=initial_estimate(start),
        misreading=make_misreading(effects.installation),
        limits=make_limits(effects.limits, period),
        previous=first.copy(),
        line=make_line(effects.delay, period, first),
        clock=np.zeros(1, dtype=np.int64),
        record=np.zeros((samples, STAGE_WIDTH)) if record is None else record,
    )


def whole_record(record: Array, stages: Stages | None) -> Array:
    """The record of a run with the part of its stages, if it has any."""
    return record if stages is None else np.hstack([record, stages.record])


@jit
def sense(stages, row, told):
    """Write what the tracker is told of the state in `row` into `told` (STAGE_WIDTH,)."""
    offset = stages.misreading.rope_offset
    if not stages.sensed:
        for i in range(2 * JOINTS):
            told[i] = row[STATE_COLUMN + i]
        told[2 * ROPE] += offset
        return
    estimate = stages.estimate
    for joint in range(JOINTS):
        position = row[STATE_COLUMN + 2 * joint] + (offset if joint == ROPE else 0.0)
        correct(
            stages.observer,
            joint,
            read_encoder(stages.encoders, stages.clock[0], joint, position),
            estimate,
        )
        told[2 * joint] = estimate[POSITION + joint]
        told[2 * joint + 1] = estimate[VELOCITY + joint]
    told[2 * JOINTS] = estimate[DISTURBANCE + 3]
    told[2 * JOINTS + 1] = estimate[DISTURBANCE + 4]


@jit
def act(stages, command_column, row, memory, told):
    """Turn the command in `row` into what the drives get, at the end of `told`; limits correct `memory`.

    A set-point that is cut off is cut off in the tracker's integral too, so that it does not run away.
    """
    command = told[COMMAND_COLUMN : COMMAND_COLUMN + 3]
    for axis in range(3):
        wanted = row[command_column + axis]
        command[axis] = limited(stages.limits, axis, wanted, stages.previous[axis])
        told[COMMAND_COLUMN + 3 + axis] = 0.0
        if command[axis] != wanted:
            memory[SETPOINT + axis] += command[axis] - wanted
            told[COMMAND_COLUMN + 3 + axis] = 1.0
        stages.previous[axis] = command[axis]
        command[axis] *= stages.misreading.drive_gain[axis]
    if stages.sensed:
        predict(stages.observer, row[INPUT_COLUMN : INPUT_COLUMN + 3], stages.estimate)
    transport(stages.line, stages.clock[0], command)
    stages.clock[0] += 1

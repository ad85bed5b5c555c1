"""Between plant and controller on a real rig: encoders and observer before it, limits and transport after it.

Encoders read positions in whole steps, with noise; velocities are for the observer to find. Velocity drives
have a largest set-point and a largest change of it in a period. Commands arrive a whole number of samples
late. A run without any of these gets None, for which the compiled loop has no code at all.
"""

from math import floor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.controllers.flat import SETPOINT
from cranectl.controllers.observer import (
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
from cranectl.plants.surroundings import Misreading, make_misreading
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.scenario.effects import Delay, DriveLimits, Sensing
from cranectl.signals import COMMAND_COLUMN, INPUT_COLUMN, STAGE_WIDTH, STATE_COLUMN
from cranectl.support.jit import jit

Array = NDArray[np.float64]


class Encoders(NamedTuple):
    """Of bridge, trolley, rope, alpha, beta; noise is drawn before the run, so the same on any plant."""

    resolution: Array  # (5,) [m, m, m, rad, rad]; 0: as fine as a number
    noise: Array  # (N, 5), repeated after N samples


def make_encoders(sensing: Sensing, samples: int) -> Encoders:
    """Encoders for a run of `samples`; white noise from the setting's seed."""
    deviation = np.array([*sensing.position_noise, sensing.angle_noise, sensing.angle_noise])
    resolution = np.array([*sensing.position_resolution, sensing.angle_resolution, sensing.angle_resolution])
    white = np.random.default_rng(sensing.seed).standard_normal((samples, 5))
    return Encoders(resolution, deviation * white)


@jit
def read_encoder(encoders, sample, joint, position):
    """What the encoder of `joint` says of `position`: noise first, then the nearest step."""
    value = position + encoders.noise[sample % encoders.noise.shape[0], joint]
    step = encoders.resolution[joint]
    return step * floor(value / step + 0.5) if step > 0.0 else value


class SetpointLimits(NamedTuple):
    """Of bridge, trolley, winch."""

    velocity: Array  # (3,) [m/s]
    change: Array  # (3,) within a control period [m/s]


def make_limits(limits: DriveLimits | None, period: float) -> SetpointLimits:
    """The limits of drives that are sampled with `period` [s]; none at all for None."""
    if limits is None:
        return SetpointLimits(np.full(3, np.inf), np.full(3, np.inf))
    return SetpointLimits(np.array(limits.velocity), period * np.array(limits.acceleration))


@jit
def limited(limits, axis, setpoint, previous):
    """The set-point nearest to `setpoint` that the drive may be given after `previous` [m/s]."""
    change = limits.change[axis]
    reachable = min(max(setpoint, previous - change), previous + change)
    return min(max(reachable, -limits.velocity[axis]), limits.velocity[axis])


def make_line(delay: Delay | None, period: float, first: Array) -> Array:
    """Commands under way, shape (samples of delay, 3), each `first` (3,) as long as none has arrived."""
    samples = round(delay.seconds / period) if delay else 0
    return np.tile(first, (samples, 1))


@jit
def transport(line, sample, command):
    """Put `command` (3,) on the line and replace it by the one that arrives at `sample`."""
    length = line.shape[0]
    if length == 0:
        return
    place = sample % length
    for axis in range(3):
        line[place, axis], command[axis] = command[axis], line[place, axis]


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

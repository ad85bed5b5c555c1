"""The signal path of a real rig: encoders and observer before the controller, limits and delay after it.

Encoders read positions in whole steps, with noise, and the observer estimates velocities. Velocity drives
limit the set-point and its change in a period. Commands arrive a whole number of samples late.

A run without any of these has None instead of a signal path, for which the compiled loop has no code. Runs
with force drives always have one, since nothing else records their commands.
"""

from math import floor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.controllers import EXPECTED, JOINTS, Observer, initial_estimate, make_observer, observe, predict
from cranectl.plants import DRIVES, Drive
from cranectl.scenario import NANOSECONDS, DriveLimits, EffectNumbers, Scenario, Sensing
from cranectl.signals import COLUMN
from cranectl.simulate.actuation import commands_at_start, drive_acceleration
from cranectl.support import Array, jit


class Encoders(NamedTuple):
    """Encoders of bridge, trolley, rope, alpha, beta. Noise is drawn before the run, equal on all plants."""

    resolution: Array  # (5,) [m, m, m, rad, rad]; 0 for no rounding
    noise: Array  # (N, 5); it repeats after N samples

    @classmethod
    def of(cls, sensing: Sensing, samples: int) -> "Encoders":
        """Return the encoders of a run of `samples`, with white noise from the seed of the settings."""
        deviation = np.array([*sensing.position_noise, sensing.angle_noise, sensing.angle_noise])
        resolution = np.array(
            [*sensing.position_resolution, sensing.angle_resolution, sensing.angle_resolution]
        )
        white = np.random.default_rng(sensing.seed).standard_normal((samples, 5))
        return cls(resolution, deviation * white)

    def read(self, positions: Array) -> Array:
        """Return the readings (N, 5) at `positions` (N, 5) of successive samples from the first on."""
        readings = np.empty_like(positions)
        for sample, row in enumerate(positions):
            for joint in range(JOINTS):
                readings[sample, joint] = read_encoder(self, sample, joint, row[joint])
        return readings


@jit
def read_encoder(encoders, sample, joint, position):
    """Return the encoder reading of `joint` at `position`: noise is added before rounding."""
    value = position + encoders.noise[sample % encoders.noise.shape[0], joint]
    step = encoders.resolution[joint]
    return step * floor(value / step + 0.5) if step > 0.0 else value


class SetpointLimits(NamedTuple):
    """Limits of the set-points of bridge, trolley and winch."""

    velocity: Array  # (3,) largest set-point [m/s]
    change: Array  # (3,) largest change in a control period [m/s]

    @classmethod
    def of(cls, limits: DriveLimits | None, period: float) -> "SetpointLimits":
        """Return the limits of drives with the control `period` [s]; infinite limits for None."""
        if limits is None:
            return cls(np.full(3, np.inf), np.full(3, np.inf))
        return cls(np.array(limits.velocity), period * np.array(limits.acceleration))


CUT_OFF = 1e-9  # share of the largest set-point; a smaller change of one does not count as limited
RISE = 1000.0  # samples in which a drive without a limit of velocity is taken to reach its largest set-point


@jit
def limited(limits, axis, setpoint, previous):
    """Return the set-point nearest to `setpoint` that the limits allow after `previous` [m/s]."""
    change = limits.change[axis]
    reachable = min(max(setpoint, previous - change), previous + change)
    return min(max(reachable, -limits.velocity[axis]), limits.velocity[axis])


@jit
def transport(line, sample, command):
    """Put `command` (3,) on the delay line, and replace it by the command that arrives at `sample`."""
    length = line.shape[0]
    if length == 0:
        return
    slot = sample % length
    for axis in range(3):
        line[slot, axis], command[axis] = command[axis], line[slot, axis]


ROPE = 2  # among the joints


class CalibrationError(NamedTuple):
    """Errors of installation between controller and rig."""

    rope_offset: float  # encoder reading minus true rope length [m]
    drive_gain: Array  # (3,) executed over given command of bridge, trolley, winch
    dead_zone: Array  # (3,) set-points below these are ignored [m/s]


class SignalPath(NamedTuple):
    """Encoders, observer, limits and delay of a run, with their memories and their part of the record."""

    sensed: bool  # whether encoders and observer measure the state; else the true state is measured
    readings: Array  # (5,) of the encoders
    encoders: Encoders  # steps and noise of the readings
    observer: Observer  # estimates the state from the readings
    estimate: Array  # the observer's memory
    assumed: Array  # (3,) accelerations of the drives that the observer assumes [m/s²]
    calibration: CalibrationError  # what the controller does not know of rope and drives
    limits: SetpointLimits  # of the set-points of velocity drives; infinite for others
    previous: Array  # (3,) last command after limits
    line: Array  # (samples of delay, 3) commands that have not arrived yet
    clock: NDArray[np.int64]  # (1,) samples since the start
    record: Array  # (N, COLUMN.path_width)

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        start: Array,
        *,
        drive: Drive,
        nominal: Scenario | None = None,
        samples: int = 1,
    ) -> "SignalPath":
        """Return the signal path of a run that starts at `start` (10,), also one in which nothing changes.

        The observer is designed for `nominal`, by default the scenario itself. The noise of the encoders
        repeats after `samples`. The record has no rows yet.
        """
        nominal, effects, usual = nominal or scenario, scenario.effects, EffectNumbers()
        period = scenario.period_ns / NANOSECONDS
        sensing, setting = effects.sensing or usual.sensing, effects.installation or usual.installation
        bandwidth = (nominal.effects.sensing or sensing).observer_bandwidth
        kind, first = DRIVES[drive], commands_at_start(nominal, start, drive)
        return cls(
            sensed=effects.sensing is not None,
            readings=np.zeros(JOINTS),
            encoders=Encoders.of(sensing, samples if effects.sensing else 1),  # never read without the effect
            observer=make_observer(bandwidth, period=period, gravity=nominal.rig.gravity),
            estimate=initial_estimate(start),
            assumed=np.zeros(3),
            calibration=CalibrationError(
                setting.rope_offset, np.array(setting.drive_gain), np.array(setting.dead_zone)
            ),
            limits=SetpointLimits.of(effects.limits if "velocity" in kind.limits else None, period),
            previous=first.copy(),
            line=np.tile(first, (scenario.delay_samples, 1)),
            clock=np.zeros(1, dtype=np.int64),
            record=np.zeros((0, COLUMN.path_width)),
        )


@jit
def sense(path, row, measured):
    """Measure the state in `row`; write `measured` (12,), in the order of `SignalGroup.MEASUREMENT`."""
    offset = path.calibration.rope_offset
    if not path.sensed:
        for i in range(2 * JOINTS):
            measured[i] = row[COLUMN.state + i]
        measured[2 * ROPE] += offset
        for joint in range(JOINTS):
            path.readings[joint] = measured[2 * joint]
        return
    for joint in range(JOINTS):
        position = row[COLUMN.state + 2 * joint] + (offset if joint == ROPE else 0.0)
        path.readings[joint] = read_encoder(path.encoders, path.clock[0], joint, position)
    observe(path.observer, path.readings, path.estimate, measured)


@jit
def limit_command(limits, actuation, integral, intended, previous, estimate, assumed, commanded):
    """Limit the `intended` command (3,), and write it to `commanded` (6,) with flags of the limits that act.

    The integral of the set-points follows a limited one, so that it does not wind up. `assumed` (3,) are the
    accelerations that the observer assumes. There that of the limited set-point replaces the controller's.
    Otherwise the observer would take the rest for a disturbance. A controller that keeps to the limits may
    exceed them by rounding, which differs between processors. This does not count as limited.
    """
    for axis in range(3):
        commanded[axis] = limited(limits, axis, intended[axis], previous[axis])
        commanded[3 + axis] = 0.0
        cut = commanded[axis] - intended[axis]
        if commanded[axis] != intended[axis]:
            integral[axis] += cut
        if abs(cut) > CUT_OFF * min(limits.velocity[axis], RISE * limits.change[axis]):
            velocity = estimate[EXPECTED.velocity + axis]
            assumed[axis] = drive_acceleration(actuation, axis, commanded[axis], velocity)
            commanded[3 + axis] = 1.0
        previous[axis] = commanded[axis]


@jit
def act(path, actuation, integral, intended, row, commanded):
    """Limit and delay the `intended` command (3,); write the one that drives get, and which limits act.

    `commanded` (6,) receives both.
    """
    for axis in range(3):
        path.assumed[axis] = row[COLUMN.input + axis]
    limit_command(
        path.limits, actuation, integral, intended, path.previous, path.estimate, path.assumed, commanded
    )
    command = commanded[:3]  # a view: what follows changes the record
    for axis in range(3):
        if abs(command[axis]) < path.calibration.dead_zone[axis]:  # neither controller nor observer knows it
            command[axis] = 0.0
        command[axis] *= path.calibration.drive_gain[axis]
    if path.sensed:
        predict(path.observer, path.assumed, path.estimate)  # the observer knows of no delay
    transport(path.line, path.clock[0], command)
    path.clock[0] += 1

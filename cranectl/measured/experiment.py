"""Predict the readings of a measured run from numbers of the crane."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, sqrt
from typing import Any

import numpy as np

from cranectl.measured.assembly import rate_samples
from cranectl.measured.replay import Replay, measured_motion, simulate_replay
from cranectl.measured.responses import white_noise
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.similarity import length_scale
from cranectl.signals import STATE
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

MODEL, CHECK = "elastic", "mujoco"  # the plant that is fitted, and the one that checks it
AXES = ("bridge", "trolley", "winch")
CHANNELS: tuple[str, ...] = ("bridge_position", "trolley_position", "rope_length", "alpha", "beta")
ANGLE_SCALE, ANGLE_DELAY = "angles.scale", "angles.delay"  # of their sensor: no settings of a rig
MIN_ERROR = 0.002  # of time constants and load: errors that all runs share
MIN_DELAY_ERROR = 60e-6  # [s] on the laboratory rig; grows with the root of the size
SHORT_SPAN = 0.5  # of the time 1/w of the swing, in which its start is read
MIN_SLOPE_SAMPLES = 8  # samples from which a slope is read
REST_SWING = 0.01  # [rad] of a load that counts as at rest; zeros of its sensors included
STILL_STEPS, STILL_NOISE = 1.5, 4.0  # steps of an encoder and deviations of its noise in readings at rest
UNSTATED_NOISE = 3.0  # times noise and steps of the rig, from which the noise of the readings counts
REST_SPEED = 1e-3  # of a drive's speed limit, below which a run begins at rest


@dataclass(frozen=True)
class Unknown:
    """A number of the crane that is fitted."""

    name: str  # of the setting in a rig file
    unit: str
    start: float
    scale: float  # typical size of a change
    low: float = -np.inf
    floor: float = 0.0  # half of the interval that remains when all runs agree
    relative_floor: float = 0.0  # the same as a share of the number


def unknowns_of(rig: RigParameters, replay: Replay) -> tuple[Unknown, ...]:
    """Return the numbers that can be fitted, with their first values from `rig`."""
    friction, size = rig.effects.friction, length_scale(rig.rope_range[1])
    fitted = []
    if replay == "commands":
        for axis in AXES:
            tau = float(getattr(rig, f"{axis}_time_constant"))
            fitted.append(
                Unknown(f"{axis}_time_constant", "s", tau, tau, 0.05 * tau, relative_floor=MIN_ERROR)
            )
        gains = rig.effects.installation.drive_gain
        fitted += [Unknown(f"effects.installation.drive_gain.{k}", "1", gains[k], 0.1, 0.1) for k in range(3)]
        for k in range(3):
            force = friction.coulomb[k] or 0.02 * rig.load_mass * rig.gravity
            fitted.append(Unknown(f"effects.friction.coulomb.{k}", "N", force, force, 0.0))
        late = rig.effects.delay.seconds or 0.1 * rig.trolley_time_constant
        fitted.append(Unknown("effects.delay.seconds", "s", late, late, 0.0, MIN_DELAY_ERROR * sqrt(size)))
        mass = rig.load_mass
        fitted.append(Unknown("load_mass", "kg", mass, mass, 0.05 * mass, relative_floor=MIN_ERROR))
    else:
        late = 0.1 / sqrt(rig.gravity / rig.rope_range[1])
        fitted += [Unknown(ANGLE_SCALE, "1", 1.0, 0.1, 0.1), Unknown(ANGLE_DELAY, "s", 0.0, late)]
    length = 0.02 * rig.rope_range[1]
    fitted.append(Unknown("effects.installation.rope_offset", "m", 0.0, length))
    for name, unit in (("pivot_coulomb", "N m"), ("pivot_viscous", "N m s/rad")):
        value = float(getattr(friction, name)) or 1e-4 * rig.load_mass * rig.gravity * size
        fitted.append(Unknown(f"effects.friction.{name}", unit, value, value, 0.0))
    return tuple(fitted)


def rig_with(rig: RigParameters, values: Mapping[str, float]) -> RigParameters:
    """Return the rig with other `values`, by the names of its settings."""
    for name, value in values.items():
        if name not in (ANGLE_SCALE, ANGLE_DELAY):
            rig = _replace(rig, name.split("."), value)
    return rig


def _replace(settings: Any, path: Sequence[str], value: float) -> Any:
    """Return settings, or a list of numbers, with another value at the end of `path`."""
    if not path:
        return value
    key, *below = path
    if isinstance(settings, tuple):
        index = int(key)
        return (*settings[:index], _replace(settings[index], below, value), *settings[index + 1 :])
    return settings.model_copy(update={key: _replace(getattr(settings, key), below, value)})


class Experiment:
    """A measured run, and how its readings are predicted from numbers of the crane.

    Besides the crane's numbers a run has some of its own: where the axes are at its start, what the sensors
    of the angles read at zero, and how the load swings at the start, unless it rests.
    """

    def __init__(self, run: Run, rig: RigParameters, replay: Replay, max_readings: int) -> None:
        if replay == "commands" and not run.has("command"):
            raise InputError(
                f"the run {run.scenario.name} has no commands of the drives",
                allowed="runs with commands, or --replay motion",
                remedy="add --replay motion",
            )
        self.run, self.rig, self.replay = run, rig, replay
        self.rows = np.arange(0, len(run.time_ns), max(len(run.time_ns) // max_readings, 1))
        self.period = run.scenario.period_ns / NANOSECONDS
        state = run.block("state")
        self.readings = state[:, 0::2]
        self.commands = run.block("command")[:, :3] if replay == "commands" else measured_motion(run)
        self.noise = reading_noise(rig)
        self.still_noise = self._still_noise()
        self.frequency = sqrt(rig.gravity / float(state[0, 4]))
        self.motion = self._first_motion()  # of a run that begins in motion, in words
        self.at_rest = not self.motion
        self.start = state[0].copy()
        if self.at_rest:
            self.start[1::2] = 0.0
        self.channels = slice(0, 5) if replay == "commands" else slice(3, 5)
        self.compared = 5 if replay == "commands" else 2
        noise = 10.0 * self.noise
        swing_scale = [noise[3], noise[3] * self.frequency, noise[4], noise[4] * self.frequency]
        self.own_scale = np.array([*noise[self.channels], *([] if self.at_rest else swing_scale)])

    def _still_noise(self) -> Array:
        """Return the noise (5,) of readings at rest: that of the rig, unless the readings have far more."""
        _, stated = encoders_of(self.rig)
        seen = np.array([white_noise(readings) for readings in self.readings.T])
        noise: Array = np.where(seen > UNSTATED_NOISE * self.noise, seen, stated)
        return noise

    def still_samples(self) -> int:
        """Return how many samples pass before the axes are moved, at least one."""
        if self.replay == "commands":
            moving = (self.commands != self.commands[0]).any(axis=1)
        else:
            steps, _ = encoders_of(self.rig)  # readings of an axis at rest stay within these
            allowed = STILL_STEPS * steps[:3] + STILL_NOISE * self.still_noise[:3]
            moving = (np.abs(self.readings[:, :3] - self.readings[0, :3]) > allowed).any(axis=1)
        return max(int(np.argmax(moving)), 1) if moving.any() else len(moving)

    def resting_start(self) -> Array:
        """Return the first state (10,); at rest the axes are where they rest, and the load hangs still."""
        start: Array = self.start.copy()
        if self.at_rest:
            start[:6:2] = self.readings[: self.still_samples(), :3].mean(axis=0)
            start[6::2] = 0.0
        return start

    def resting_commands(self) -> Array:
        """Return what drives the run; a motion that begins at rest is still until an axis moves."""
        commands: Array = self.commands
        if self.at_rest and self.replay == "motion":
            commands = commands.copy()
            still = max(self.still_samples() - rate_samples(self.period) // 2, 1)
            commands[:still] = [*self.resting_start()[:6:2], *np.zeros(6)]
        return commands

    def _first_motion(self) -> str:
        """Return in words what moves at the start, or an empty text at rest."""
        first = max(round(SHORT_SPAN / (self.frequency * self.period)), 2)
        still = self.still_samples()
        if self.replay == "commands":
            limits = np.array(self.rig.effects.limits.velocity)
            moving = bool((np.abs(self.commands[0, :3]) >= REST_SPEED * limits).any())
        else:
            moving = still < min(first, len(self.readings))
        if moving:
            return f"an axis moves within the first {first * self.period:.2g} s"
        swing = self._first_swing(min(first, still))
        noise = STILL_NOISE * max(float(self.noise[3]), *self.still_noise[3:]) / sqrt(min(first, still))
        return f"its load swings by {degrees(swing):.2g}°" if swing >= REST_SWING + noise else ""

    def _first_swing(self, first: int) -> float:
        """Return the amplitude of the swing at the start [rad], from the first readings."""
        angles = self.readings[:first, 3:]
        if first < MIN_SLOPE_SAMPLES:
            return float(np.abs(angles[0]).max())
        slopes = np.polyfit(self.period * np.arange(first), angles, 1)[0]
        return float(np.hypot(np.abs(angles.mean(axis=0)), slopes / self.frequency).max())

    def predicted(self, values: Mapping[str, float], own: Array, plant: str = MODEL) -> Array:
        """Return the readings (N, 5) that a crane with these numbers gives on a plant; NaN after its end."""
        rig = rig_with(self.rig, values)
        offset = rig.effects.installation.rope_offset
        zeros = np.zeros(5)
        zeros[self.channels] = own[: self.compared]
        start = self.start.copy()
        start[0:6:2] += zeros[:3]
        start[4] -= offset
        start[6::2] = 0.0 if self.at_rest else start[6::2] - zeros[3:]
        if not self.at_rest:
            start[6:10] += own[self.compared :]
        commands = self.commands
        if self.replay == "commands":
            late = delayed(commands, rig.effects.delay.seconds, self.period)
            commands = late * np.array(rig.effects.installation.drive_gain)
        else:
            commands = commands.copy()
            commands[:, 2] -= offset
        scenario = crane_scenario(self.run.scenario, rig, self.replay)
        simulated = simulate_replay(
            self.run, plant, self.replay, scenario=scenario, commands=commands, initial=start
        )
        readings = np.full((len(self.run.time_ns), len(CHANNELS)), np.nan)
        state = simulated.block(STATE.name)
        readings[: len(state)] = state[:, 0::2]
        readings[:, 2] += offset
        if ANGLE_DELAY in values:
            time = self.run.time
            seen = [np.interp(time - values[ANGLE_DELAY], time, angle) for angle in readings[:, 3:].T]
            readings[:, 3:] = np.column_stack(seen)
        readings[:, 3:] = values.get(ANGLE_SCALE, 1.0) * readings[:, 3:] + zeros[3:]
        return readings

    def is_offset(self, j: int) -> bool:
        """Return whether the j-th number of this run only shifts the readings of its channel."""
        if j >= self.compared:
            return False
        channel = range(5)[self.channels][j]
        return channel < 2 or (channel > 2 and self.at_rest)

    def offset_slope(self, j: int) -> Array:
        """Return the derivative of the residuals (M,) by a number that only shifts readings."""
        derivative = np.zeros((len(self.rows), self.compared))
        derivative[:, j] = -self.own_scale[j] / self.noise[self.channels][j]
        flat: Array = derivative.ravel()
        return flat

    def residuals(self, values: Mapping[str, float], own: Array, plant: str = MODEL) -> Array:
        """Return measured minus predicted readings at the compared rows, in units of noise (M,)."""
        difference: Array = (self.readings - self.predicted(values, own, plant))[self.rows][:, self.channels]
        weighted: Array = np.nan_to_num(difference / self.noise[self.channels], nan=1e3)
        return weighted.ravel()


def encoders_of(rig: RigParameters) -> tuple[Array, Array]:
    """Return step and standard deviation of the noise of each channel's encoder (5,) [m or rad]."""
    sensing = rig.effects.sensing
    steps = np.array([*sensing.position_resolution, *[sensing.angle_resolution] * 2])
    noise = np.array([*sensing.position_noise, *[sensing.angle_noise] * 2])
    return steps.clip(min=1e-12), noise


def reading_noise(rig: RigParameters, mean_of: int = 1) -> Array:
    """Return the standard deviation of readings of each channel (5,), from steps and noise of encoders.

    With `mean_of` it is that of the mean of so many consecutive readings. Noise averages out. The error of
    rounding to a step does so only where noise shakes the reading by the step: at rest it repeats.
    """
    steps, noise = encoders_of(rig)
    rounding = steps**2 / 12.0
    repeated = rounding * np.exp(-np.square(2.0 * np.pi * noise / steps))
    deviations: Array = np.sqrt(repeated + (noise**2 + rounding - repeated) / mean_of)
    return deviations.clip(min=1e-7)


def delayed(commands: Array, dead_time: float, period: float) -> Array:
    """Return commands (N, 3) that arrive later, as their means over each period, also for parts of it."""
    time = period * np.arange(len(commands) + 1)
    sums = period * np.vstack([np.zeros(commands.shape[1]), np.cumsum(commands, axis=0)])
    late = np.column_stack([np.interp(time - dead_time, time, column) for column in sums.T])
    before = np.minimum(time - dead_time, 0.0)[:, None] * commands[0]
    means: Array = np.diff(late + before, axis=0) / period
    return means


def crane_scenario(scenario: Scenario, rig: RigParameters, replay: Replay) -> Scenario:
    """Return the scenario of a measured run for a crane with friction; moved axes feel none."""
    none = {"viscous": (0.0, 0.0, 0.0)} | ({"coulomb": (0.0, 0.0, 0.0)} if replay == "motion" else {})
    effects = scenario.effects.model_copy(update={"friction": rig.effects.friction.model_copy(update=none)})
    return scenario.model_copy(update={"rig": rig, "effects": effects})

"""Predict the readings of a measured run from numbers of the crane."""

from collections.abc import Mapping
from math import pi, sqrt

import numpy as np

from cranectl.scenario import NANOSECONDS, RigParameters
from cranectl.signals import ROPE, State
from cranectl.simulate import Run
from cranectl.support import Array, InputError, Mask
from cranectl.tools.measured.assembly import rate_samples
from cranectl.tools.measured.replay import (
    Replay,
    crane_scenario,
    measured_motion,
    positions_before,
    simulate_replay,
    with_longer_steps,
)
from cranectl.tools.measured.responses import white_noise
from cranectl.tools.measured.unknowns import ANGLE_DELAY, ANGLE_SCALE, rig_with

MODEL = "elastic"  # the plant that is fitted
CHANNELS: tuple[str, ...] = ("bridge_position", "trolley_position", "rope_length", "alpha", "beta")
SHORT_SPAN = 0.5  # of the time 1/w of the swing, in which no axis may move at the start
MISSING = 1e3  # residual of a reading that is not predicted, at least
MIN_SLOPE_SAMPLES = 8  # samples from which a slope is read
REST_SWING = 0.01  # [rad] by which a load typically swings before a run begins
STUCK_SHIFTS = 5.0  # times the angle at which a pivot sticks, by which a start is changed to see it swing
BLOCKS_IN_SWING = 20  # means of readings that are compared, in the shortest swing of a run
MIN_SAMPLES_IN_SWING = 20.0  # fewer samples do not show a swing
STILL_STEPS, STILL_NOISE = 1.5, 4.0  # steps of an encoder and deviations of its noise in readings at rest
UNSTATED_NOISE = 3.0  # times noise and steps of the rig, from which the noise of the readings counts
REST_SPEED = 1e-3  # of a drive's speed limit, below which a run begins at rest


class Experiment:
    """A measured run, and how its readings are predicted from numbers of the crane.

    Besides the crane's numbers a run has some of its own: where the axes are at its start, what the sensors
    of the angles read at zero, and how the load swings at the start: alpha, its rate, beta, its rate.
    """

    def __init__(self, run: Run, rig: RigParameters, replay: Replay, max_readings: int) -> None:
        if replay != "motion" and not run.has("command"):
            raise InputError(
                f"the run {run.scenario.name} has no commands of the drives",
                allowed="runs with commands, or --replay motion",
                remedy="add --replay motion",
            )
        self.run, self.rig, self.replay = run, rig, replay
        self.rows = np.arange(0, len(run.time_ns), max(len(run.time_ns) // max_readings, 1))
        self.period = run.scenario.period_ns / NANOSECONDS
        start, self.readings = run.state.values[0], run.state.joints
        self.commands = measured_motion(run) if replay == "motion" else run.commands
        self.noise = reading_noise(rig)
        self.still_noise = self._still_noise()
        self.frequency = sqrt(rig.gravity / float(start[ROPE]))
        self.swings = len(run.time_ns) * self.period * self.frequency / (2.0 * pi)  # in the run
        self.motion = self._first_motion()  # of axes that move at the start, in words
        self.at_rest = not self.motion
        shortest = 2.0 * pi * sqrt(max(float(self.readings[:, 2].min()), rig.rope_range[0]) / rig.gravity)
        self.samples_in_swing = shortest / self.period
        self.block = max(int(self.samples_in_swing / BLOCKS_IN_SWING), 1)
        self.start = start.copy()
        if self.at_rest:
            State(self.start).joint_rates[:] = 0.0
        self.channels = slice(3, 5) if replay == "motion" else slice(0, 5)
        self.compared = 2 if replay == "motion" else 5
        along_x, along_y, hoists = rig.moves
        # Whether each compared channel can move: alpha along y, beta along x.
        self.moving = np.array([along_x, along_y, hoists, along_y, along_x])[self.channels]
        noise = 10.0 * self.noise
        angles = np.maximum(noise[3:], STUCK_SHIFTS * stuck_angle(rig, float(start[ROPE])))
        swing_scale = [angles[0], angles[0] * self.frequency, angles[1], angles[1] * self.frequency]
        self.own_scale = np.array([*noise[self.channels], *swing_scale])
        # No prediction that ends may seem better than one that goes on and is wrong.
        farthest = np.array([*np.ptp(rig.workspace, axis=1), pi, pi])
        self.missing = np.maximum(MISSING, farthest / self.noise)[self.channels]

    def _still_noise(self) -> Array:
        """Return the noise (5,) of readings at rest: that of the rig, unless the readings have far more."""
        _, stated = encoders_of(self.rig)
        seen = np.array([white_noise(readings) for readings in self.readings.T])
        noise: Array = np.where(seen > UNSTATED_NOISE * self.noise, seen, stated)
        return noise

    def still_samples(self) -> int:
        """Return how many samples pass before the axes are moved, at least one."""
        if self.replay != "motion":
            # A controller that holds the axes commands small speeds, which the prediction repeats.
            limits = REST_SPEED * np.array(self.rig.effects.limits.velocity)
            beyond: Mask = np.abs(self.commands[:, :3] - self.commands[0, :3]) > limits
        else:
            steps, _ = encoders_of(self.rig)  # readings of an axis at rest stay within these
            allowed = STILL_STEPS * steps[:3] + STILL_NOISE * self.still_noise[:3]
            beyond = np.abs(self.readings[:, :3] - self.readings[0, :3]) > allowed
        moving: Mask = np.asarray(beyond.any(axis=1))
        return max(int(np.argmax(moving)), 1) if moving.any() else len(moving)

    def resting_start(self) -> Array:
        """Return the first state (10,); at rest the axes are where they rest, and a load hardly swings."""
        start: Array = self.start.copy()
        if self.at_rest:
            still = self.still_samples()
            first = State(start)
            first.axes[:] = self.readings[:still, :3].mean(axis=0)
            first.swing[:] = self.run.state.swing[0] if self._first_swing(still) >= REST_SWING else 0.0
        return start

    def resting_commands(self) -> Array:
        """Return what drives the run; a motion that begins at rest is still until an axis moves."""
        commands: Array = self.commands
        if self.at_rest and self.replay == "motion":
            commands = commands.copy()
            still = max(self.still_samples() - rate_samples(self.period) // 2, 1)
            commands[:still] = [*State(self.resting_start()).axes, *np.zeros(6)]
        return commands

    def _first_motion(self) -> str:
        """Return in words what moves at the start, or an empty text if the axes rest."""
        first = max(round(SHORT_SPAN / (self.frequency * self.period)), 2)
        if self.replay != "motion":
            limits = np.array(self.rig.effects.limits.velocity)
            moving = bool((np.abs(self.commands[0, :3]) >= REST_SPEED * limits).any())
        else:
            moving = self.still_samples() < min(first, len(self.readings))
        return f"an axis moves within the first {first * self.period:.2g} s" if moving else ""

    def first_own(self) -> Array:
        """Return first values of this run's own numbers, from the samples before its axes move.

        There the angles are their zeros and a free swing. A pause that is too short to tell these apart
        shows a load that hardly swings.
        """
        own = np.zeros(len(self.own_scale))
        if not self.at_rest:
            return own
        still = self.still_samples()
        if self.replay != "motion":
            own[:3] = self.readings[:still, :3].mean(axis=0) - self.readings[0, :3]
        time = self.period * np.arange(still)
        swings = np.column_stack([np.cos(self.frequency * time), np.sin(self.frequency * time)])
        free = np.column_stack([np.ones(still), swings])
        for k, noise in enumerate(self.noise[3:]):
            angles = self.readings[:still, 3 + k]
            precision = np.diag([0.0, 1.0, 1.0]) * (noise / self.usual_swing(k)) ** 2
            zero, cosine, sine = np.linalg.solve(free.T @ free + precision, free.T @ angles)
            own[self.compared - 2 + k] = zero
            own[self.compared + 2 * k : self.compared + 2 * k + 2] = cosine, self.frequency * sine
        return own

    def _first_swing(self, still: int) -> float:
        """Return the amplitude of the swing at the start above its noise [rad], zeros of sensors included."""
        first = min(max(round(SHORT_SPAN / (self.frequency * self.period)), 2), still)
        angles = self.readings[:first, 3:]
        noise = STILL_NOISE * max(float(self.noise[3]), *self.still_noise[3:]) / sqrt(first)
        if first < MIN_SLOPE_SAMPLES:
            return float(np.abs(angles[0]).max() - noise)
        slopes = np.polyfit(self.period * np.arange(first), angles, 1)[0]
        return float(np.hypot(np.abs(angles.mean(axis=0)), slopes / self.frequency).max() - noise)

    def usual_swing(self, k: int) -> float:
        """Return by how much an angle, 0 or 1, may swing at the start [rad], as far as one can tell."""
        return max(REST_SWING, 2.0 * float(np.ptp(self.readings[: self.still_samples(), 3 + k])))

    def predicted(self, values: Mapping[str, float], own: Array) -> Array:
        """Return the readings (N, 5) that a crane with these numbers gives; NaN after its end."""
        rig = rig_with(self.rig, values)
        offset = rig.effects.installation.rope_offset
        zeros = np.zeros(5)
        zeros[self.channels] = own[: self.compared]
        start = self.start.copy()
        first = State(start)
        first.axes[:] += zeros[:3]
        start[ROPE] -= offset
        first.angles[:] = 0.0 if self.at_rest else first.angles - zeros[3:]
        first.swing[:] += own[self.compared :]
        commands = self.commands
        late = 0.0  # by which the plant's clock is behind that of the run, less than a period
        if self.replay != "motion":
            whole, late = divmod(rig.effects.delay.seconds, self.period)
            arrived = commands[(np.arange(len(commands)) - int(whole)).clip(0, len(commands) - 1)]
            commands = arrived * np.array(rig.effects.installation.drive_gain)
            first.joints[:] += late * first.joint_rates
        else:
            commands = commands.copy()
            commands[:, 2] -= offset
        scenario = crane_scenario(self.run.scenario, rig, self.replay)
        scenario = with_longer_steps(scenario, "ideal" if self.replay == "motion" else self.run.drive)
        simulated = simulate_replay(
            self.run, MODEL, self.replay, scenario=scenario, commands=commands, initial=start
        )
        readings = np.full((len(self.run.time_ns), len(CHANNELS)), np.nan)
        state = simulated.state.values
        readings[: len(state)] = positions_before(state, late, self.period)
        readings[:, 2] += offset
        if ANGLE_DELAY in values:
            time = self.run.time
            seen = [np.interp(time - values[ANGLE_DELAY], time, angle) for angle in readings[:, 3:].T]
            readings[:, 3:] = np.column_stack(seen)
        readings[:, 3:] = values.get(ANGLE_SCALE, 1.0) * readings[:, 3:] + zeros[3:]
        return readings

    def own_slopes(
        self, values: Mapping[str, float], own: Array, base: Array, steps: Array | None = None
    ) -> Array:
        """Return the derivatives (Q, N, 5) of predicted readings `base` by this run's own numbers, (Q,).

        The numbers are changed by `steps` (Q,), or by their scales.
        """
        slopes = np.zeros((len(own), *base.shape))
        channels = range(5)[self.channels]
        for j, step in enumerate(self.own_scale if steps is None else steps):
            channel = channels[j] if j < self.compared else None
            if channel is not None and (channel < 2 or (channel > 2 and self.at_rest)):
                slopes[j, :, channel] = 1.0  # it only shifts the readings
            else:
                moved = own.copy()
                moved[j] += step
                slopes[j] = (self.predicted(values, moved) - base) / step
        return slopes

    def weighted(self, readings: Array) -> Array:
        """Return readings (N, 5) at the compared rows and channels, in units of noise (M,)."""
        values: Array = readings[self.rows][:, self.channels] / self.noise[self.channels]
        return values.ravel()

    def residuals(self, values: Mapping[str, float], own: Array) -> Array:
        """Return measured minus predicted readings at the compared rows, in units of noise (M,)."""
        return self.residuals_of(self.predicted(values, own))

    def residuals_of(self, predicted: Array) -> Array:
        """Return measured minus `predicted` readings (N, 5) at the compared rows, in units of noise (M,)."""
        residuals = self.weighted(self.readings - predicted).reshape(-1, self.compared)
        whole: Array = np.where(np.isnan(residuals), self.missing, residuals).ravel()
        return whole


def stuck_angle(rig: RigParameters, rope: float) -> float:
    """Return the angle [rad] up to which friction of the pivot holds the load."""
    return rig.effects.friction.pivot_coulomb / (rig.load_mass * rig.gravity * rope)


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

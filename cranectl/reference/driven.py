"""Filter velocity commands of a joystick into a motion of the load that is always C⁴.

On each axis the velocity command v passes four equal lags and an integrator:

    lag_1' = omega (v - lag_1)    lag_2' = omega (lag_1 - lag_2)    …    z' = lag_4

So z'''' = omega³ (lag_1 - 3 lag_2 + 3 lag_3 - lag_4) is continuous. If the command becomes zero now, the load
comes to rest at the stopping point

    stop = z + (lag_1 + lag_2 + lag_3 + lag_4) / omega

Its rate is stop' = v, and z is stop filtered by the four lags: a weighted mean of past stopping points. So z
stays in any box that contains all stopping points. A command that would move the stopping point out of the
box is reduced.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from cranectl.reference.time_laws import SAMPLE_TOLERANCE
from cranectl.support import Array, jit

STATES = 5  # of an axis: z, lag_1 … lag_4
COMMAND_SIZE = 4  # numbers of a command: 1 for a point or 0 for a velocity, then its x, y, z


class HandLimits(NamedTuple):
    """Speed of the filter, and the box that contains all stopping points."""

    bandwidth: float  # omega [rad/s]
    speed: Array  # (3,) largest velocity command on each axis [m/s]
    low: Array  # (3,) corner of the box [m]
    high: Array  # (3,)

    @staticmethod
    def rest_state(point: Array) -> Array:
        """Return the state of a load at rest at `point` (3,): shape (3, STATES)."""
        state = np.zeros((3, STATES))
        state[:, 0] = point
        return state

    @staticmethod
    def commands_at(changes: Sequence[tuple[int, tuple[float, ...]]], samples: NDArray[np.intp]) -> Array:
        """Return the command that holds at each of `samples` (n,), from `changes` in ascending order."""
        first = [-1, *(sample for sample, _ in changes)]
        commands = np.array([(0.0,) * COMMAND_SIZE, *(command for _, command in changes)])
        rows: Array = commands[np.searchsorted(first, samples, side="right") - 1]
        return rows

    def drive(self, period: float, state: Array, commands: Array) -> Array:
        """Advance `state` (3, STATES) in place by one sample for each row of `commands` (n, COMMAND_SIZE).

        Return the states before each command acts: shape (n, 3, STATES).
        """
        states = np.empty((len(commands), 3, STATES))
        _drive(*self, period, transition(self.bandwidth, period), state, commands, states)
        return states

    def stopping_points(self, states: Array) -> Array:
        """Return where loads in `states` (n, 3, STATES) come to rest once released: shape (n, 3) [m]."""
        stop: Array = states[..., 0] + states[..., 1:].sum(axis=-1) / self.bandwidth
        return stop

    def derivatives(self, states: Array) -> Array:
        """Return position and four derivatives of `states` (n, 3, STATES): shape (n, 5, 3)."""
        z, one, two, three, four = np.moveaxis(states, -1, 0)
        omega = self.bandwidth
        rows = np.empty((len(states), 5, 3))
        rows[:, 0], rows[:, 1] = z, four
        rows[:, 2] = omega * (three - four)
        rows[:, 3] = omega**2 * (two - 2.0 * three + four)
        rows[:, 4] = omega**3 * (one - 3.0 * two + 3.0 * three - four)
        return rows


@dataclass(frozen=True)
class DrivenPath:
    """Motion of a load that was driven from rest at `start`, and then released."""

    start: Array  # (3,) [m]
    limits: HandLimits
    period: float  # of the samples at which commands change [s]
    changes: tuple[tuple[int, tuple[float, ...]], ...]  # (first sample, command), in order
    duration: float

    @functools.cached_property
    def _states(self) -> Array:
        """States at all samples, at rest at the last: shape (N + 1, 3, STATES)."""
        samples = round(self.duration / self.period)
        commands = self.limits.commands_at(self.changes, np.arange(samples + 1))
        state = self.limits.rest_state(self.start)
        states = self.limits.drive(self.period, state, commands)
        # The lags still have some 1e-13 of the last command, but a reference must rest exactly.
        states[-1] = self.limits.rest_state(self.limits.stopping_points(states[-1:])[0])
        return states

    def sample(self, time: Array) -> Array:
        """Return position and four derivatives, exact to rounding at samples and between them."""
        index = np.floor((np.asarray(time) + SAMPLE_TOLERANCE) / self.period).astype(int)
        index = index.clip(0, len(self._states) - 1)
        states = self._states[index]
        for k in np.flatnonzero(time - index * self.period > SAMPLE_TOLERANCE):
            states[k] = self._between(index[k], float(time[k] - index[k] * self.period))
        return self.limits.derivatives(states)

    def _between(self, sample: int, seconds: float) -> Array:
        commands = self.limits.commands_at(self.changes, np.array([sample]))
        state = self._states[sample].copy()
        velocity = np.empty(3)
        _limit_velocities(*self.limits, self.period, state, commands[0], velocity)
        next_state: Array = np.column_stack([state, velocity]) @ transition(self.limits.bandwidth, seconds).T
        return next_state


@functools.lru_cache(maxsize=8)
def transition(bandwidth: float, seconds: float) -> Array:
    """Return the exact matrix from an axis's (state, constant velocity command) to its next state.

    Its shape is (STATES, STATES + 1).
    """
    chain = np.zeros((STATES + 1, STATES + 1))
    chain[0, 4] = 1.0
    for lag in range(1, STATES):
        chain[lag, lag] = -bandwidth
        chain[lag, lag - 1 if lag > 1 else STATES] = bandwidth
    matrix: Array = expm(seconds * chain)[:STATES]
    return matrix


@jit
def _drive(
    bandwidth: float,
    speed: Array,
    low: Array,
    high: Array,
    period: float,
    transitions: Array,
    state: Array,
    commands: Array,
    states: Array,
) -> None:
    velocity, new = np.empty(3), np.empty(STATES)
    for k in range(commands.shape[0]):
        states[k] = state
        _limit_velocities(bandwidth, speed, low, high, period, state, commands[k], velocity)
        for axis in range(3):
            for i in range(STATES):
                new[i] = transitions[i, STATES] * velocity[axis]
                for j in range(STATES):
                    new[i] += transitions[i, j] * state[axis, j]
            state[axis] = new


@jit
def _limit_velocities(
    bandwidth: float,
    speed: Array,
    low: Array,
    high: Array,
    period: float,
    state: Array,
    command: Array,
    velocity: Array,
) -> None:
    """Write the velocities for the next period into `velocity`, reduced so that stop stays in the box.

    Towards a commanded point stop moves straight, at the pace of the slowest axis, and arrives on a sample.
    """
    duration = period
    for axis in range(3):
        stop = _stop(bandwidth, state[axis])
        duration = max(duration, abs(command[1 + axis] - stop) / speed[axis])
    for axis in range(3):
        stop = _stop(bandwidth, state[axis])
        commanded = (command[1 + axis] - stop) / duration if command[0] > 0.0 else command[1 + axis]
        velocity[axis] = min(max(commanded, (low[axis] - stop) / period), (high[axis] - stop) / period)


@jit
def _stop(bandwidth: float, axis: Array) -> float:
    stop: float = axis[0] + (axis[1] + axis[2] + axis[3] + axis[4]) / bandwidth
    return stop

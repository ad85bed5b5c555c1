"""What a hand asks of the load, made a motion that is C⁴ whatever is asked, and when.

The wish, a velocity, passes four equal lags and an integral, on each axis

    lag_1' = omega (wish - lag_1)    lag_2' = omega (lag_1 - lag_2)    …    z' = lag_4

so z'''' = omega³ (lag_1 - 3 lag_2 + 3 lag_3 - lag_4) is continuous. Released now, the load comes to rest at

    stop = z + (lag_1 + lag_2 + lag_3 + lag_4) / omega

Since stop' = wish and z is stop behind the four lags, a mean of where stop has been, z never leaves a box in
which stop is kept; and it is kept there by cutting the wish of the sample that would lead out of it.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from cranectl.support.arrays import Array
from cranectl.support.jit import jit

STATES = 5  # of an axis: z, lag_1 … lag_4
ASKED = 4  # columns of what is asked at a sample: 1 for a point or 0 for a velocity, and x, y, z of it
SAME_SAMPLE = 1e-9  # [s] of a sample is the sample


class HandLimits(NamedTuple):
    """How fast the filter is, and within what it keeps the load."""

    bandwidth: float  # omega [rad/s]
    speed: Array  # (3,) the largest wish on each axis [m/s]
    low: Array  # (3,) corner of the box for stop [m]
    high: Array  # (3,)


@dataclass(frozen=True)
class DrivenPath:
    """A load that was driven from rest at `start`, and then released."""

    start: Array  # (3,) [m]
    limits: HandLimits
    period: float  # of the samples at which wishes change [s]
    changes: tuple[tuple[int, tuple[float, ...]], ...]  # from which sample on what was asked, ASKED numbers
    duration: float

    @functools.cached_property
    def _states(self) -> Array:
        """At every sample, at rest at the last: shape (N + 1, 3, STATES)."""
        samples = round(self.duration / self.period)
        requests = asked_at(self.changes, np.arange(samples + 1))
        state = at_rest(self.start)
        states = drive(self.limits, self.period, state, requests)
        states[-1] = at_rest(stop_of(self.limits, states[-1:])[0])
        return states

    def sample(self, time: Array) -> Array:
        """Sample the path; exactly what was driven at the samples, and as exact between them."""
        index = np.floor((np.asarray(time) + SAME_SAMPLE) / self.period).astype(int)
        index = index.clip(0, len(self._states) - 1)
        states = self._states[index]
        for k in np.flatnonzero(time - index * self.period > SAME_SAMPLE):
            states[k] = self._between(index[k], float(time[k] - index[k] * self.period))
        return derivatives(self.limits, states)

    def _between(self, sample: int, seconds: float) -> Array:
        requests = asked_at(self.changes, np.array([sample]))
        state = self._states[sample].copy()
        velocity = np.empty(3)
        _heed(*self.limits, self.period, state, requests[0], velocity)
        moved: Array = np.column_stack([state, velocity]) @ transition(self.limits.bandwidth, seconds).T
        return moved


def at_rest(point: Array) -> Array:
    """Return the state of a load at rest at `point` (3,): shape (3, STATES)."""
    state = np.zeros((3, STATES))
    state[:, 0] = point
    return state


def asked_at(changes: Sequence[tuple[int, tuple[float, ...]]], samples: NDArray[np.intp]) -> Array:
    """Return the command at `samples` (n,), where `changes` hold from their sample on, in order."""
    first = [-1, *(sample for sample, _ in changes)]
    requests = np.array([(0.0,) * ASKED, *(command for _, command in changes)])
    rows: Array = requests[np.searchsorted(first, samples, side="right") - 1]
    return rows


def drive(limits: HandLimits, period: float, state: Array, requests: Array) -> Array:
    """Move `state` (3, STATES) on by a sample for each row of `requests` (n, ASKED).

    Returns the states at those samples, before what is asked there acts: shape (n, 3, STATES).
    """
    states = np.empty((len(requests), 3, STATES))
    _drive(*limits, period, transition(limits.bandwidth, period), state, requests, states)
    return states


@functools.lru_cache(maxsize=8)
def transition(bandwidth: float, seconds: float) -> Array:
    """Return the next state from (state, held wish) of an axis, exactly: shape (STATES, STATES + 1)."""
    chain = np.zeros((STATES + 1, STATES + 1))
    chain[0, 4] = 1.0
    for lag in range(1, STATES):
        chain[lag, lag] = -bandwidth
        chain[lag, lag - 1 if lag > 1 else STATES] = bandwidth
    moves: Array = expm(seconds * chain)[:STATES]
    return moves


def stop_of(limits: HandLimits, states: Array) -> Array:
    """Return where loads in `states` (n, 3, STATES) come to rest if they are released: shape (n, 3)."""
    stop: Array = states[..., 0] + states[..., 1:].sum(axis=-1) / limits.bandwidth
    return stop


def derivatives(limits: HandLimits, states: Array) -> Array:
    """Return position and four derivatives of `states` (n, 3, STATES): shape (n, 5, 3)."""
    z, one, two, three, four = np.moveaxis(states, -1, 0)
    omega = limits.bandwidth
    rows = np.empty((len(states), 5, 3))
    rows[:, 0], rows[:, 1] = z, four
    rows[:, 2] = omega * (three - four)
    rows[:, 3] = omega**2 * (two - 2.0 * three + four)
    rows[:, 4] = omega**3 * (one - 3.0 * two + 3.0 * three - four)
    return rows


@jit
def _drive(
    bandwidth: float,
    speed: Array,
    low: Array,
    high: Array,
    period: float,
    moves: Array,
    state: Array,
    requests: Array,
    states: Array,
) -> None:
    velocity, new = np.empty(3), np.empty(STATES)
    for k in range(requests.shape[0]):
        states[k] = state
        _heed(bandwidth, speed, low, high, period, state, requests[k], velocity)
        for axis in range(3):
            for i in range(STATES):
                new[i] = moves[i, STATES] * velocity[axis]
                for j in range(STATES):
                    new[i] += moves[i, j] * state[axis, j]
            state[axis] = new


@jit
def _heed(
    bandwidth: float,
    speed: Array,
    low: Array,
    high: Array,
    period: float,
    state: Array,
    requests: Array,
    velocity: Array,
) -> None:
    """Write the velocities for the next period into `velocity`: as asked, but no further than the box.

    To a point stop goes straight, as fast as the slowest axis lets it, and arrives within a sample.
    """
    left = period
    for axis in range(3):
        stop = _stop(bandwidth, state[axis])
        left = max(left, abs(requests[1 + axis] - stop) / speed[axis])
    for axis in range(3):
        stop = _stop(bandwidth, state[axis])
        wanted = (requests[1 + axis] - stop) / left if requests[0] > 0.0 else requests[1 + axis]
        velocity[axis] = min(max(wanted, (low[axis] - stop) / period), (high[axis] - stop) / period)


@jit
def _stop(bandwidth: float, axis: Array) -> float:
    way: float = axis[0] + (axis[1] + axis[2] + axis[3] + axis[4]) / bandwidth
    return way

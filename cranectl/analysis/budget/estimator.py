"""Measured state as an error of what the tracker is told: what the observer makes of positions alone.

Deterministic errors come from the observer itself, run beside a predicted trajectory instead of in the loop.
Noise goes through the observer's linear error equations, one joint at a time,

    told = (I - g c) eps + g n        eps' = Phi told        told = (q, q', d) estimated minus true

with the gains g, c = (1, 0, 0) and the free motion Phi over one period; what the joints' accelerations share
through the equations of motion is slow against the observer and left out.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.trajectory_loop import TrajectoryLoop, loop_matrix
from cranectl.effects.sensing import Encoders, read_encoder
from cranectl.jit import jit
from cranectl.observer import JOINTS, POSITION, VELOCITY, Observer, correct, initial_estimate, predict

Array = NDArray[np.float64]

STATES = 3  # of the estimator of one joint
TINY = 1e-60


class Estimator(NamedTuple):
    """Linear error equations of the estimator of one joint, the same for all joints.

    Any estimator fits that has three states per joint of which the first two are told.
    """

    told_by_state: Array  # (2, 3) error of position and velocity told, by the state before the measurement
    told_by_noise: Array  # (2,)
    next_by_state: Array  # (3, 3)
    next_by_noise: Array  # (3,)


def linear_estimator(observer: Observer) -> Estimator:
    """The error equations of `cranectl.observer`."""
    period = observer.period
    gain = np.array([observer.position_gain, observer.velocity_gain, observer.disturbance_gain])
    corrected = np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])
    motion = np.array([[1.0, period, 0.5 * period**2], [0.0, 1.0, period], [0.0, 0.0, 1.0]])
    return Estimator(corrected[:2].copy(), gain[:2].copy(), motion @ corrected, motion @ gain)


def observed_error(observer: Observer, encoders: Encoders, states: Array, commands: Array) -> Array:
    """Told minus true joints (N, 10) along true `states` (N, 10) under `commands` (N - 1, 3) [m/s²]."""
    error = np.zeros_like(states)
    observe_along(
        observer, encoders, np.ascontiguousarray(states), commands, initial_estimate(states[0]), error
    )
    return error


@jit
def observe_along(observer, encoders, states, commands, estimate, error):
    """See `observed_error`; `estimate` is the observer's memory."""
    for k in range(len(states)):
        for joint in range(JOINTS):
            reading = read_encoder(encoders, k, joint, states[k, 2 * joint])
            correct(observer, joint, reading, estimate)
            error[k, 2 * joint] = estimate[POSITION + joint] - states[k, 2 * joint]
            error[k, 2 * joint + 1] = estimate[VELOCITY + joint] - states[k, 2 * joint + 1]
        if k < len(commands):
            predict(observer, commands[k], estimate)


def load_variance(loop: TrajectoryLoop, estimator: Estimator, deviations: Array) -> Array:
    """Variance of the load position (N, 3) [m²] under white noise of standard `deviations` (5,)."""
    variance = np.zeros((loop.virtual.shape[0], 3))
    propagate_variance(loop, estimator, np.square(deviations), variance)
    return variance


@jit
def joined_matrices(loop, estimator, k, matrix, noise):
    """State (loop, estimators) and noise (5) at sample k to the state at k + 1."""
    size, p = loop.virtual.shape[2], loop.kept.shape[0]
    matrix[:], noise[:] = 0.0, 0.0
    loop_matrix(loop, k, matrix[:size, :size])
    for joint in range(JOINTS):
        first = size + STATES * joint
        for i in range(size):
            for j in range(2):
                column = 2 * joint + j
                # What the loop makes of a joint less what the plant itself does is the tracker's part.
                by_told = matrix[i, column] - (loop.by_state[k // loop.stride, i, column] if i < p else 0.0)
                noise[i, joint] += by_told * estimator.told_by_noise[j]
                for s in range(STATES):
                    matrix[i, first + s] += by_told * estimator.told_by_state[j, s]
        for i in range(STATES):
            noise[first + i, joint] = estimator.next_by_noise[i]
            for s in range(STATES):
                matrix[first + i, first + s] = estimator.next_by_state[i, s]


@jit
def propagate_variance(loop, estimator, noise_variance, variance):
    """Variance of the load under noise; from rest, the estimator included."""
    size = loop.virtual.shape[2]
    total = size + STATES * JOINTS
    covariance, matrix, noise = np.zeros((total, total)), np.zeros((total, total)), np.zeros((total, JOINTS))
    for k in range(variance.shape[0]):
        for axis in range(3):
            row = loop.load[k, axis]
            for i in range(len(row)):
                for j in range(len(row)):
                    variance[k, axis] += row[i] * covariance[i, j] * row[j]
        if k == variance.shape[0] - 1:
            return
        joined_matrices(loop, estimator, k, matrix, noise)
        covariance = np.dot(np.dot(matrix, covariance), matrix.T)
        for i in range(total):
            for j in range(total):
                for joint in range(JOINTS):
                    covariance[i, j] += noise[i, joint] * noise_variance[joint] * noise[j, joint]
        flush(covariance)


def worst_load_error(loop: TrajectoryLoop, estimator: Estimator, amplitudes: Array, times: int = 24) -> Array:
    """Largest load error (3,) [m] under any position errors of at most `amplitudes` (5,).

    The L1 norm of the time-varying impulse response, at `times` instants spread over the run, by one backward
    sweep of the adjoint.
    """
    samples = loop.virtual.shape[0]
    instants = np.unique(np.linspace(0, samples - 1, times + 1)[1:].astype(np.intp))
    worst = np.zeros((len(instants), 3))
    sweep_adjoint(loop, estimator, np.asarray(amplitudes, dtype=np.float64), instants, worst)
    largest: Array = worst.max(axis=0)
    return largest


@jit
def flush(matrix):
    """Forget what has decayed to nothing: processors are slow with the smallest of numbers."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            if abs(matrix[i, j]) < TINY:
                matrix[i, j] = 0.0


@jit
def sweep_adjoint(loop, estimator, amplitudes, instants, worst):
    """Adds up |impulse response| times amplitude for each instant and axis, into `worst`."""
    size = loop.virtual.shape[2]
    total = size + STATES * JOINTS
    rows = np.zeros((3 * len(instants), total))
    matrix, noise = np.zeros((total, total)), np.zeros((total, JOINTS))
    begun = len(instants)
    for k in range(loop.virtual.shape[0] - 2, -1, -1):
        while begun > 0 and instants[begun - 1] == k + 1:
            begun -= 1
            for axis in range(3):
                rows[3 * begun + axis, : loop.kept.shape[0]] = loop.load[k + 1, axis]
        joined_matrices(loop, estimator, k, matrix, noise)
        active = rows[3 * begun :]
        response = np.dot(active, noise)
        for i in range(len(active)):
            for joint in range(JOINTS):
                worst[begun + i // 3, i % 3] += abs(response[i, joint]) * amplitudes[joint]
        rows[3 * begun :] = np.dot(active, matrix)
        flush(rows[3 * begun :])

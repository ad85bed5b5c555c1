"""Signals of which only variance or limits are known: noise and steps of the encoders, friction.

What the observer makes of positions alone is an error of the measured state. Its deterministic part comes
from the observer itself, run beside a predicted trajectory instead of in the loop. Noise goes through the
observer's linear error equations, one joint at a time,

    error = (I - g c) eps + g n       eps' = Phi error       error = (q, q', d) estimated minus true

with the gains g, c = (1, 0, 0) and the free motion Phi over one period; what the joints' accelerations share
through the equations of motion is slow against the observer and left out.
"""

from typing import NamedTuple

import numpy as np

from cranectl.analysis.budget.propagation import Deviation, FrictionPort
from cranectl.analysis.budget.trajectory_loop import EXTENSION, ROBUSTIFIER, TrajectoryLoop
from cranectl.controllers.observer import EXPECTED, JOINTS, Observer, correct, initial_estimate, predict
from cranectl.simulate.signal_path import Encoders, read_encoder
from cranectl.support.arrays import Array
from cranectl.support.jit import jit

STATES = 3  # of the estimator of one joint
TINY = 1e-60
ENCODER_INSTANTS, FRICTION_INSTANTS = 24, 16  # spread over the run, at which the load error is bounded


class Estimator(NamedTuple):
    """Linear error equations of the estimator of one joint, the same for all joints.

    Any estimator fits that has three states per joint of which the tracker gets the first two.
    """

    output_by_state: Array  # (2, 3) error of position and velocity, by the state before the measurement
    output_by_noise: Array  # (2,)
    next_by_state: Array  # (3, 3)
    next_by_noise: Array  # (3,)


def linear_estimator(observer: Observer) -> Estimator:
    """The error equations of `cranectl.controllers.observer`."""
    period = observer.period
    gain = np.array([observer.position_gain, observer.velocity_gain, observer.disturbance_gain])
    corrected = np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])
    motion = np.array([[1.0, period, 0.5 * period**2], [0.0, 1.0, period], [0.0, 0.0, 1.0]])
    return Estimator(corrected[:2].copy(), gain[:2].copy(), motion @ corrected, motion @ gain)


def observed_error(observer: Observer, encoders: Encoders, states: Array, commands: Array) -> Array:
    """Measured minus true joints (N, 10) along true `states` (N, 10) under `commands` (N - 1, 3) [m/s²]."""
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
            error[k, 2 * joint] = estimate[EXPECTED.position + joint] - states[k, 2 * joint]
            error[k, 2 * joint + 1] = estimate[EXPECTED.velocity + joint] - states[k, 2 * joint + 1]
        if k < len(commands):
            predict(observer, commands[k], estimate)


def load_variance(loop: TrajectoryLoop, estimator: Estimator, deviations: Array) -> Array:
    """Variance of the load position (N, 3) [m²] under white noise of standard `deviations` (5,)."""
    variance = np.zeros((loop.virtual.shape[0], 3))
    propagate_variance(loop.matrices, estimator, np.square(deviations), variance)
    return variance


@jit
def loop_matrix(loop, delay, k, matrix):
    """X and the commands under way, the youngest first, at sample k + 1 by those at k, into `matrix`.

    `matrix` is (n + 3 `delay`) square.
    """
    size, p, at = loop.virtual.shape[2], loop.kept.shape[0], k // loop.stride
    total = matrix.shape[0]
    arriving = np.zeros(total)
    matrix[:] = 0.0
    controller_rows(loop, k, matrix)
    matrix[:p, :p] = loop.by_state[at]
    for axis in range(3):
        arriving[:] = 0.0
        if delay == 0:
            arriving[:size] = loop.command[k, axis]
        else:
            arriving[total - 3 + axis] = 1.0
            matrix[size + axis, :size] = loop.command[k, axis]
        for late in range(1, delay):
            matrix[size + 3 * late + axis, size + 3 * (late - 1) + axis] = 1.0
        row = p + axis
        for j in range(total):
            matrix[row, j] = loop.period * arriving[j]
        matrix[row, row] += 1.0
        for i in range(p):
            by_command = loop.by_command[at, i, axis]
            matrix[i, row] += by_command * loop.integral
            for j in range(total):
                matrix[i, j] += by_command * loop.lead[axis] * arriving[j]


@jit
def controller_rows(loop, k, matrix):
    """The rows of zeta, zeta' and the robustifier by X at sample k, into `matrix`."""
    period, m, p = loop.period, loop.robustifier_input.shape[0], loop.kept.shape[0]
    extension, robustifier = p + EXTENSION, p + ROBUSTIFIER
    for j in range(loop.virtual.shape[2]):
        matrix[extension, j] = 0.5 * period * period * loop.virtual[k, 2, j]
        matrix[extension + 1, j] = period * loop.virtual[k, 2, j]
    matrix[extension, extension] += 1.0
    matrix[extension, extension + 1] += period
    matrix[extension + 1, extension + 1] += 1.0
    for axis in range(3):
        first = robustifier + axis * m
        for i in range(m):
            for j in range(10):
                matrix[first + i, j] = -loop.robustifier_input[i] * loop.flat[k, axis, j]
            for j in range(m):
                matrix[first + i, first + j] = loop.robustifier_state[i, j]


@jit
def joined_matrices(loop, estimator, k, matrix, noise):
    """State (loop, estimators) and noise (5) at sample k to the state at k + 1."""
    size, p = loop.virtual.shape[2], loop.kept.shape[0]
    matrix[:], noise[:] = 0.0, 0.0
    loop_matrix(loop, 0, k, matrix[:size, :size])
    for joint in range(JOINTS):
        first = size + STATES * joint
        for i in range(size):
            for j in range(2):
                column = 2 * joint + j
                # What the loop makes of a joint less what the plant itself does is the tracker's part.
                by_measured = matrix[i, column] - (
                    loop.by_state[k // loop.stride, i, column] if i < p else 0.0
                )
                noise[i, joint] += by_measured * estimator.output_by_noise[j]
                for s in range(STATES):
                    matrix[i, first + s] += by_measured * estimator.output_by_state[j, s]
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


@jit
def flush(matrix):
    """Forget what has decayed to nothing: processors are slow with the smallest of numbers."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            if abs(matrix[i, j]) < TINY:
                matrix[i, j] = 0.0


def worst_case(
    loop: TrajectoryLoop, amplitudes: Array, times: int, *, estimator: Estimator | None = None, delay: int = 0
) -> Array:
    """Largest load error (times, 3) [m] under any five signals within `amplitudes` (N - 1, 5), by axis.

    The signals are errors of the measured positions, through `estimator`, or without one those at the ports
    of friction. The L1 norm of the time-varying impulse response, at `times` instants spread over the run, by
    one backward sweep of the adjoint.
    """
    instants = np.unique(np.linspace(0, loop.samples - 1, times + 1)[1:].astype(np.intp))
    worst = np.zeros((len(instants), 3))
    sweep_back(loop.matrices, estimator, delay, np.ascontiguousarray(amplitudes), instants, worst)
    return worst


@jit
def sweep_back(loop, estimator, delay, amplitudes, instants, worst):
    """Adds up |impulse response| times amplitude for each instant and axis, into `worst`."""
    p = loop.kept.shape[0]
    total = loop.virtual.shape[2] + (3 * delay if estimator is None else STATES * JOINTS)
    rows, matrix, inputs = (
        np.zeros((3 * len(instants), total)),
        np.zeros((total, total)),
        np.zeros((total, 5)),
    )
    begun = len(instants)
    for k in range(loop.virtual.shape[0] - 2, -1, -1):
        while begun > 0 and instants[begun - 1] == k + 1:
            begun -= 1
            for axis in range(3):
                rows[3 * begun + axis, :p] = loop.load[k + 1, axis]
        if estimator is None:
            at = k // loop.stride
            loop_matrix(loop, delay, k, matrix)
            inputs[:p, :3], inputs[:p, 3:] = loop.by_command[at], loop.by_disturbance[at]
        else:
            joined_matrices(loop, estimator, k, matrix, inputs)
        active = rows[3 * begun :]
        response = np.dot(active, inputs)
        for i in range(len(active)):
            for port in range(5):
                worst[begun + i // 3, i % 3] += abs(response[i, port]) * amplitudes[k, port]
        rows[3 * begun :] = np.dot(active, matrix)
        flush(rows[3 * begun :])


def worst_friction(loop: TrajectoryLoop, friction: FrictionPort, about: Deviation, delay: int) -> float:
    """Largest load error [m] under any course of friction, at rates like those of the motion `about`.

    Friction at rest is any force up to Coulomb's, and a moving axis has it against its motion: a signal
    within known limits, however it sticks and slips.
    """
    rates = np.abs(friction.rates + about.state[:, 1:10:2])[:-1]
    worst = worst_case(loop, friction.coulomb + friction.viscous * rates, FRICTION_INSTANTS, delay=delay)
    return float(np.linalg.norm(worst, axis=1).max(initial=0.0))

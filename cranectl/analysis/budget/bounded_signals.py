"""Propagate signals with known variance or limits only: noise and quantisation of encoders, friction.

The observer estimates the state from positions, so the measured state has an error. The observer itself, run
along a predicted trajectory outside the loop, gives the deterministic part of this error. Noise passes the
observer's linear error equations, one joint at a time,

    error = (I - g c) eps + g n       eps' = Phi error       error = (q, q', d) estimated minus true

with the gains g, c = (1, 0, 0) and the transition matrix Phi of one period. The coupling of the joints
through the equations of motion is left out, because it is slow compared with the observer.
"""

from typing import NamedTuple

import numpy as np

from cranectl.analysis.budget.propagation import Deviation, FrictionPort
from cranectl.analysis.budget.trajectory_loop import EXTENSION, TrajectoryLoop
from cranectl.controllers.observer import EXPECTED, JOINTS, Observer, correct, initial_estimate, predict
from cranectl.simulate.signal_path import Encoders, read_encoder
from cranectl.support.arrays import Array
from cranectl.support.jit import jit_called

STATES = 3  # of the estimator of one joint
NEGLIGIBLE = 1e-60
ENCODER_INSTANTS, FRICTION_INSTANTS = 24, 16  # number of times, spread over the run, with a bound


class Estimator(NamedTuple):
    """Linear error equations of the estimator of one joint, the same for all joints.

    They suit any estimator with three states per joint of which the tracker gets the first two.
    """

    output_by_state: Array  # (2, 3) error of position and velocity, by the state before the measurement
    output_by_noise: Array  # (2,)
    next_by_state: Array  # (3, 3)
    next_by_noise: Array  # (3,)


def linear_estimator(observer: Observer) -> Estimator:
    """Return the error equations of `cranectl.controllers.observer`."""
    period = observer.period
    gain = np.array([observer.position_gain, observer.velocity_gain, observer.disturbance_gain])
    corrected = np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])
    motion = np.array([[1.0, period, 0.5 * period**2], [0.0, 1.0, period], [0.0, 0.0, 1.0]])
    return Estimator(corrected[:2].copy(), gain[:2].copy(), motion @ corrected, motion @ gain)


def observed_error(observer: Observer, encoders: Encoders, states: Array, commands: Array) -> Array:
    """Return measured minus true joints (N, 10) along `states` (N, 10), `commands` (N - 1, 3) [m/s²]."""
    error = np.zeros_like(states)
    observe_along(
        observer, encoders, np.ascontiguousarray(states), commands, initial_estimate(states[0]), error
    )
    return error


@jit_called
def observe_along(observer, encoders, states, commands, estimate, error):
    """Run the observer along a motion for `observed_error`; `estimate` is its memory."""
    for k in range(len(states)):
        for joint in range(JOINTS):
            reading = read_encoder(encoders, k, joint, states[k, 2 * joint])
            correct(observer, joint, reading, estimate)
            error[k, 2 * joint] = estimate[EXPECTED.position + joint] - states[k, 2 * joint]
            error[k, 2 * joint + 1] = estimate[EXPECTED.velocity + joint] - states[k, 2 * joint + 1]
        if k < len(commands):
            predict(observer, commands[k], estimate)


def load_variance(loop: TrajectoryLoop, estimator: Estimator, deviations: Array) -> Array:
    """Return the variance of the load's position (N, 3) [m²] under white noise, `deviations` (5,)."""
    variance = np.zeros((loop.samples, 3))
    propagate_variance(loop.matrices, estimator, np.square(deviations), variance)
    return variance


@jit_called
def write_loop_matrix(loop, k, matrix):
    """Write the transition matrix of state and delayed commands from sample k to k + 1 into `matrix`.

    `matrix` is square with n + 3 times the delay rows.
    """
    size, p, at, total = loop.outputs.shape[2], loop.moving.shape[0], k // loop.stride, len(matrix)
    controller, arriving = p + EXTENSION, np.zeros((3, total))
    matrix[:] = 0.0
    for row in range(size, total):
        matrix[row, row - 3] = 1.0
    if loop.delay:
        arriving[:, total - 3 :] = np.eye(3)
        matrix[size : size + 3] = 0.0
        matrix[size : size + 3, :size] = loop.outputs[k, 3:6]
    else:
        arriving[:, :size] = loop.outputs[k, 3:6]
    matrix[:p] = np.dot(loop.by_command[at] * loop.lead, arriving)
    matrix[:p, :p] += loop.by_state[at]
    matrix[:p, p:controller] += loop.integral * loop.by_command[at]
    matrix[p:controller] = loop.period * arriving
    matrix[p:controller, p:controller] += np.eye(3)
    matrix[controller:size, :size] = np.dot(loop.controller_input, loop.outputs[k])
    matrix[controller:size, controller:size] += loop.controller_state


@jit_called
def write_joined_matrices(loop, estimator, k, matrix, noise):
    """Write the matrices from state (loop, estimators) and noise (5) at sample k to the state at k + 1.

    The loop must have no delay.
    """
    size, p = loop.outputs.shape[2], loop.moving.shape[0]
    matrix[:], noise[:] = 0.0, 0.0
    write_loop_matrix(loop, k, matrix[:size, :size])
    # The effect of a joint through the tracker is that in the loop minus that in the plant alone.
    by_measured = matrix[:size, :10].copy()
    by_measured[:p] -= loop.by_state[k // loop.stride, :, :10]
    for joint in range(JOINTS):
        own, by_joint = size + STATES * joint, by_measured[:, 2 * joint : 2 * joint + 2].copy()
        noise[:size, joint] = np.dot(by_joint, estimator.output_by_noise)
        noise[own : own + STATES, joint] = estimator.next_by_noise
        matrix[:size, own : own + STATES] = np.dot(by_joint, estimator.output_by_state)
        matrix[own : own + STATES, own : own + STATES] = estimator.next_by_state


@jit_called
def propagate_variance(loop, estimator, noise_variance, variance):
    """Compute the variance of the load under noise with loop and estimator, from zero at the start."""
    p, total = loop.moving.shape[0], loop.outputs.shape[2] + STATES * JOINTS
    covariance, matrix, noise = np.zeros((total, total)), np.zeros((total, total)), np.zeros((total, JOINTS))
    for k in range(len(variance)):
        load = loop.load[k]
        variance[k] = (np.dot(load, covariance[:p, :p].copy()) * load).sum(axis=1)
        if k < len(variance) - 1:
            write_joined_matrices(loop, estimator, k, matrix, noise)
            covariance = np.dot(np.dot(matrix, covariance), matrix.T)
            covariance = flush_small(covariance + np.dot(noise * noise_variance, noise.T))


@jit_called
def flush_small(matrix):
    """Set negligible numbers to zero, because processors are slow with denormal numbers."""
    return np.where(np.abs(matrix) < NEGLIGIBLE, 0.0, matrix)


def worst_load_error(
    loop: TrajectoryLoop, amplitudes: Array, times: int, *, estimator: Estimator | None = None
) -> Array:
    """Return the largest load error (times, 3) [m] for any five signals within `amplitudes` (N - 1, 5).

    With an `estimator`, the signals are errors of the measured positions; without one, they act where
    friction does. The result is the L1 norm of the time-varying impulse response at `times` instants spread
    over the run. One backward sweep of the adjoint equations computes it.
    """
    instants = np.unique(np.linspace(0, loop.samples - 1, times + 1)[1:].astype(np.intp))
    worst = np.zeros((len(instants), 3))
    sweep_adjoint(loop.matrices, estimator, np.ascontiguousarray(amplitudes), instants, worst)
    return worst


@jit_called
def sweep_adjoint(loop, estimator, amplitudes, instants, worst):
    """Sum |impulse response| times amplitude over the run for each instant and axis, into `worst`."""
    p = loop.moving.shape[0]
    total = loop.outputs.shape[2] + (3 * loop.delay if estimator is None else STATES * JOINTS)
    rows, matrix, inputs = (
        np.zeros((3 * len(instants), total)),
        np.zeros((total, total)),
        np.zeros((total, 5)),
    )
    begun = len(instants)
    for k in range(len(loop.outputs) - 2, -1, -1):
        while begun > 0 and instants[begun - 1] == k + 1:
            begun -= 1
            rows[3 * begun : 3 * begun + 3, :p] = loop.load[k + 1]
        if estimator is None:
            at = k // loop.stride
            write_loop_matrix(loop, k, matrix)
            inputs[:p, :3], inputs[:p, 3:] = loop.by_command[at], loop.by_disturbance[at]
        else:
            write_joined_matrices(loop, estimator, k, matrix, inputs)
        active = rows[3 * begun :]
        response = np.dot(np.abs(np.dot(active, inputs)), amplitudes[k])
        worst[begun:] += response.reshape((-1, 3))
        rows[3 * begun :] = flush_small(np.dot(active, matrix))


def worst_friction(loop: TrajectoryLoop, friction: FrictionPort, about: Deviation) -> float:
    """Return the largest load error [m] for any friction, with the rates of the motion `about`.

    Whether an axis sticks or slips, friction is a signal within known limits: at rest any force up to
    Coulomb's friction, in motion this force against the motion.
    """
    rates = np.abs(friction.rates + about.state[:, 1:10:2])[:-1]
    worst = worst_load_error(loop, friction.coulomb + friction.viscous * rates, FRICTION_INSTANTS)
    return float(np.linalg.norm(worst, axis=1).max(initial=0.0))

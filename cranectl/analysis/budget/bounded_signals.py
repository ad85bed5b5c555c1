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
from cranectl.analysis.budget.trajectory_loop import EXTENSION, TrajectoryLoop
from cranectl.controllers.observer import EXPECTED, JOINTS, Observer, correct, initial_estimate, predict
from cranectl.simulate.signal_path import Encoders, read_encoder
from cranectl.support.arrays import Array
from cranectl.support.jit import jit_called

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
def loop_matrix(loop, k, matrix):
    """Write into `matrix` how state and delayed commands at sample k + 1 follow from those at k.

    `matrix` is (n + 3 times the delay) square.
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
def joined_matrices(loop, estimator, k, matrix, noise):
    """State (loop, estimators) and noise (5) at sample k to the state at k + 1, of a loop without delay."""
    size, p = loop.outputs.shape[2], loop.moving.shape[0]
    matrix[:], noise[:] = 0.0, 0.0
    loop_matrix(loop, k, matrix[:size, :size])
    # What the loop makes of a joint less what the plant itself does is the tracker's part.
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
    """Compute the variance of the load under noise, from rest, the estimator included."""
    p, total = loop.moving.shape[0], loop.outputs.shape[2] + STATES * JOINTS
    covariance, matrix, noise = np.zeros((total, total)), np.zeros((total, total)), np.zeros((total, JOINTS))
    for k in range(len(variance)):
        load = loop.load[k]
        variance[k] = (np.dot(load, covariance[:p, :p].copy()) * load).sum(axis=1)
        if k < len(variance) - 1:
            joined_matrices(loop, estimator, k, matrix, noise)
            covariance = np.dot(np.dot(matrix, covariance), matrix.T)
            covariance = flushed(covariance + np.dot(noise * noise_variance, noise.T))


@jit_called
def flushed(matrix):
    """Set numbers that have decayed to almost nothing to zero: processors are slow with the smallest ones."""
    return np.where(np.abs(matrix) < TINY, 0.0, matrix)


def worst_case(
    loop: TrajectoryLoop, amplitudes: Array, times: int, *, estimator: Estimator | None = None
) -> Array:
    """Return the largest load error (times, 3) [m] for any five signals in `amplitudes` (N - 1, 5).

    The signals are errors of the measured positions, through `estimator`, or without one those at the ports
    of friction. The L1 norm of the time-varying impulse response, at `times` instants spread over the run, by
    one backward sweep of the adjoint.
    """
    instants = np.unique(np.linspace(0, loop.samples - 1, times + 1)[1:].astype(np.intp))
    worst = np.zeros((len(instants), 3))
    sweep_back(loop.matrices, estimator, np.ascontiguousarray(amplitudes), instants, worst)
    return worst


@jit_called
def sweep_back(loop, estimator, amplitudes, instants, worst):
    """Add up |impulse response| times amplitude for each instant and axis, into `worst`."""
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
            loop_matrix(loop, k, matrix)
            inputs[:p, :3], inputs[:p, 3:] = loop.by_command[at], loop.by_disturbance[at]
        else:
            joined_matrices(loop, estimator, k, matrix, inputs)
        active = rows[3 * begun :]
        response = np.dot(np.abs(np.dot(active, inputs)), amplitudes[k])
        worst[begun:] += response.reshape((-1, 3))
        rows[3 * begun :] = flushed(np.dot(active, matrix))


def worst_friction(loop: TrajectoryLoop, friction: FrictionPort, about: Deviation) -> float:
    """Return the largest load error [m] for any friction, at rates like those of the motion `about`.

    Friction at rest is any force up to Coulomb's, and a moving axis has it against its motion: a signal
    within known limits, however it sticks and slips.
    """
    rates = np.abs(friction.rates + about.state[:, 1:10:2])[:-1]
    worst = worst_case(loop, friction.coulomb + friction.viscous * rates, FRICTION_INSTANTS)
    return float(np.linalg.norm(worst, axis=1).max(initial=0.0))

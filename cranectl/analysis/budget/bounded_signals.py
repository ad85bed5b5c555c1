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
from numpy.typing import NDArray

from cranectl.analysis.budget.propagation import Deviation, FrictionPort
from cranectl.analysis.budget.trajectory_loop import EXTENSION, TrajectoryLoop
from cranectl.controllers import EXPECTED, JOINTS, Observer, correct, initial_estimate, predict
from cranectl.simulate import Encoders, read_encoder
from cranectl.support import Array, jit

STATES = 3  # of the estimator of one joint
NEGLIGIBLE = 1e-60
SAMPLES_AT_A_TIME = 256
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


@jit(inline=False)
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
    """Return the variance of the load's position (N, 3) [m²] under white noise, `deviations` (5,).

    It is zero at the start.
    """
    p, total = len(loop.moving), loop.size + STATES * JOINTS
    variance, covariance = np.zeros((loop.samples, 3)), np.zeros((total, total))
    for samples in _blocks(loop):
        for k, matrix, noise in zip(samples, *joined_matrices(loop, estimator, samples), strict=True):
            by_noise = noise * deviations
            covariance = _flushed(matrix @ covariance @ matrix.T + by_noise @ by_noise.T)
            load = loop.load[k + 1]
            variance[k + 1] = np.sum(load @ covariance[:p, :p] * load, axis=1)
    return variance


def _blocks(loop: TrajectoryLoop) -> list[NDArray[np.intp]]:
    """Return the samples of the loop except the last, in blocks whose matrices fit into the memory."""
    samples = np.arange(loop.samples - 1)
    return [samples[first : first + SAMPLES_AT_A_TIME] for first in range(0, len(samples), SAMPLES_AT_A_TIME)]


def _flushed(matrix: Array) -> Array:
    """Return a matrix without denormal numbers, with which processors are slow."""
    return np.where(np.abs(matrix) < NEGLIGIBLE, 0.0, matrix)


def loop_matrices(loop: TrajectoryLoop, samples: NDArray[np.intp]) -> Array:
    """Return the transition matrices of the state and the delayed commands, from `samples` to the next ones.

    Their shape is (len(samples), m, m), where m is n plus 3 times the delay.
    """
    size, p, at = loop.size, len(loop.moving), samples // loop.stride
    outputs, by_command, total = loop.outputs[samples], loop.by_input[at, :, :3], size + 3 * loop.delay
    matrices, controller = np.zeros((len(samples), total, total)), p + EXTENSION
    arriving = np.zeros((len(samples), 3, total))
    if loop.delay:
        arriving[:, :, total - 3 :] = np.eye(3)
        matrices[:, size : size + 3, :size] = outputs[:, 3:6]
        matrices[:, size + 3 :, size : total - 3] = np.eye(total - 3 - size)
    else:
        arriving[:, :, :size] = outputs[:, 3:6]
    matrices[:, :p] = (by_command * loop.lead) @ arriving
    matrices[:, :p, :p] += loop.by_state[at]
    matrices[:, :p, p:controller] += loop.integral * by_command
    matrices[:, p:controller] = loop.period * arriving
    matrices[:, p:controller, p:controller] += np.eye(3)
    matrices[:, controller:size, :size] = loop.controller_input @ outputs
    matrices[:, controller:size, controller:size] += loop.controller_state
    return matrices


def joined_matrices(
    loop: TrajectoryLoop, estimator: Estimator, samples: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Return the matrices by which state and noise (5) at `samples` give the next state (loop, estimators).

    The loop must have no delay.
    """
    size, p, total = loop.size, len(loop.moving), loop.size + STATES * JOINTS
    matrices, noise = np.zeros((len(samples), total, total)), np.zeros((len(samples), total, JOINTS))
    matrices[:, :size, :size] = loop_matrices(loop, samples)
    # The effect of a joint through the tracker is that in the loop minus that in the plant alone.
    by_measured = matrices[:, :size, :10].copy()
    by_measured[:, :p] -= loop.by_state[samples // loop.stride, :, :10]
    for joint in range(JOINTS):
        own = slice(size + STATES * joint, size + STATES * (joint + 1))
        by_joint = by_measured[:, :, 2 * joint : 2 * joint + 2]
        noise[:, :size, joint] = by_joint @ estimator.output_by_noise
        noise[:, own, joint] = estimator.next_by_noise
        matrices[:, :size, own] = by_joint @ estimator.output_by_state
        matrices[:, own, own] = estimator.next_by_state
    return matrices, noise


def worst_load_error(
    loop: TrajectoryLoop, amplitudes: Array, times: int, *, estimator: Estimator | None = None
) -> Array:
    """Return the largest load error (times, 3) [m] for any five signals within `amplitudes` (N - 1, 5).

    With an `estimator`, the signals are errors of the measured positions; without one, they act where
    friction does. The result is the L1 norm of the time-varying impulse response at `times` instants spread
    over the run. One backward sweep of the adjoint equations computes it.
    """
    p, instants = len(loop.moving), np.unique(np.linspace(0, loop.samples - 1, times + 1)[1:].astype(np.intp))
    total = loop.size + (3 * loop.delay if estimator is None else STATES * JOINTS)
    rows, worst, begun = np.zeros((len(instants), 3, total)), np.zeros((len(instants), 3)), len(instants)
    for samples in reversed(_blocks(loop)):
        if estimator is None:
            matrices, inputs = loop_matrices(loop, samples), np.zeros((len(samples), total, 5))
            inputs[:, :p] = loop.by_input[samples // loop.stride]
        else:
            matrices, inputs = joined_matrices(loop, estimator, samples)
        for k, matrix, by_signal in zip(samples[::-1], matrices[::-1], inputs[::-1], strict=True):
            if begun and instants[begun - 1] == k + 1:
                begun -= 1
                rows[begun, :, :p] = loop.load[k + 1]
            active = rows[begun:].reshape(-1, total)
            worst[begun:] += (np.abs(active @ by_signal) @ amplitudes[k]).reshape(-1, 3)
            rows[begun:] = _flushed(active @ matrix).reshape(-1, 3, total)
    return worst


def worst_friction(loop: TrajectoryLoop, friction: FrictionPort, about: Deviation) -> float:
    """Return the largest load error [m] for any friction, with the rates of the motion `about`.

    Whether an axis sticks or slips, friction is a signal within known limits: at rest any force up to
    Coulomb's friction, in motion this force against the motion.
    """
    rates = np.abs(friction.rates + about.state[:, 1:10:2])[:-1]
    worst = worst_load_error(loop, friction.coulomb + friction.viscous * rates, FRICTION_INSTANTS)
    return float(np.linalg.norm(worst, axis=1).max(initial=0.0))

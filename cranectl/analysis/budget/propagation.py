"""Carry errors through the loop linearised along a run: signals, variances, worst cases."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.trajectory_loop import (
    EXTENSION,
    ROBUSTIFIER,
    TrajectoryLoop,
)
from cranectl.jit import jit

Array = NDArray[np.float64]


class Ports(NamedTuple):
    """Known errors at the ports of a loop of N samples, zero where an effect has none."""

    drive: Array  # (N - 1, 3) realised minus commanded acceleration, mean over the sample [m/s²]
    law: Array  # (N - 1, 3) of the commanded acceleration [m/s²]
    arriving: Array  # (N - 1, 3) of the commanded acceleration as it arrives at the drives [m/s²]
    measured: Array  # (N, 10) told minus true joints
    disturbance: Array  # (N - 1, 2) angular accelerations of alpha, beta [rad/s²]
    local: Array  # (N - 1, n) of X, made within one sample


class DriveOperator(NamedTuple):
    """What the drives make of a deviation of the command: a delay, then a servo.

    With the deviation c of the commanded acceleration, `delay` samples old, and the servo's slip s, which is
    the integral of commanded minus realised acceleration, the realised one is
    by_command c + by_state x + by_slip s. Empty matrices: it is c.
    """

    delay: int
    by_command: Array  # (N - 1, 3, 3) or empty
    by_state: Array  # (N - 1, 3, 10)
    by_slip: Array  # (N - 1, 3, 3)


class Deviation(NamedTuple):
    """A first-order prediction: deviations from the nominal run."""

    state: Array  # (N, n) of X
    realised: Array  # (N - 1, 3) acceleration [m/s²]
    commanded: Array  # (N - 1, 3) acceleration [m/s²]
    load: Array  # (N, 3) position [m]


def no_errors(loop: TrajectoryLoop) -> Ports:
    """Ports at which nothing happens."""
    samples, size = loop.virtual.shape[0], loop.virtual.shape[2]
    rows = max(samples - 1, 0)
    three = (rows, 3)
    return Ports(*(np.zeros(s) for s in (three, three, three, (samples, 10), (rows, 2), (rows, size))))


def ideal_operator(delay: int = 0) -> DriveOperator:
    """Drives that realise the command, `delay` samples late."""
    return DriveOperator(delay, np.zeros((0, 3, 3)), np.zeros((0, 3, 10)), np.zeros((0, 3, 3)))


def propagate(loop: TrajectoryLoop, ports: Ports, operator: DriveOperator | None = None) -> Deviation:
    """The deviation that known errors cause."""
    samples, size = loop.virtual.shape[0], loop.virtual.shape[2]
    state = np.zeros((samples, size))
    realised, commanded = np.zeros((max(samples - 1, 0), 3)), np.zeros((max(samples - 1, 0), 3))
    propagate_signals(loop, ports, operator or ideal_operator(), state, realised, commanded)
    return Deviation(state, realised, commanded, np.einsum("kij,kj->ki", loop.load, state[:, :10]))


@jit
def propagate_signals(loop, ports, operator, state, realised, commanded):
    """See `Deviation`; all three are written."""
    size = state.shape[1]
    m, period = loop.robustifier_input.shape[0], loop.period
    told, slip, arrived = np.zeros(size), np.zeros(3), np.zeros(3)
    line = np.zeros((operator.delay + 1, 3))
    for k in range(state.shape[0] - 1):
        for j in range(size):
            told[j] = state[k, j] + (ports.measured[k, j] if j < 10 else 0.0)
        here, arriving = k % (operator.delay + 1), (k + 1) % (operator.delay + 1)
        v_z = 0.0
        for j in range(size):
            v_z += loop.virtual[k, 2, j] * told[j]
        for axis in range(3):
            command = ports.law[k, axis]
            for j in range(size):
                command += loop.command[k, axis, j] * told[j]
            commanded[k, axis] = command
            line[here, axis] = command
        for axis in range(3):
            arrived[axis] = line[arriving, axis] + ports.arriving[k, axis]
        for axis in range(3):
            acceleration = ports.drive[k, axis]
            if operator.by_command.shape[0] == 0:
                acceleration += arrived[axis]
            else:
                for j in range(3):
                    acceleration += operator.by_command[k, axis, j] * arrived[j]
                    acceleration += operator.by_slip[k, axis, j] * slip[j]
                for j in range(10):
                    acceleration += operator.by_state[k, axis, j] * state[k, j]
            realised[k, axis] = acceleration
        for axis in range(3):
            slip[axis] += period * (arrived[axis] - realised[k, axis])
        for i in range(10):
            value = ports.local[k, i]
            for j in range(10):
                value += loop.plant_state[k, i, j] * state[k, j]
            for j in range(3):
                value += loop.plant_input[k, i, j] * realised[k, j]
            for j in range(2):
                value += loop.plant_disturbance[k, i, j] * ports.disturbance[k, j]
            state[k + 1, i] = value
        zeta, zeta_dot = state[k, EXTENSION], state[k, EXTENSION + 1]
        local = ports.local[k]
        state[k + 1, EXTENSION] = zeta + period * (zeta_dot + 0.5 * period * v_z) + local[EXTENSION]
        state[k + 1, EXTENSION + 1] = zeta_dot + period * v_z + local[EXTENSION + 1]
        for axis in range(3):
            error = 0.0
            for j in range(10):
                error -= loop.load[k, axis, j] * told[j]
            first = ROBUSTIFIER + axis * m
            for i in range(m):
                value = loop.robustifier_input[i] * error + local[first + i]
                for j in range(m):
                    value += loop.robustifier_state[i, j] * state[k, first + j]
                state[k + 1, first + i] = value

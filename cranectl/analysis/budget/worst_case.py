"""The largest load error that signals of known limits can cause, whatever their course: an L1 norm.

Friction at rest is any force up to Coulomb's, and a moving axis has it against its motion: a signal within
known limits, however it sticks and slips. What is told of the motion goes through the loop as it does for
any other deviation.
"""

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.estimator import flush
from cranectl.analysis.budget.propagation import Deviation, Rubbing
from cranectl.analysis.budget.trajectory_loop import TrajectoryLoop, controller_rows, loop_matrix
from cranectl.jit import jit

Array = NDArray[np.float64]

INSTANTS = 16  # spread over the run, at which the load error is bounded


def worst_rubbing(loop: TrajectoryLoop, rubbing: Rubbing, about: Deviation, delay: int) -> float:
    """Largest load error [m] under any course of friction, at rates like those of the motion `about`.

    By one backward sweep of the adjoint from each of INSTANTS, the axes of the load added as a vector.
    """
    last = loop.samples - 1
    instants = np.unique(np.linspace(0, last, INSTANTS + 1)[1:].astype(np.intp))
    worst = np.zeros((len(instants), 3))
    rates = np.abs(rubbing.rates + about.state[:, 1:10:2])[:-1]
    amplitudes = np.ascontiguousarray(rubbing.coulomb + rubbing.viscous * rates)
    sweep_back(loop, delay, amplitudes, instants, worst)
    return float(np.linalg.norm(worst, axis=1).max(initial=0.0))


@jit
def delayed_matrix(loop, delay, k, matrix):
    """X and the commands under way, the youngest first, at sample k + 1 by those at k."""
    if delay == 0:
        loop_matrix(loop, k, matrix)
        return
    size, p, at = loop.virtual.shape[2], loop.kept.shape[0], k // loop.stride
    arriving = size + 3 * (delay - 1)
    matrix[:] = 0.0
    controller_rows(loop, k, matrix[:size, :size])
    matrix[:p, :p] = loop.by_state[at]
    for axis in range(3):
        row = p + axis
        matrix[row, :] = 0.0
        matrix[row, row] = 1.0
        matrix[row, arriving + axis] = loop.period
        matrix[size + axis, :size] = loop.command[k, axis]
        for late in range(1, delay):
            matrix[size + 3 * late + axis, size + 3 * (late - 1) + axis] = 1.0
        for i in range(p):
            by_command = loop.by_command[at, i, axis]
            matrix[i, row] += by_command * loop.integral
            matrix[i, arriving + axis] = by_command * loop.lead[axis]


@jit
def sweep_back(loop, delay, amplitudes, instants, worst):
    """Adds up |impulse response| times amplitude (N - 1, 5) for each instant and axis, into `worst`."""
    size, p = loop.virtual.shape[2], loop.kept.shape[0]
    total = size + 3 * delay
    rows, matrix, ports = np.zeros((3 * len(instants), total)), np.zeros((total, total)), np.zeros((p, 5))
    begun = len(instants)
    for k in range(loop.virtual.shape[0] - 2, -1, -1):
        while begun > 0 and instants[begun - 1] == k + 1:
            begun -= 1
            for axis in range(3):
                rows[3 * begun + axis, :p] = loop.load[k + 1, axis]
        at = k // loop.stride
        for i in range(p):
            for axis in range(3):
                ports[i, axis] = loop.by_command[at, i, axis]
            for angle in range(2):
                ports[i, 3 + angle] = loop.by_disturbance[at, i, angle]
        active = rows[3 * begun :]
        response = np.dot(np.ascontiguousarray(active[:, :p]), ports)
        for i in range(len(active)):
            for port in range(5):
                worst[begun + i // 3, i % 3] += abs(response[i, port]) * amplitudes[k, port]
        delayed_matrix(loop, delay, k, matrix)
        rows[3 * begun :] = np.dot(active, matrix)
        flush(rows[3 * begun :])

"""What the first order leaves out, and the largest error that signals of known limits can cause.

The loop's own equations, evaluated once at every sample of the prediction, do not quite lead to its next
sample. That defect is an error at the ports again; carried through the linear loop it is the second-order
term of the prediction.

Friction at rest is any force up to Coulomb's, and a moving axis has it against its motion: a signal within
known limits, however it sticks and slips. The largest load error that it can cause, whatever its course, is
an L1 norm. What is told of the motion goes through the loop as it does for any other deviation.
"""

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.propagation import Deviation, FrictionPort, Ports, no_errors, propagate
from cranectl.analysis.budget.random_errors import flush
from cranectl.analysis.budget.trajectory_law import EXTENSION, ROBUSTIFIER
from cranectl.analysis.budget.trajectory_loop import TrajectoryLoop, controller_rows, loop_matrix, step_defect
from cranectl.model.flatness import flat_output, linearising_input
from cranectl.simulate import Run, tracker_of
from cranectl.support.jit import jit

Array = NDArray[np.float64]


def second_order(
    run: Run, loop: TrajectoryLoop, ports: Ports, predicted: Deviation, delay: int = 0
) -> Deviation:
    """The second-order term of the deviation `predicted` that errors at `ports` cause."""
    defect, tracker = no_errors(loop), tracker_of(run.scenario, run.design)
    state, controller, inputs, virtual, flat = (
        np.ascontiguousarray(run.block(name))
        for name in ("state", "controller", "input", "virtual_input", "flat_output")
    )
    law_defect(tracker, loop, state, controller, inputs, virtual, flat, ports, predicted, defect)
    p = len(loop.kept)
    states = loop.states.copy()
    states[:, loop.kept] += predicted.state[:, :p]
    made = np.zeros((len(defect.local), p))
    commands, disturbances = loop.commands + predicted.given, loop.disturbances + predicted.disturbance
    step_defect(loop.plant, loop.kept, states, commands, disturbances, loop.winds, states[1:], made)
    defect.local[:, :p] = made + ports.local[:, :p] - loop.defect
    found = propagate(loop, defect, delay)
    return found._replace(load=found.load - loop.load_offset)


def higher_orders(
    run: Run, loop: TrajectoryLoop, ports: Ports, predicted: Deviation, delay: int = 0
) -> tuple[Array, Array]:
    """Second- and third-order terms of the load, each (N, 3) [m], of the deviation `predicted`."""
    second = second_order(run, loop, ports, predicted, delay)
    better = Deviation(*(a + b for a, b in zip(predicted, second, strict=True)))
    return second.load, second_order(run, loop, ports, better, delay).load


@jit
def law_defect(tracker, loop, states, controller, inputs, virtual, flats, ports, predicted, defect):
    """Commands and controller states by the true law at the prediction, less the linear ones."""
    m, period, p = loop.robustifier_input.shape[0], loop.period, loop.kept.shape[0]
    extension, robustifier = p + EXTENSION, p + ROBUSTIFIER
    told, flat, v = np.zeros(12), np.zeros(12), np.zeros(3)
    for k in range(len(defect.law)):
        for i in range(10):
            told[i] = states[k, i] + predicted.state[k, i] + ports.measured[k, i]
        for i in range(2):
            told[10 + i] = controller[k, i] + predicted.state[k, extension + i]
        flat_output(told[:10], told[10], told[11], tracker.gravity, flat)
        for axis in range(3):
            error = 0.0
            for j in range(10):
                error -= loop.flat[k, axis, j] * (predicted.state[k, j] + ports.measured[k, j])
            bent = flats[k, axis] - flat[axis] - error
            first = robustifier + axis * m
            v[axis] = virtual[k, axis] + tracker.feedthrough * (flats[k, axis] - flat[axis])
            for order in range(4):
                place = 3 * order + axis
                v[axis] += tracker.gain[order] * (flats[k, place] - flat[place])
            for i in range(m):
                # The rows of v by X hold the robustifier's output row.
                v[axis] += loop.virtual[k, axis, first + i] * predicted.state[k, first + i]
                defect.local[k, first + i] = loop.robustifier_input[i] * bent
        u = linearising_input(told[:10], told[10], told[11], v[0], v[1], v[2], tracker.gravity)
        for axis in range(3):
            defect.law[k, axis] = u[axis] - inputs[k, axis] - predicted.commanded[k, axis]
        v_z = v[2] - virtual[k, 2]
        for j in range(predicted.state.shape[1]):
            extra = ports.measured[k, j] if j < 10 else 0.0
            v_z -= loop.virtual[k, 2, j] * (predicted.state[k, j] + extra)
        defect.local[k, extension] = 0.5 * period * period * v_z
        defect.local[k, extension + 1] = period * v_z


INSTANTS = 16  # spread over the run, at which the load error is bounded


def worst_friction(loop: TrajectoryLoop, friction: FrictionPort, about: Deviation, delay: int) -> float:
    """Largest load error [m] under any course of friction, at rates like those of the motion `about`.

    By one backward sweep of the adjoint from each of INSTANTS, the axes of the load added as a vector.
    """
    last = loop.samples - 1
    instants = np.unique(np.linspace(0, last, INSTANTS + 1)[1:].astype(np.intp))
    worst = np.zeros((len(instants), 3))
    rates = np.abs(friction.rates + about.state[:, 1:10:2])[:-1]
    amplitudes = np.ascontiguousarray(friction.coulomb + friction.viscous * rates)
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

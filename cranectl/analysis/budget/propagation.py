"""Carry errors through the loop linearised along a run, and find what the first order leaves out.

The loop's own equations, evaluated once at every sample of the prediction, do not quite lead to its next
sample. That defect is an error at the ports again; carried through the linear loop it is the second-order
term of the prediction.
"""

from typing import NamedTuple

import numpy as np

from cranectl.analysis.budget.trajectory_loop import EXTENSION, ROBUSTIFIER, TrajectoryLoop, step_defect
from cranectl.controllers.registry import only_flat
from cranectl.model.flatness import flat_output, linearising_input
from cranectl.simulate import Run, tracker_of
from cranectl.support.arrays import Array
from cranectl.support.jit import jit

STICKING_ROUNDS = 4  # in which axes that stick settle what each has to hold


class Ports(NamedTuple):
    """Known errors at the ports of a loop of N samples, zero where an effect has none."""

    drive: Array  # (N - 1, 3) of what the drives get [m/s²] if they are ideal, else [m/s]
    law: Array  # (N - 1, 3) of the commanded acceleration [m/s²]
    arriving: Array  # (N - 1, 3) of the commanded acceleration as it arrives at the drives [m/s²]
    measured: Array  # (N, 10) measured minus true joints
    disturbance: Array  # (N - 1, 2) angular accelerations of alpha, beta [rad/s²]
    local: Array  # (N - 1, n) of X, made within one sample


class FrictionPort(NamedTuple):
    """Friction of bridge, trolley, winch, alpha and beta, at the ports that the five have in a loop."""

    rates: Array  # (N, 5) nominal [m/s, rad/s]
    viscous: Array  # (N - 1, 5) of `Ports.drive` and `Ports.disturbance` per rate
    coulomb: Array  # (N - 1, 5) largest, sliding or sticking; empty without friction


class Deviation(NamedTuple):
    """A first-order prediction: deviations from the nominal run."""

    state: Array  # (N, n) of X
    given: Array  # (N - 1, 3) to the drives, as `Ports.drive`
    disturbance: Array  # (N - 1, 2) as `Ports.disturbance`
    commanded: Array  # (N - 1, 3) acceleration [m/s²]
    load: Array  # (N, 3) position [m]


def no_errors(loop: TrajectoryLoop) -> Ports:
    """Ports at which nothing happens."""
    rows = max(loop.samples - 1, 0)
    three = (rows, 3)
    return Ports(
        *(np.zeros(s) for s in (three, three, three, (loop.samples, 10), (rows, 2), (rows, loop.size)))
    )


def plant_errors(loop: TrajectoryLoop) -> Ports:
    """That the loop's plant does not obey the nominal run."""
    ports = no_errors(loop)
    ports.local[:, : loop.defect.shape[1]] = loop.defect
    return ports


def no_deviation(loop: TrajectoryLoop) -> Deviation:
    """The nominal run itself."""
    samples = loop.samples
    rows = max(samples - 1, 0)
    shapes = ((samples, loop.size), (rows, 3), (rows, 2), (rows, 3), (samples, 3))
    return Deviation(*(np.zeros(shape) for shape in shapes))


NO_FRICTION = FrictionPort(*(np.zeros((0, 5)) for _ in range(3)))


def propagate(
    loop: TrajectoryLoop, ports: Ports, delay: int = 0, friction: FrictionPort = NO_FRICTION
) -> Deviation:
    """The deviation that known errors and friction cause while commands are `delay` samples under way."""
    deviation = no_deviation(loop)
    propagate_signals(loop.matrices, ports, delay, friction, deviation)
    p = len(loop.kept)
    return deviation._replace(
        load=loop.load_offset + np.einsum("kij,kj->ki", loop.load, deviation.state[:, :p])
    )


@jit
def add_friction(loop, friction, k, deviation, coulomb):
    """Add friction to sample `k` and its effect to the next: Coulomb's stops each rate if it can.

    What one axis takes off another may have to hold, so it goes round (projected Gauss-Seidel).
    """
    for joint in range(5):
        coulomb[joint] = 0.0
        rate = friction.rates[k, joint] + deviation.state[k, 2 * joint + 1]
        add_input(loop, k, joint, -friction.viscous[k, joint] * rate, deviation)
    for _ in range(STICKING_ROUNDS):
        for joint in range(5):
            rate = friction.rates[k + 1, joint] + deviation.state[k + 1, 2 * joint + 1]
            limit, before = friction.coulomb[k, joint], coulomb[joint]
            wanted = before - rate / input_gain(loop, k, joint, 2 * joint + 1)
            coulomb[joint] = min(max(wanted, -limit), limit)
            add_input(loop, k, joint, coulomb[joint] - before, deviation)


@jit
def input_gain(loop, k, joint, state):
    """Of the next plant state `state` by a signal at the port of `joint`."""
    at = k // loop.stride
    return loop.by_command[at, state, joint] if joint < 3 else loop.by_disturbance[at, state, joint - 3]


@jit
def add_input(loop, k, joint, signal, deviation):
    """Add `signal` at the port of `joint` to sample `k`, and its effect to the next."""
    if joint < 3:
        deviation.given[k, joint] += signal
    else:
        deviation.disturbance[k, joint - 3] += signal
    for i in range(loop.kept.shape[0]):
        deviation.state[k + 1, i] += input_gain(loop, k, joint, i) * signal


@jit
def propagate_signals(loop, ports, delay, friction, deviation):
    """Fills `deviation`, all but its load."""
    state, given, commanded = deviation.state, deviation.given, deviation.commanded
    size, p = state.shape[1], loop.kept.shape[0]
    extension, robustifier = p + EXTENSION, p + ROBUSTIFIER
    m, period = loop.robustifier_input.shape[0], loop.period
    measured, arrived, line = np.zeros(size), np.zeros(3), np.zeros((delay + 1, 3))
    coulomb = np.zeros(5)
    for k in range(state.shape[0] - 1):
        at = k // loop.stride
        for j in range(size):
            measured[j] = state[k, j] + (ports.measured[k, j] if j < 10 else 0.0)
        newest, arriving = k % (delay + 1), (k + 1) % (delay + 1)
        v_z = 0.0
        for j in range(size):
            v_z += loop.virtual[k, 2, j] * measured[j]
        for axis in range(3):
            command = ports.law[k, axis]
            for j in range(size):
                command += loop.command[k, axis, j] * measured[j]
            commanded[k, axis] = command
            line[newest, axis] = command
        for axis in range(3):
            arrived[axis] = line[arriving, axis] + ports.arriving[k, axis]
            w = state[k, p + axis]
            given[k, axis] = loop.integral * w + loop.lead[axis] * arrived[axis] + ports.drive[k, axis]
            state[k + 1, p + axis] = w + period * arrived[axis] + ports.local[k, p + axis]
        for i in range(p):
            value = ports.local[k, i]
            for j in range(p):
                value += loop.by_state[at, i, j] * state[k, j]
            for j in range(3):
                value += loop.by_command[at, i, j] * given[k, j]
            for j in range(2):
                value += loop.by_disturbance[at, i, j] * ports.disturbance[k, j]
            state[k + 1, i] = value
        for j in range(2):
            deviation.disturbance[k, j] = ports.disturbance[k, j]
        if friction.coulomb.shape[0] > 0:
            add_friction(loop, friction, k, deviation, coulomb)
        zeta, zeta_dot = state[k, extension], state[k, extension + 1]
        local = ports.local[k]
        state[k + 1, extension] = zeta + period * (zeta_dot + 0.5 * period * v_z) + local[extension]
        state[k + 1, extension + 1] = zeta_dot + period * v_z + local[extension + 1]
        for axis in range(3):
            error = 0.0
            for j in range(10):
                error -= loop.flat[k, axis, j] * measured[j]
            first = robustifier + axis * m
            for i in range(m):
                value = loop.robustifier_input[i] * error + local[first + i]
                for j in range(m):
                    value += loop.robustifier_state[i, j] * state[k, first + j]
                state[k + 1, first + i] = value


def second_order(
    run: Run, loop: TrajectoryLoop, ports: Ports, predicted: Deviation, delay: int = 0
) -> Deviation:
    """The second-order term of the deviation `predicted` that errors at `ports` cause."""
    defect, tracker = no_errors(loop), tracker_of(run.scenario, only_flat(run.design))
    state, controller, inputs, virtual, flat = (
        np.ascontiguousarray(run.block(name))
        for name in ("state", "controller", "input", "virtual_input", "flat_output")
    )
    law_defect(tracker, loop.matrices, state, controller, inputs, virtual, flat, ports, predicted, defect)
    p = len(loop.kept)
    states = loop.states.copy()
    states[:, loop.kept] += predicted.state[:, :p]
    made = np.zeros((len(defect.local), p))
    commands, disturbances = loop.commands + predicted.given, loop.disturbances + predicted.disturbance
    step_defect(loop.plant, loop.kept, states, commands, disturbances, loop.winds, states[1:], made)
    defect.local[:, :p] = made + ports.local[:, :p] - loop.defect
    deviation = propagate(loop, defect, delay)
    return deviation._replace(load=deviation.load - loop.load_offset)


def higher_orders(
    run: Run, loop: TrajectoryLoop, ports: Ports, predicted: Deviation, delay: int = 0
) -> tuple[Deviation, Deviation]:
    """Second- and third-order terms of the deviation `predicted`."""
    second = second_order(run, loop, ports, predicted, delay)
    better = Deviation(*(a + b for a, b in zip(predicted, second, strict=True)))
    return second, second_order(run, loop, ports, better, delay)


@jit
def law_defect(tracker, loop, states, controller, inputs, virtual, flats, ports, predicted, defect):
    """Commands and controller states by the true law at the prediction, less the linear ones."""
    m, period, p = loop.robustifier_input.shape[0], loop.period, loop.kept.shape[0]
    extension, robustifier = p + EXTENSION, p + ROBUSTIFIER
    measured, flat, v = np.zeros(12), np.zeros(12), np.zeros(3)
    for k in range(len(defect.law)):
        for i in range(10):
            measured[i] = states[k, i] + predicted.state[k, i] + ports.measured[k, i]
        for i in range(2):
            measured[10 + i] = controller[k, i] + predicted.state[k, extension + i]
        flat_output(measured[:10], measured[10], measured[11], tracker.gravity, flat)
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
        u = linearising_input(measured[:10], measured[10], measured[11], v[0], v[1], v[2], tracker.gravity)
        for axis in range(3):
            defect.law[k, axis] = u[axis] - inputs[k, axis] - predicted.commanded[k, axis]
        v_z = v[2] - virtual[k, 2]
        for j in range(predicted.state.shape[1]):
            extra = ports.measured[k, j] if j < 10 else 0.0
            v_z -= loop.virtual[k, 2, j] * (predicted.state[k, j] + extra)
        defect.local[k, extension] = 0.5 * period * period * v_z
        defect.local[k, extension + 1] = period * v_z

"""Propagate errors through the loop linearised along a run, and compute the higher-order terms.

The nonlinear equations of the loop, evaluated once at every sample of the prediction, do not lead exactly to
its next sample. This defect is again an error at the ports. Propagated through the linear loop, it gives the
second-order term of the prediction.
"""

from typing import NamedTuple

import numpy as np

from cranectl.analysis.budget.trajectory_loop import (
    EXTENSION,
    ROBUSTIFIER,
    TrajectoryLoop,
    command_outputs,
)
from cranectl.controllers import Tracker
from cranectl.plants import AddressedPlant
from cranectl.simulate import Run
from cranectl.support import Array, jit_called

FRICTION_ITERATIONS = 4  # over the axes, because the friction of one changes the rates of the others


class Ports(NamedTuple):
    """Known errors at the ports of a loop of N samples, zero where an effect has none."""

    drive: Array  # (N - 1, 3) of the commands to the drives [m/s²] if they are ideal, else [m/s]
    command: Array  # (N - 1, 3) of the commanded acceleration [m/s²]
    arriving: Array  # (N - 1, 3) of the commanded acceleration as it arrives at the drives [m/s²]
    measured: Array  # (N, 10) measured minus true joints
    disturbance: Array  # (N - 1, 2) angular accelerations of alpha, beta [rad/s²]
    local: Array  # (N - 1, n) of X, within one sample


class FrictionPort(NamedTuple):
    """Friction of bridge, trolley, winch, alpha and beta, as signals at their ports of a loop."""

    rates: Array  # (N, 5) nominal [m/s, rad/s]
    viscous: Array  # (N - 1, 5) of `Ports.drive` and `Ports.disturbance` per rate
    coulomb: Array  # (N - 1, 5) largest value, slipping or sticking; empty without friction


class Deviation(NamedTuple):
    """A first-order prediction: deviations from the nominal run."""

    state: Array  # (N, n) of X
    drive: Array  # (N - 1, 3) of the commands to the drives, as `Ports.drive`
    disturbance: Array  # (N - 1, 2) as `Ports.disturbance`
    commanded: Array  # (N - 1, 3) acceleration [m/s²]
    load: Array  # (N, 3) position [m]


def no_errors(loop: TrajectoryLoop) -> Ports:
    """Return ports without errors."""
    rows = max(loop.samples - 1, 0)
    three = (rows, 3)
    return Ports(
        *(np.zeros(s) for s in (three, three, three, (loop.samples, 10), (rows, 2), (rows, loop.size)))
    )


def plant_errors(loop: TrajectoryLoop) -> Ports:
    """Return the errors at the ports of a plant whose equations the nominal run does not satisfy."""
    ports = no_errors(loop)
    ports.local[:, : loop.defect.shape[1]] = loop.defect
    return ports


def no_deviation(loop: TrajectoryLoop) -> Deviation:
    """Return a deviation of zero: the nominal run itself."""
    samples = loop.samples
    rows = max(samples - 1, 0)
    shapes = ((samples, loop.size), (rows, 3), (rows, 2), (rows, 3), (samples, 3))
    return Deviation(*(np.zeros(shape) for shape in shapes))


NO_FRICTION = FrictionPort(*(np.zeros((0, 5)) for _ in range(3)))


def propagate(loop: TrajectoryLoop, ports: Ports, friction: FrictionPort = NO_FRICTION) -> Deviation:
    """Return the deviation that known errors and friction cause."""
    deviation = no_deviation(loop)
    propagate_signals(loop.matrices, ports, friction, deviation)
    p = len(loop.moving)
    return deviation._replace(
        load=loop.load_offset + np.einsum("kij,kj->ki", loop.load, deviation.state[:, :p])
    )


@jit_called
def propagate_signals(loop, ports, friction, deviation):
    """Fill all of `deviation` but its load.

    The products are sums in a fixed order, so they have the same bits on every processor.
    """
    state, to_drives, commanded = deviation.state, deviation.drive, deviation.commanded
    p, size = loop.moving.shape[0], state.shape[1]
    controller = p + EXTENSION
    measured, outputs, arrived = np.zeros(size), np.zeros(9), np.zeros(3)
    for k in range(len(state) - 1):
        at, x, following = k // loop.stride, state[k], state[k + 1]
        for i in range(size):
            measured[i] = x[i] + (ports.measured[k, i] if i < 10 else 0.0)
            following[i] = ports.local[k, i]
        outputs[:] = 0.0
        add_product(loop.outputs[k], measured, outputs)
        for axis in range(3):
            commanded[k, axis] = outputs[3 + axis] + ports.command[k, axis]
        for axis in range(3):
            late = commanded[k - loop.delay, axis] if k >= loop.delay else 0.0
            arrived[axis] = ports.arriving[k, axis] + late
            w = x[p + axis]
            to_drives[k, axis] = loop.integral * w + loop.lead[axis] * arrived[axis] + ports.drive[k, axis]
            following[p + axis] += w + loop.period * arrived[axis]
        for i in range(2):
            deviation.disturbance[k, i] = ports.disturbance[k, i]
        add_product(loop.by_state[at], x[:p], following)
        add_product(loop.by_input[at, :, :3], to_drives[k], following)
        add_product(loop.by_input[at, :, 3:], ports.disturbance[k], following)
        add_product(loop.controller_state, x[controller:], following[controller:])
        add_product(loop.controller_input, outputs, following[controller:])
        if len(friction.coulomb):
            add_friction(loop, friction, k, deviation)


@jit_called
def add_product(matrix, vector, result):
    """Add `matrix` times `vector` to the first elements of `result`."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            result[i] += matrix[i, j] * vector[j]


@jit_called
def add_friction(loop, friction, k, deviation):
    """Add friction to sample `k` and its effect to the next; an axis sticks if Coulomb's friction suffices.

    The axes are coupled, so the friction is iterated over them (projected Gauss-Seidel).
    """
    following, by_input = deviation.state[k + 1], loop.by_input[k // loop.stride]
    viscous, coulomb = np.zeros(5), np.zeros(5)
    for joint in range(5):
        rate = friction.rates[k, joint] + deviation.state[k, 2 * joint + 1]
        viscous[joint] = -friction.viscous[k, joint] * rate
    add_product(by_input, viscous, following)
    for _ in range(FRICTION_ITERATIONS):
        for joint in range(5):
            rate = friction.rates[k + 1, joint] + following[2 * joint + 1]
            limit, before = friction.coulomb[k, joint], coulomb[joint]
            stopping_force = before - rate / by_input[2 * joint + 1, joint]
            coulomb[joint] = min(max(stopping_force, -limit), limit)
            for i in range(by_input.shape[0]):
                following[i] += by_input[i, joint] * (coulomb[joint] - before)
    for joint in range(3):
        deviation.drive[k, joint] += viscous[joint] + coulomb[joint]
    for joint in range(2):
        deviation.disturbance[k, joint] += viscous[3 + joint] + coulomb[3 + joint]


def second_order(run: Run, loop: TrajectoryLoop, ports: Ports, predicted: Deviation) -> Deviation:
    """Return the second-order term of the deviation `predicted`, which errors at `ports` cause."""
    defect, p, rows = no_errors(loop), len(loop.moving), slice(0, loop.samples - 1)
    tracker, start = Tracker.of(run.scenario, run.design.flat), p + ROBUSTIFIER
    change = predicted.state[rows].copy()
    change[:, :10] += ports.measured[rows]
    nominal = [run.block("state"), run.block("controller")[:, :2], run.block("virtual_input")[:, :3]]
    at = np.hstack(nominal)[rows]
    at[:, :10] += change[:, :10]
    at[:, 10:12] += change[:, p + EXTENSION : start]
    error = (run.block("flat_output")[rows, :12] - command_outputs(tracker.gravity, at)[:, :12]).reshape(
        -1, 4, 3
    )
    v = np.einsum("i,kij->kj", tracker.gain, error) + tracker.feedthrough * error[:, 0]
    # The rows of v by X hold the robustifier's output row.
    v += np.einsum("kij,kj->ki", loop.outputs[rows, :3, start:], change[:, start:])
    at[:, 12:] += v
    command = command_outputs(tracker.gravity, at)[:, 12:] - run.block("input")[rows, :3]
    linear = np.einsum("kij,kj->ki", loop.outputs[rows], change)
    defect.command[:] = command - predicted.commanded
    beyond = np.hstack([v, command, error[:, 0]]) - linear
    defect.local[:, p + EXTENSION :] = beyond @ loop.controller_input.T
    states = loop.states.copy()
    states[:, loop.moving] += predicted.state[:, :p]
    inputs = (loop.commands + predicted.drive, loop.disturbances + predicted.disturbance)
    assert loop.plant is not None
    steps = (
        AddressedPlant.next_states(loop.plant, np.hstack([states[rows], *inputs]), loop.winds) - states[1:]
    )
    defect.local[:, :p] = steps[:, loop.moving] + ports.local[:, :p] - loop.defect
    deviation = propagate(loop, defect)
    return deviation._replace(load=deviation.load - loop.load_offset)


def higher_orders(
    run: Run, loop: TrajectoryLoop, ports: Ports, predicted: Deviation
) -> tuple[Deviation, Deviation]:
    """Return the second- and third-order terms of the deviation `predicted`."""
    second = second_order(run, loop, ports, predicted)
    better = Deviation(*(a + b for a, b in zip(predicted, second, strict=True)))
    return second, second_order(run, loop, ports, better)

"""The sampled loop linearised along a run: what a small error at any port becomes one sample later.

The nominal run is one of the analytic plant with ideal drives. Every sample is linearised about where that
run was, not about an equilibrium: while hoisting a frozen rope length is wrong by a factor of two. The state
of the linear loop is X = (x, zeta, zeta', xi): joints (10), dynamic extension, robustifier states of the axes
x, y, z; all as deviations from the run.

Derivatives are central differences of the very kernels that simulate; the robustifier is linear already.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.flatness import flat_output, linearising_input
from cranectl.jit import jit
from cranectl.plants.analytic import AnalyticPlant, AnalyticRig, integrate
from cranectl.plants.dop853 import STAGES
from cranectl.scenario import NANOSECONDS
from cranectl.simulate import Run, plan_scenario, tracker_of
from cranectl.tracker import Tracker

Array = NDArray[np.float64]

EXTENSION, ROBUSTIFIER = 10, 12  # places in X
DIFFERENCE = 1e-5  # half width of the central differences, SI units


class TrajectoryLoop(NamedTuple):
    """N samples of a run, linearised; n = 12 + 3 robustifier states."""

    plant_state: Array  # (N - 1, 10, 10) of the next joints by the present ones, command held
    plant_input: Array  # (N - 1, 10, 3) by the acceleration held over the sample
    plant_disturbance: Array  # (N - 1, 10, 2) by angular accelerations held over the sample
    load: Array  # (N, 3, 10) of the load position by the joints
    virtual: Array  # (N, 3, n) of v by X
    command: Array  # (N, 3, n) of the commanded acceleration by X
    robustifier_state: Array  # (m, m) of one axis
    robustifier_input: Array  # (m,)
    period: float


@jit
def step_plant(rig, start, command, disturbance, wind, state, stages, stage_state):
    """One control period of the plant from `start` (10,), into `state`."""
    state[:] = start
    for _ in range(rig.substeps):
        integrate(rig, state, command, disturbance, wind, stages, stage_state)


@jit
def linearise_plant(rig, states, commands, disturbances, winds, by_state, by_input, by_disturbance):
    """Derivatives of one period at every sample; see `TrajectoryLoop`."""
    stages, work = np.zeros((STAGES, 10)), np.zeros(10)
    above, below, port = np.zeros(10), np.zeros(10), np.zeros(15)
    for k in range(len(by_state)):
        port[:10], port[10:13], port[13:] = states[k], commands[k], disturbances[k]
        for column in range(15):
            middle = port[column]
            port[column] = middle + DIFFERENCE
            step_plant(rig, port[:10], port[10:13], port[13:], winds[k], above, stages, work)
            port[column] = middle - DIFFERENCE
            step_plant(rig, port[:10], port[10:13], port[13:], winds[k], below, stages, work)
            port[column] = middle
            for i in range(10):
                slope = (above[i] - below[i]) / (2.0 * DIFFERENCE)
                if column < 10:
                    by_state[k, i, column] = slope
                elif column < 13:
                    by_input[k, i, column - 10] = slope
                else:
                    by_disturbance[k, i, column - 13] = slope


@jit
def linearise_law(gravity, states, extensions, virtual, flat_by, input_by, input_by_virtual):
    """Derivatives of flat output and input by (x, zeta, zeta'), and of the input by v, at every sample.

    `flat_by` (N, 12, 12), `input_by` (N, 3, 12) at v held, `input_by_virtual` (N, 3, 3).
    """
    above, below, port = np.zeros(12), np.zeros(12), np.zeros(15)
    for k in range(len(states)):
        port[:10], port[10:12], port[12:] = states[k], extensions[k], virtual[k]
        for column in range(15):
            middle = port[column]
            port[column] = middle + DIFFERENCE
            flat_output(port[:10], port[10], port[11], gravity, above)
            high = linearising_input(port[:10], port[10], port[11], port[12], port[13], port[14], gravity)
            port[column] = middle - DIFFERENCE
            flat_output(port[:10], port[10], port[11], gravity, below)
            low = linearising_input(port[:10], port[10], port[11], port[12], port[13], port[14], gravity)
            port[column] = middle
            for i in range(3):
                slope = (high[i] - low[i]) / (2.0 * DIFFERENCE)
                if column < 12:
                    input_by[k, i, column] = slope
                else:
                    input_by_virtual[k, i, column - 12] = slope
            if column < 12:
                for i in range(12):
                    flat_by[k, i, column] = (above[i] - below[i]) / (2.0 * DIFFERENCE)


def linearise_run(run: Run) -> TrajectoryLoop:
    """Linearise the loop along `run`, one of the analytic plant with ideal drives."""
    tracker = tracker_of(run.scenario, run.design)
    rig = analytic_rig(run)
    samples = len(run.time_ns)
    states, inputs = (np.ascontiguousarray(run.block(name)) for name in ("state", "input"))
    disturbances = np.ascontiguousarray(run.block("disturbance"))
    winds = plan_scenario(run.scenario).wind[:samples]
    by_state, by_input, by_disturbance = (np.zeros((max(samples - 1, 0), 10, m)) for m in (10, 3, 2))
    linearise_plant(rig, states, inputs[:, :3], disturbances, winds, by_state, by_input, by_disturbance)
    flat_by, input_by = np.zeros((samples, 12, 12)), np.zeros((samples, 3, 12))
    input_by_virtual = np.zeros((samples, 3, 3))
    extensions, virtual = run.block("controller")[:, :2], run.block("virtual_input")[:, :3]
    linearise_law(
        tracker.gravity, states, np.ascontiguousarray(extensions), np.ascontiguousarray(virtual),
        flat_by, input_by, input_by_virtual,
    )  # fmt: skip
    robustifier_state, robustifier_input, output = dense_robustifier(tracker)
    v = np.zeros((samples, 3, ROBUSTIFIER + 3 * len(output)))
    for axis in range(3):
        v[:, axis, :12] = -tracker.feedthrough * flat_by[:, axis]
        for order in range(4):
            v[:, axis, :12] -= tracker.gain[order] * flat_by[:, 3 * order + axis]
        first = ROBUSTIFIER + axis * len(output)
        v[:, axis, first : first + len(output)] = output
    command = np.matmul(input_by_virtual, v)
    command[:, :, :12] += input_by
    return TrajectoryLoop(
        plant_state=by_state,
        plant_input=by_input,
        plant_disturbance=by_disturbance,
        load=np.ascontiguousarray(flat_by[:, :3, :10]),
        virtual=v,
        command=command,
        robustifier_state=robustifier_state,
        robustifier_input=robustifier_input,
        period=tracker.period,
    )


def analytic_rig(run: Run) -> AnalyticRig:
    """Constants of the ideal analytic plant of a run."""
    scenario = run.scenario
    step = scenario.period_ns / NANOSECONDS / scenario.substeps
    plant = AnalyticPlant(
        scenario.rig, drive="ideal", step=step, substeps=scenario.substeps, effects=scenario.effects
    )
    return plant.rig


def dense_robustifier(tracker: Tracker) -> tuple[Array, Array, Array]:
    """One axis's sampled robustifier as dense (A, b, c)."""
    from cranectl.design.sampling import diagonal

    return (
        diagonal(tracker.state_matrix),
        np.ascontiguousarray(tracker.input_matrix.ravel()),
        np.ascontiguousarray(tracker.output_matrix.ravel()),
    )


@jit
def loop_matrix(loop, k, matrix):
    """The closed loop's X at sample k + 1 by X at k, into `matrix` (n, n)."""
    n = matrix.shape[0]
    matrix[:] = 0.0
    matrix[:10, :10] = loop.plant_state[k]
    for i in range(10):
        for axis in range(3):
            for j in range(n):
                matrix[i, j] += loop.plant_input[k, i, axis] * loop.command[k, axis, j]
    controller_rows(loop, k, matrix)


@jit
def controller_rows(loop, k, matrix):
    """The rows of zeta, zeta' and the robustifier by X at sample k, into `matrix` (n, n)."""
    period, m = loop.period, loop.robustifier_input.shape[0]
    for j in range(matrix.shape[1]):
        matrix[EXTENSION, j] = 0.5 * period * period * loop.virtual[k, 2, j]
        matrix[EXTENSION + 1, j] = period * loop.virtual[k, 2, j]
    matrix[EXTENSION, EXTENSION] += 1.0
    matrix[EXTENSION, EXTENSION + 1] += period
    matrix[EXTENSION + 1, EXTENSION + 1] += 1.0
    for axis in range(3):
        first = ROBUSTIFIER + axis * m
        for i in range(m):
            for j in range(10):
                matrix[first + i, j] = -loop.robustifier_input[i] * loop.load[k, axis, j]
            for j in range(m):
                matrix[first + i, first + j] = loop.robustifier_state[i, j]

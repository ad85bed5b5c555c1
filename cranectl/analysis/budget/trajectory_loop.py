"""The sampled loop linearised along a run: what a small error at any port becomes one sample later.

The nominal run is one of the analytic plant with ideal drives. The plant of the loop may be that one, or the
crane as it is built (`real_crane`), which the nominal run does not obey: `defect` says by how much it misses
at every sample. Linearised about where the run was, not about an equilibrium: while hoisting a frozen rope
length is wrong by a factor of two. The state of the linear loop, as a deviation from the run, is

    X = (plant, w, zeta, zeta', xi)

with the joints first in the plant, the integral w of the commanded accelerations (3), from which velocity
drives get their set-points, the dynamic extension and the robustifier states of the axes x, y, z. Derivatives
are central differences of the very kernels that simulate; the robustifier is linear already.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.crane_equations import Work, advance, make_work
from cranectl.analysis.budget.real_crane import RealCrane, kept_states, load_positions, nominal_states
from cranectl.analysis.budget.trajectory_law import (
    DIFFERENCE,
    EXTENSION,
    ROBUSTIFIER,
    dense_robustifier,
    law_rows,
)
from cranectl.controllers.registry import only_flat
from cranectl.plants.analytic import AnalyticPlant, AnalyticRig, integrate
from cranectl.plants.dop853 import STAGES
from cranectl.plants.plant import Drive
from cranectl.scenario import NANOSECONDS
from cranectl.simulate import Run, tracker_of
from cranectl.simulate.actuation import make_actuation
from cranectl.support.jit import jit

Array = NDArray[np.float64]

STRIDE = 4  # samples that share one linearisation of the crane as it is built; a rope moves little in them


class Plant(NamedTuple):
    """The crane as it is built, or without it the analytic plant."""

    rig: AnalyticRig
    crane: RealCrane | None
    work: Work
    stages: Array
    stage_state: Array


class TrajectoryLoop(NamedTuple):
    """N samples of a run, linearised; p states of the plant that move, n = p + 5 + 3 robustifier states."""

    plant: Plant
    kept: NDArray[np.intp]  # (p,) states of the plant that move
    states: Array  # (N, 10 or 20) nominal
    commands: Array  # (N - 1, 3) nominal: accelerations for ideal drives, else velocities
    disturbances: Array  # (N - 1, 2) nominal
    winds: Array  # (N, 3)
    stride: int  # samples that share the next three
    by_state: Array  # (M, p, p) of the next plant state by the present one
    by_command: Array  # (M, p, 3)
    by_disturbance: Array  # (M, p, 2) by angular accelerations
    defect: Array  # (N - 1, p) the plant's own step from the nominal run, less that run
    load: Array  # (N, 3, p) of the load position by the plant's state
    load_offset: Array  # (N, 3) [m] of the load on the nominal states
    flat: Array  # (N, 3, 10) of the position that the tracker takes for the load's, by the joints
    virtual: Array  # (N, 3, n) of v by X
    command: Array  # (N, 3, n) of the commanded acceleration by X
    lead: Array  # (3,) command per commanded acceleration: 1, or a time [s]
    integral: float  # command per w: 0, or 1
    robustifier_state: Array  # (m, m) of one axis
    robustifier_input: Array  # (m,)
    period: float

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.virtual)

    @property
    def size(self) -> int:
        """Length of X."""
        return int(self.virtual.shape[2])


@jit
def step_plant(plant, crane, state, command, disturbance, wind):
    """One control period of `state` in place; `crane` is that of `plant`, distinguished at compile time."""
    if crane is None:
        for _ in range(plant.rig.substeps):
            integrate(plant.rig, state, command, disturbance, wind, plant.stages, plant.stage_state)
    else:
        advance(crane, state, command, disturbance, wind, plant.work)


@jit
def linearise_plant(plant, kept, states, commands, disturbances, winds, stride, by_state, by_command, by_d):
    """Derivatives of one period at every `stride`-th sample; see `TrajectoryLoop`."""
    p, size = len(kept), states.shape[1]
    above, below, port = np.zeros(size), np.zeros(size), np.zeros(size + 5)
    for m in range(len(by_state)):
        k = m * stride
        port[:size], port[size : size + 3], port[size + 3 :] = states[k], commands[k], disturbances[k]
        for c in range(p + 5):
            column = kept[c] if c < p else size + c - p
            middle = port[column]
            port[column] = middle + DIFFERENCE
            above[:] = port[:size]
            step_plant(plant, plant.crane, above, port[size : size + 3], port[size + 3 :], winds[k])
            port[column] = middle - DIFFERENCE
            below[:] = port[:size]
            step_plant(plant, plant.crane, below, port[size : size + 3], port[size + 3 :], winds[k])
            port[column] = middle
            for i in range(p):
                slope = (above[kept[i]] - below[kept[i]]) / (2.0 * DIFFERENCE)
                if c < p:
                    by_state[m, i, c] = slope
                elif c < p + 3:
                    by_command[m, i, c - p] = slope
                else:
                    by_d[m, i, c - p - 3] = slope


@jit
def step_defect(plant, kept, states, commands, disturbances, winds, following, defect):
    """One period from each of `states` under its ports, less `following`, into `defect`."""
    state = np.zeros(states.shape[1])
    for k in range(len(defect)):
        state[:] = states[k]
        step_plant(plant, plant.crane, state, commands[k], disturbances[k], winds[k])
        for i in range(len(kept)):
            defect[k, i] = state[kept[i]] - following[k, kept[i]]


def linearise_run(
    run: Run, *, crane: RealCrane | None = None, winds: Array | None = None, drive: Drive = "ideal"
) -> TrajectoryLoop:
    """Linearise the loop along `run`, one of the analytic plant with ideal drives.

    The loop's plant: `crane` in the moving air `winds` (N, 3), or the analytic one with `drive`.
    """
    tracker, period = tracker_of(run.scenario, only_flat(run.design)), run.scenario.period_ns / NANOSECONDS
    samples, velocity = len(run.time_ns), crane is not None or drive == "velocity"
    joints, inputs = np.ascontiguousarray(run.block("state")), run.block("input")
    commands = np.ascontiguousarray(inputs[:-1, 3:] if velocity else inputs[:-1, :3])
    disturbances = np.ascontiguousarray(run.block("disturbance")[:-1])
    states, kept, stride = joints, np.arange(10), 1
    if crane is not None:
        states, kept = nominal_states(crane, joints, run.tension), kept_states(crane)
        stride = STRIDE
    p, rows = len(kept), max(samples - 1, 0)
    plant = Plant(
        rig=analytic_rig(run, drive),
        crane=crane,
        work=make_work(),
        stages=np.zeros((STAGES, 10)),
        stage_state=np.zeros(10),
    )
    winds = np.zeros((samples, 3)) if winds is None else winds
    by_state, by_command, by_d = (np.zeros((-(-rows // stride), p, m)) for m in (p, 3, 2))
    linearise_plant(plant, kept, states, commands, disturbances, winds, stride, by_state, by_command, by_d)
    defect = np.zeros((rows, p))
    step_defect(plant, kept, states, commands, disturbances, winds, states[1:], defect)
    load, load_offset = _load_derivatives(run, crane, states, kept)
    flat_by, virtual, command = law_rows(run, tracker, p)
    robustifier_state, robustifier_input, _ = dense_robustifier(tracker)
    return TrajectoryLoop(
        plant, kept, states, commands, disturbances, winds, stride, by_state, by_command, by_d, defect,
        load=flat_by.copy() if load is None else load,
        load_offset=load_offset,
        flat=flat_by,
        virtual=virtual,
        command=command,
        lead=make_actuation(run.scenario, joints[0]).lag if velocity else np.ones(3),
        integral=float(velocity),
        robustifier_state=robustifier_state,
        robustifier_input=robustifier_input,
        period=period,
    )  # fmt: skip


def _load_derivatives(
    run: Run, crane: RealCrane | None, states: Array, kept: NDArray[np.intp]
) -> tuple[Array | None, Array]:
    """Of the load's position on `states`, by what is `kept`, and how far it is from the run's."""
    if crane is None:
        return None, np.zeros((len(states), 3))
    load = np.zeros((len(states), 3, len(kept)))
    for column, place in enumerate(kept):
        if place % 2 == 0:  # rates move nothing
            shift = DIFFERENCE * np.eye(states.shape[1])[place]
            change = load_positions(crane, states + shift) - load_positions(crane, states - shift)
            load[:, :, column] = change / (2.0 * DIFFERENCE)
    return load, load_positions(crane, states) - run.load_position


def analytic_rig(run: Run, drive: Drive = "ideal") -> AnalyticRig:
    """Constants of the analytic plant of a run."""
    scenario = run.scenario
    step = scenario.period_ns / NANOSECONDS / scenario.substeps
    plant = AnalyticPlant(
        scenario.rig, drive=drive, step=step, substeps=scenario.substeps, effects=scenario.effects
    )
    return plant.rig


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

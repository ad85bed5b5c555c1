"""The sampled loop linearised along a run: what a small error at any port becomes one sample later.

The nominal run is one of the analytic plant with ideal drives. The plant of the loop may be that one, or the
crane as it is built (`plants.elastic`), which the nominal run does not obey: `defect` says by how much it
misses at every sample. Linearised about where the run was, not about an equilibrium: while hoisting a frozen
rope length is wrong by a factor of two. The state of the linear loop, as a deviation from the run, is

    X = (plant, w, zeta, zeta', xi)

with the joints first in the plant, the integral w of the commanded accelerations (3), from which velocity
drives get their set-points, the dynamic extension and the robustifier states of the axes x, y, z. Derivatives
are central differences of the very kernels that simulate; the robustifier is linear already.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.levels import assumed_effects, replace_effects
from cranectl.controllers.flat import Tracker
from cranectl.controllers.registry import flat_design, only_flat
from cranectl.design.discretisation import diagonal
from cranectl.model.flatness import flat_output, linearising_input
from cranectl.plants.analytic import AnalyticPlant, AnalyticRig, integrate
from cranectl.plants.capabilities import lacking
from cranectl.plants.dop853 import STAGES
from cranectl.plants.elastic.crane import (
    ElasticCrane,
    Work,
    hanging_states,
    load_positions,
    make_crane,
    make_work,
    set_damping,
)
from cranectl.plants.elastic.step import advance_state
from cranectl.plants.registry import plant_entry
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.scenario.effects import EFFECTS, NO_EFFECTS, EffectNumbers
from cranectl.signals import ROPE
from cranectl.simulate import Run, make_plant, plan_scenario, simulate_run, tracker_of
from cranectl.simulate.actuation import make_actuation
from cranectl.support.arrays import Array
from cranectl.support.jit import jit

EXTENSION, ROBUSTIFIER = 3, 5  # places in X after the plant's states, which w follows
DIFFERENCE_STEP = 1e-6  # half width of the central differences, SI units
# Effects that change the equations of motion of the crane as it is built.
STRUCTURE = tuple(
    name for name, kind in EFFECTS.items() if kind.is_structural and not lacking(plant_entry("elastic"), name)
)
LINEARISATION_STRIDE = (
    4  # samples that share one linearisation of the crane as it is built; a rope moves little in them
)


class SteppedPlant(NamedTuple):
    """The crane as it is built, or without it the analytic plant."""

    rig: AnalyticRig
    crane: ElasticCrane | None
    work: Work
    stages: Array
    stage_state: Array


class TrajectoryLoop(NamedTuple):
    """N samples of a run, linearised; p states of the plant that move, n = p + 5 + 3 robustifier states."""

    plant: SteppedPlant | None  # None for kernels, see `matrices`
    kept: NDArray[np.intp]  # (p,) states of the plant that move
    states: Array  # (N, 10 or 22) nominal
    commands: Array  # (N - 1, 3) nominal: accelerations for ideal drives, else velocities
    disturbances: Array  # (N - 1, 2) nominal
    winds: Array  # (N, 6) as in `simulate.Plan`
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
    def matrices(self) -> "TrajectoryLoop":
        """Without the plant: kernels that take this are compiled once, whatever the plant is."""
        return self._replace(plant=None)

    @property
    def size(self) -> int:
        """Length of X."""
        return int(self.virtual.shape[2])


@jit
def step_plant(plant, crane, state, command, disturbance, wind):
    """Advance `state` by one control period; `crane` is that of `plant`, distinguished at compile time."""
    drives = (command[0], command[1], command[2])  # as a run has them, so that its kernels serve here too
    if crane is None:
        for _ in range(plant.rig.substeps):
            integrate(plant.rig, state, drives, disturbance, wind, plant.stages, plant.stage_state)
    else:
        advance_state(crane, state, drives, disturbance, wind, plant.work)


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
            port[column] = middle + DIFFERENCE_STEP
            above[:] = port[:size]
            step_plant(plant, plant.crane, above, port[size : size + 3], port[size + 3 :], winds[k])
            port[column] = middle - DIFFERENCE_STEP
            below[:] = port[:size]
            step_plant(plant, plant.crane, below, port[size : size + 3], port[size + 3 :], winds[k])
            port[column] = middle
            for i in range(p):
                slope = (above[kept[i]] - below[kept[i]]) / (2.0 * DIFFERENCE_STEP)
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
    run: Run, *, crane: ElasticCrane | None = None, winds: Array | None = None
) -> TrajectoryLoop:
    """Linearise the loop along `run`, one of the analytic plant with ideal drives.

    The loop's plant: `crane` with velocity drives in the air `winds` (N, 6), or that of the run.
    """
    tracker, period = tracker_of(run.scenario, only_flat(run.design)), run.scenario.period_ns / NANOSECONDS
    samples, velocity = len(run.time_ns), crane is not None
    joints, inputs = np.ascontiguousarray(run.block("state")), run.block("input")
    commands = np.ascontiguousarray(inputs[:-1, 3:] if velocity else inputs[:-1, :3])
    disturbances = np.ascontiguousarray(run.block("disturbance")[:-1])
    states, kept, stride = joints, np.arange(10), 1
    if crane is not None:
        states, kept = hanging_states(crane, joints, run.tension), crane.places
        stride = LINEARISATION_STRIDE
    p, rows = len(kept), max(samples - 1, 0)
    plant = SteppedPlant(
        rig=analytic_rig(run),
        crane=crane,
        work=make_work(),
        stages=np.zeros((STAGES, 10)),
        stage_state=np.zeros(10),
    )
    winds = np.hstack([np.zeros((samples, 3)), run.load_force]) if winds is None else winds
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
    run: Run, crane: ElasticCrane | None, states: Array, kept: NDArray[np.intp]
) -> tuple[Array | None, Array]:
    """Of the load's position on `states`, by what is `kept`, and how far it is from the run's."""
    if crane is None:
        return None, np.zeros((len(states), 3))
    load = np.zeros((len(states), 3, len(kept)))
    for column, place in enumerate(kept):
        shift = DIFFERENCE_STEP * np.eye(states.shape[1])[place]
        change = load_positions(crane, states + shift) - load_positions(crane, states - shift)
        load[:, :, column] = change / (2.0 * DIFFERENCE_STEP)
    return load, load_positions(crane, states) - run.load_position


def analytic_rig(run: Run) -> AnalyticRig:
    """Return the constants of the analytic plant of a run with ideal drives."""
    plant = make_plant("analytic", run.scenario, "ideal")
    assert isinstance(plant, AnalyticPlant)
    return plant.rig


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
            port[column] = middle + DIFFERENCE_STEP
            flat_output(port[:10], port[10], port[11], gravity, above)
            high = linearising_input(port[:10], port[10], port[11], port[12], port[13], port[14], gravity)
            port[column] = middle - DIFFERENCE_STEP
            flat_output(port[:10], port[10], port[11], gravity, below)
            low = linearising_input(port[:10], port[10], port[11], port[12], port[13], port[14], gravity)
            port[column] = middle
            for i in range(3):
                slope = (high[i] - low[i]) / (2.0 * DIFFERENCE_STEP)
                if column < 12:
                    input_by[k, i, column] = slope
                else:
                    input_by_virtual[k, i, column - 12] = slope
            if column < 12:
                for i in range(12):
                    flat_by[k, i, column] = (above[i] - below[i]) / (2.0 * DIFFERENCE_STEP)


def law_rows(run: Run, tracker: Tracker, p: int) -> tuple[Array, Array, Array]:
    """(N, 3, 10) flat output by the joints; v and commanded acceleration by X, (N, 3, n)."""
    samples = len(run.time_ns)
    flat_by, input_by = np.zeros((samples, 12, 12)), np.zeros((samples, 3, 12))
    input_by_virtual = np.zeros((samples, 3, 3))
    state, controller, virtual = (
        np.ascontiguousarray(block)
        for block in (run.block("state"), run.block("controller")[:, :2], run.block("virtual_input")[:, :3])
    )
    linearise_law(tracker.gravity, state, controller, virtual, flat_by, input_by, input_by_virtual)
    output = dense_robustifier(tracker)[2]
    extension, robustifier, m = p + EXTENSION, p + ROBUSTIFIER, len(output)
    measured = [*range(10), extension, extension + 1]
    v = np.zeros((samples, 3, robustifier + 3 * m))
    for axis in range(3):
        v[:, axis, measured] = -tracker.feedthrough * flat_by[:, axis]
        for order in range(4):
            v[:, axis, measured] -= tracker.gain[order] * flat_by[:, 3 * order + axis]
        v[:, axis, robustifier + axis * m : robustifier + (axis + 1) * m] = output
    command = np.matmul(input_by_virtual, v)
    command[:, :, measured] += input_by
    return np.ascontiguousarray(flat_by[:, :3, :10]), v, command


def dense_robustifier(tracker: Tracker) -> tuple[Array, Array, Array]:
    """One axis's sampled robustifier as dense (A, b, c)."""
    return (
        diagonal(tracker.state_matrix.reshape(-1, 2, 2)),
        tracker.input_matrix,
        tracker.output_matrix,
    )


@dataclass(frozen=True)
class LinearisedRun:
    """The nominal run, linearised."""

    run: Run
    loop: TrajectoryLoop  # of the run's own plant
    effects: EffectNumbers
    _driven: dict[tuple[str, ...], TrajectoryLoop] = field(default_factory=dict)

    def driven(self, *effects: str) -> TrajectoryLoop:
        """The loop with velocity drives and those of `effects` that change the equations of motion."""
        structure = tuple(name for name in STRUCTURE if name in effects)
        if structure not in self._driven:
            run, chosen = self.run, self.effects.only(*structure)
            scenario = run.scenario
            step = scenario.period_ns / NANOSECONDS / scenario.substeps
            crane = make_crane(scenario.rig, chosen, "velocity", step=step, substeps=scenario.substeps)
            set_damping(crane, chosen, float(run.block("state")[0, ROPE]))
            winds = plan_scenario(replace_effects(run.scenario, chosen)).wind[: len(run.time_ns)]
            self._driven[structure] = linearise_run(run, crane=crane, winds=winds)
        return self._driven[structure]


def nominal_run(scenario: Scenario, controller: str | None = None) -> LinearisedRun:
    """Run and linearise the sampled ideal of `scenario`: the analytic plant, ideal drives and no effects."""
    design = flat_design(controller or scenario.controller.name, scenario)
    run = simulate_run(replace_effects(scenario, NO_EFFECTS), plant="analytic", design=design)
    return LinearisedRun(run, linearise_run(run), assumed_effects(scenario))

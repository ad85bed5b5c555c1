"""Linearise the sampled loop along a run: it gives the effect of a small error at any port one sample later.

The nominal run has the analytic plant with ideal drives. The plant of the loop is the same, or the elastic
crane (`plants.elastic`). The nominal run does not satisfy the equations of the latter; `defect` is the error
at every sample. The loop is linearised about the trajectory of the run, not about an equilibrium, because a
constant rope length would be wrong by a factor of two while hoisting. The state of the linear loop, as a
deviation from the run, is

    X = (plant, w, zeta, zeta', xi)

The plant's state begins with the joints. w is the integral of the commanded accelerations (3), from which
velocity drives get their set-points. The others are the dynamic extension and the robustifier states of the
axes x, y, z. Derivatives are central differences of the kernels that simulate. The robustifier is linear.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from cranectl.analysis.levels import assumed_effects, replace_effects
from cranectl.controllers import ALL_CONTROLLERS, Tracker
from cranectl.design import diagonal
from cranectl.model import flat_output, linearising_input
from cranectl.plants import PLANTS, AddressedPlant, AnalyticPlant, ElasticPlant, PhysicsStep, Plant
from cranectl.scenario import EFFECTS, NANOSECONDS, EffectNumbers, EffectSettings, Scenario
from cranectl.simulate import Actuation, Plan, Run, simulate_run
from cranectl.support import Array, jit_called

EXTENSION, ROBUSTIFIER = 3, 5  # indices in X, counted from the end of the plant's states
DIFFERENCE_STEP = 1e-6  # half width of the central differences, SI units
# Effects that change the equations of motion of the elastic crane.
STRUCTURE = tuple(
    name for name, kind in EFFECTS.items() if kind.is_structural and not PLANTS["elastic"].why_lacking(name)
)
LINEARISATION_STRIDE = 4  # samples that share one linearisation of the elastic crane


class TrajectoryLoop(NamedTuple):
    """N samples of a run, linearised; p states of the plant that move, n = p + 5 + 3 robustifier states."""

    plant: Plant | None  # None for kernels, see `matrices`
    moving: NDArray[np.intp]  # (p,) states of the plant that move
    states: Array  # (N, 10 or 22) nominal
    commands: Array  # (N - 1, 3) nominal: accelerations for ideal drives, else velocities
    disturbances: Array  # (N - 1, 2) nominal
    winds: Array  # (N, 6) as in `simulate.Plan`
    stride: int  # samples that share the next two
    by_state: Array  # (M, p, p) of the next plant state by the present one
    by_input: Array  # (M, p, 5) by commands and angular accelerations
    defect: Array  # (N - 1, p) a step of the plant from the nominal run, minus that run
    load: Array  # (N, 3, p) of the load position by the plant's state
    load_offset: Array  # (N, 3) [m] of the plant's load from that of the nominal run
    outputs: Array  # (N, 9, n) by X: v, commanded acceleration, position error that the tracker sees
    lead: Array  # (3,) command per commanded acceleration: 1, or a time [s]
    integral: float  # command per w: 0, or 1
    controller_state: Array  # (c, c) next zeta, zeta' and robustifier states by the present ones
    controller_input: Array  # (c, 9) and by `outputs`
    period: float
    delay: int = 0  # samples between a command and its arrival

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.outputs)

    @property
    def matrices(self) -> "TrajectoryLoop":
        """The loop without its plant, so that its kernels are compiled only once for all plants."""
        return self._replace(plant=None)

    @property
    def size(self) -> int:
        """Length of X."""
        return int(self.outputs.shape[2])


@jit_called
def command_each(gravity, ports, flat, command):
    """Write the result of `command_outputs` into `flat` (N, 12) and `command` (N, 3)."""
    for k in range(len(ports)):
        state, zeta, zeta_dot, v = ports[k, :10], ports[k, 10], ports[k, 11], ports[k, 12:]
        flat_output(state, zeta, zeta_dot, gravity, flat[k])
        u = linearising_input(state, zeta, zeta_dot, v[0], v[1], v[2], gravity)
        command[k, 0], command[k, 1], command[k, 2] = u


def command_outputs(gravity: float, ports: Array) -> Array:
    """Return flat output and commanded acceleration (N, 15) at joints, zeta, zeta' and v, `ports` (N, 15)."""
    flat, command = np.zeros((len(ports), 12)), np.zeros((len(ports), 3))
    command_each(gravity, ports, flat, command)
    return np.hstack([flat, command])


def row_jacobians(function: Callable[[Array], Array], at: Array, columns: Iterable[int]) -> Array:
    """Return the derivatives (N, outputs, columns) of `function`, row by row, by some `columns` of `at`."""
    by_column = []
    for column in columns:
        shift = np.zeros(at.shape[1])
        shift[column] = DIFFERENCE_STEP
        by_column.append((function(at + shift) - function(at - shift)) / (2.0 * DIFFERENCE_STEP))
    return np.ascontiguousarray(np.stack(by_column, axis=2))


def linearise_run(run: Run) -> TrajectoryLoop:
    """Linearise the loop along `run`, which has the analytic plant with ideal drives."""
    tracker, samples = Tracker.of(run.scenario, run.design.flat), len(run.time_ns)
    flat, outputs = _controller_outputs(run, tracker)
    controller_state, controller_input = _controller_matrices(tracker)
    none = np.zeros((0, 10, 10))
    loop = TrajectoryLoop(
        plant=analytic_plant(run),
        moving=np.arange(10),
        states=np.ascontiguousarray(run.block("state")),
        commands=run.block("input")[:-1, :3],
        disturbances=run.block("disturbance")[:-1],
        winds=np.hstack([np.zeros((samples, 3)), run.load_force]),
        stride=1,
        by_state=none,
        by_input=none,
        defect=none,
        load=np.ascontiguousarray(flat[:, :3, :10]),
        load_offset=np.zeros((samples, 3)),
        outputs=outputs,
        lead=np.ones(3),
        integral=0.0,
        controller_state=controller_state,
        controller_input=controller_input,
        period=run.scenario.period_ns / NANOSECONDS,
    )
    return _with_linear_plant(loop)


def with_elastic_crane(run: Run, loop: TrajectoryLoop, plant: ElasticPlant, winds: Array) -> TrajectoryLoop:
    """Return the `loop` along `run` with another plant: the elastic one, in `winds` (N, 6)."""
    states, outputs, moving = plant.hanging_states(loop.states, run.tension), loop.outputs, plant.moving
    others = np.zeros((*outputs.shape[:2], len(moving) - 10))
    return _with_linear_plant(
        loop._replace(
            plant=plant,
            moving=moving,
            states=states,
            commands=run.block("input")[:-1, 3:],
            winds=winds,
            stride=LINEARISATION_STRIDE,
            load=row_jacobians(plant.load_positions, states, moving),
            load_offset=plant.load_positions(states) - run.load_position,
            outputs=np.concatenate([outputs[:, :, :10], others, outputs[:, :, 10:]], axis=2),
            lead=Actuation.of(run.scenario).lag,
            integral=1.0,
        )
    )


def _with_linear_plant(loop: TrajectoryLoop) -> TrajectoryLoop:
    """Return `loop` with the derivatives and the defect of its plant."""
    plant, moving, p, size = loop.plant, loop.moving, len(loop.moving), loop.states.shape[1]
    assert plant is not None
    ports = np.hstack([loop.states[:-1], loop.commands, loop.disturbances])
    by_port = row_jacobians(
        lambda at: AddressedPlant.next_states(plant, at, loop.winds[:: loop.stride])[:, moving],
        ports[:: loop.stride],
        [*moving, *range(size, size + 5)],
    )
    return loop._replace(
        by_state=np.ascontiguousarray(by_port[:, :, :p]),
        by_input=np.ascontiguousarray(by_port[:, :, p:]),
        defect=(AddressedPlant.next_states(plant, ports, loop.winds) - loop.states[1:])[:, moving],
    )


def analytic_plant(run: Run) -> AnalyticPlant:
    """Return the analytic plant with ideal drives for the scenario of a run."""
    plant = PLANTS.make("analytic", run.scenario, "ideal")
    assert isinstance(plant, AnalyticPlant)
    return plant


def _controller_outputs(run: Run, tracker: Tracker) -> tuple[Array, Array]:
    """Return the flat output by joints, zeta and zeta', (N, 12, 12), and the loop's outputs if p = 10."""
    ports = np.hstack([run.block("state"), run.block("controller")[:, :2], run.block("virtual_input")[:, :3]])
    by_port = row_jacobians(partial(command_outputs, tracker.gravity), ports, range(15))
    flat, command, by_v = by_port[:, :12, :12], by_port[:, 12:, :12], by_port[:, 12:, 12:]
    output, extension, robustifier = dense_robustifier(tracker)[2], 10 + EXTENSION, 10 + ROBUSTIFIER
    measured = [*range(10), extension, extension + 1]
    rows = np.zeros((len(ports), 9, robustifier + 3 * len(output)))
    v, robustified, error = rows[:, :3], rows[:, 3:6], rows[:, 6:]
    error[:, :, :10] = -flat[:, :3, :10]
    v[:, :, measured] = -tracker.feedthrough * flat[:, :3]
    for order in range(4):
        v[:, :, measured] -= tracker.gain[order] * flat[:, 3 * order : 3 * order + 3]
    v[:, :, robustifier:] += np.kron(np.eye(3), output)
    robustified[:] = by_v @ v
    robustified[:, :, measured] += command
    return flat, rows


def _controller_matrices(tracker: Tracker) -> tuple[Array, Array]:
    """Return `controller_state` and `controller_input` of a `TrajectoryLoop`."""
    period, (state, robustifier_input, _) = tracker.period, dense_robustifier(tracker)
    eye = np.eye(3)
    by_error = np.zeros((2 + 3 * len(robustifier_input), 9))
    by_error[:2, 2] = 0.5 * period**2, period  # v of the vertical axis
    by_error[2:, 6:] = np.kron(eye, robustifier_input[:, None])
    return block_diag([[1.0, period], [0.0, 1.0]], np.kron(eye, state)), by_error


def dense_robustifier(tracker: Tracker) -> tuple[Array, Array, Array]:
    """Return the sampled robustifier of one axis as dense (A, b, c)."""
    return (
        diagonal(tracker.state_matrix.reshape(-1, 2, 2)),
        tracker.input_matrix,
        tracker.output_matrix,
    )


@dataclass(frozen=True)
class LinearisedRun:
    """The nominal run with its linearised loops."""

    run: Run
    loop: TrajectoryLoop  # of the run's own plant
    effects: EffectNumbers
    _loops: dict[tuple[str, ...], TrajectoryLoop] = field(default_factory=dict)

    def with_servos(self, *effects: str) -> TrajectoryLoop:
        """Return the loop with velocity drives, and with the delay and structural effects among `effects`."""
        structure = tuple(name for name in STRUCTURE if name in effects)
        if structure not in self._loops:
            run, chosen = self.run, self.effects.only(*structure)
            scenario = run.scenario
            steps = PhysicsStep(scenario, "velocity").per_period
            plant = ElasticPlant(
                scenario.rig,
                drive="velocity",
                step=scenario.period_ns / NANOSECONDS / steps,
                substeps=steps,
                effects=chosen,
            )
            winds = Plan.of(replace_effects(run.scenario, chosen)).wind[: len(run.time_ns)]
            self._loops[structure] = with_elastic_crane(run, self.loop, plant, winds)
        delay = round(self.effects.delay.seconds / self.loop.period) if "delay" in effects else 0
        return self._loops[structure]._replace(delay=delay)


def nominal_run(scenario: Scenario, controller: str | None = None) -> LinearisedRun:
    """Run and linearise the sampled ideal of `scenario`: the analytic plant, ideal drives and no effects."""
    design = ALL_CONTROLLERS.flat_design(controller or scenario.controller.name, scenario)
    run = simulate_run(replace_effects(scenario, EffectSettings()), plant="analytic", design=design)
    return LinearisedRun(run, linearise_run(run), assumed_effects(scenario))

"""Linearise the feedback-linearised plant numerically at an operating point, with the code of a run.

Central differences give two sampled blocks. One is the MuJoCo plant over one period, with all degrees of
freedom that its effects add. The other is the controller at one sample: observer, feedback linearisation and
set-points. The delay lies between them.

    v ─► controller ─► command ─► z^-k ─► drives, crane ─► joints ─► encoders, observer ─► controller
          └─► flat state (z, z', z'', z''') as the tracker sees it

For a controller outside the flat family, v is its command, the accelerations u, and the joints replace the
flat state.

The linear part of a scenario's effects is included. `LINEAR` and `NOT_LINEAR` list what is and is not.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cranectl.controllers import EXPECTED, JOINTS, Observer, Tracker, observe, predict
from cranectl.design import design_controller
from cranectl.model import angular_accelerations
from cranectl.plants import DRIVES, PLANTS, Drive, MujocoPlant, jacobian
from cranectl.scenario import EFFECTS, EffectSettings, Scenario
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, ROPE_RATE, TROLLEY
from cranectl.simulate import Actuation, SignalPath, actuate
from cranectl.support import Array
from cranectl.tools.robustness.certificate.operating_points import EquilibriumState, OperatingPoint
from cranectl.tools.robustness.certificate.systems import SampledSystem


def _names(part: str) -> list[str]:
    """Return the effects that are wholly in a `part` of their classes, and the settings that are in it."""
    settings = ((effect, setting) for effect, kind in EFFECTS.items() for setting in getattr(kind, part))
    return [f"{effect}.{setting}" if setting else effect for effect, setting in settings]


LINEAR = sorted(_names("linear"), key=lambda name: "." in name)  # included; whole effects first
NOT_LINEAR = _names("nonlinear")  # left out


def present(effects: EffectSettings, names: Sequence[str]) -> list[str]:
    """Return those of `names` that are set and not zero in `effects`; air at rest counts as set."""

    def value(name: str) -> Any:
        effect, _, setting = name.partition(".")
        settings = getattr(effects, effect)
        return getattr(settings, setting) if settings and setting and name != "wind.mean" else settings

    return [name for name in names if np.any(value(name))]


STEP = 1e-5  # of the differences of the controller, in each signal's unit
V_STEP = 1e-3  # [m/s⁴]
JOINT_SIGNALS = 10
ZERO_TOLERANCE = 1e-7  # smaller entries of a matrix are rounding errors

SETPOINT, ESTIMATE = 2, 5  # indices in the memory, which begins with zeta and its rate

# Inputs of the linear plant.
ARRIVING, V = slice(0, 3), slice(3, 6)
# Outside the flat family: inputs and outputs of the two horizontal axes, commands first, then the joints.
HORIZONTAL_INPUTS = [0, 1, 3, 4]
HORIZONTAL_OUTPUTS = [0, 1, *(3 + joint for joint in (BRIDGE, TROLLEY, BRIDGE + 1, TROLLEY + 1)),
                 *(3 + joint for joint in (BETA, ALPHA, BETA + 1, ALPHA + 1))]  # fmt: skip


@dataclass(frozen=True)
class LinearPlant:
    """A sampled plant with its feedback linearisation; the delay is not in the matrices.

    Inputs: commands arriving at the drives (3), v (3). Outputs: commands sent (3), flat state (12) in the
    order of `signals.FLAT_OUTPUT`, (z, z', z'', z'''), three axes each. For a controller outside the flat
    family only the horizontal axes count. Inputs: arriving commands (2), u (2). Outputs: sent commands (2),
    then position, rate, angle and angular rate (8), two axes each.
    """

    system: SampledSystem  # the first ten states are the joints
    delay: int  # samples between sending and arrival of a command

    @staticmethod
    def of(
        scenario: Scenario,
        point: OperatingPoint,
        drive: Drive,
        *,
        plant: MujocoPlant | None = None,
        flat: bool = True,
    ) -> "LinearPlant":
        """Linearise the MuJoCo plant of `scenario`, or another `plant`, with its tracker at `point`.

        It includes the linear part of the effects, delay and observer. If not `flat`, it leaves out the
        feedback linearisation, for controllers outside the flat family.
        """
        plant = plant or run_plant(scenario, drive)
        tracker = Tracker.of(
            scenario, design_controller("pole-placement")
        )  # for its feedback linearisation only
        wind = scenario.effects.wind
        air = np.array([*(wind.mean if wind else (0.0, 0.0, 0.0)), 0.0, 0.0, 0.0])
        equilibrium = OperatingPoint.find_equilibrium(plant, point, air, tracker.gravity)
        state, crane_matrix = (
            EquilibriumState.at(equilibrium.joints, tracker.gravity),
            equilibrium.linearise(),
        )
        path = SignalPath.of(scenario, state.joints, drive=drive)
        observer, actuation = path.observer if path.sensed else None, Actuation.of(scenario)
        controller_map = _controller_map(tracker if flat else None, actuation, observer, drive)
        memory = _equilibrium_memory(state, equilibrium.command, path)
        at = np.concatenate([state.joints, memory, state.virtual_input])
        steps = np.concatenate([np.full(10 + len(memory), STEP), np.full(3, V_STEP)])
        controller_matrix = jacobian(controller_map, at, steps)
        set_points = range(SETPOINT, ESTIMATE) if DRIVES[drive].command != "velocity" else ()
        retained = [k for k in range(len(memory)) if k not in set_points]
        whole = _join(crane_matrix, controller_matrix, len(memory), retained)
        return LinearPlant(whole if flat else _horizontal(whole), scenario.delay_samples)


def run_plant(scenario: Scenario, drive: Drive) -> MujocoPlant:
    """Return the MuJoCo plant of `scenario` with the linear part of its effects."""
    effects = scenario.effects.linear_part
    plant = PLANTS.make("mujoco", scenario.model_copy(update={"effects": effects}), drive)
    assert isinstance(plant, MujocoPlant)
    return plant


def _equilibrium_memory(state: EquilibriumState, command: Array, path: SignalPath) -> Array:
    memory = np.concatenate([[state.zeta, 0.0], command])
    if not path.sensed:
        return memory
    joints, estimate, gravity = state.joints, path.estimate, path.observer.gravity
    # The observer takes what holds the angles against gravity for a disturbance.
    fall = angular_accelerations(
        joints[ROPE], joints[ROPE_RATE], joints[ALPHA], 0.0, joints[BETA], 0.0, 0.0, 0.0, gravity
    )  # fmt: skip
    estimate[EXPECTED.disturbance + 3 : EXPECTED.disturbance + JOINTS] = -np.array(fall)
    return np.concatenate([memory, estimate])


def _controller_map(
    tracker: Tracker | None, actuation: Actuation, observer: Observer | None, drive: Drive
) -> Callable[[Array], Array]:
    """Return (joints, memory, v) → (memory later, command (3,), flat state (12,) or joints if no tracker)."""
    size = ESTIMATE + (0 if observer is None else EXPECTED.size)
    first = DRIVES[drive].column or 0

    def controller_map(values: Array) -> Array:
        joints, memory, v = values[:10].copy(), values[10 : 10 + size].copy(), values[10 + size :]
        commands, estimate = np.zeros(6), memory[ESTIMATE:]
        if observer is not None:
            measured = np.zeros(JOINT_SIGNALS + 2)
            observe(observer, joints[0::2].copy(), estimate, measured)
            joints = measured[:JOINT_SIGNALS]
        outputs, commands[:3] = (joints, v) if tracker is None else tracker.linearise(joints, memory, v)
        actuate(actuation, memory[SETPOINT:ESTIMATE], commands)
        if observer is not None:
            predict(observer, commands[:3], estimate)
        return np.concatenate([memory, commands[first : first + 3], outputs])

    return controller_map


def _join(crane: Array, controller: Array, size: int, retained: list[int]) -> SampledSystem:
    """Join crane and controller, with the entries `retained` of the memory; the joints are measured."""
    rows, n, m = [*retained, *range(size, len(controller))], len(crane), len(retained)
    measured = np.zeros((len(rows), n))
    measured[:, :JOINT_SIGNALS] = controller[rows, :JOINT_SIGNALS]
    controller_a = np.hstack([measured, controller[np.ix_(rows, [JOINT_SIGNALS + k for k in retained])]])
    controller_b = controller[np.ix_(rows, range(JOINT_SIGNALS + size, JOINT_SIGNALS + size + 3))]
    a, b = np.zeros((n + m, n + m)), np.zeros((n + m, 6))
    a[:n, :n], b[:n, ARRIVING] = crane[:, :n], crane[:, n:]
    a[n:], b[n:, V] = controller_a[:m], controller_b[:m]
    d = np.zeros((len(controller) - size, 6))
    d[:, V] = controller_b[m:]
    return SampledSystem(a, b, controller_a[m:], d)


def _horizontal(system: SampledSystem) -> SampledSystem:
    """Return the system of the two horizontal axes, with only those states that its inputs reach."""
    a, b = system.a, system.b[:, HORIZONTAL_INPUTS]
    reached = (np.abs(b) > ZERO_TOLERANCE).any(axis=1)
    for _ in range(len(a)):
        reached |= (np.abs(a[:, reached]) > ZERO_TOLERANCE).any(axis=1)
    c, d = system.c[HORIZONTAL_OUTPUTS], system.d[np.ix_(HORIZONTAL_OUTPUTS, HORIZONTAL_INPUTS)]
    return SampledSystem(a[np.ix_(reached, reached)], b[reached], c[:, reached], d)

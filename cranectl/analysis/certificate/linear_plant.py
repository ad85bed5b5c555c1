"""The exactly linearised plant as it is run, linearised at an operating point.

Two sampled blocks by central differences through the code of a run: the MuJoCo plant over one period, and
what the computer does at one sample, observer, linearising law and set-points. Delay lies between them.

    v ─► law ─► command ─► z^-k ─► drives, crane ─► joints ─► encoders, observer ─► law
          └─► flat state (z, z', z'', z''') as the tracker sees it
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cranectl.analysis.certificate.operating_points import HeldState, OperatingPoint, held_state
from cranectl.analysis.certificate.systems import Array, SampledSystem
from cranectl.design import design_controller
from cranectl.effects.settings import NO_EFFECTS
from cranectl.flatness import flat_output
from cranectl.observer import (
    DISTURBANCE,
    JOINTS,
    MEMORY,
    Observer,
    correct,
    initial_estimate,
    make_observer,
    predict,
)
from cranectl.plants.interface import Drive, Plant
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.simulate import make_plant, tracker_of
from cranectl.tracker import ROBUSTIFIER, SETPOINT, ZETA, Tracker, inner_law

STEP = 1e-5  # of the differences, in each signal's unit
V_STEP = 1e-3  # [m/s⁴]

# Inputs and outputs of the linear plant.
ARRIVING, V = slice(0, 3), slice(3, 6)
COMMAND, FLAT = slice(0, 3), slice(3, 15)


@dataclass(frozen=True)
class LinearPlant:
    """Inputs: commands arriving at the drives (3), v (3). Outputs: commands given (3), flat state (12).

    The flat state is ordered as in `signals.FLAT_OUTPUT`, (z, z', z'', z'''), three axes each.
    """

    system: SampledSystem
    delay: int  # samples between a command given and arriving
    period: float  # [s]
    point: OperatingPoint


def linear_plant(
    scenario: Scenario, point: OperatingPoint, drive: Drive, *, plant: Plant | None = None
) -> LinearPlant:
    """Linearise the MuJoCo plant of `scenario` with its tracker at `point`, or another `plant`.

    Of the effects, delay and the observer are taken into account; noise, limits, friction are not linear.
    """
    plant = plant or bare_plant(scenario, drive)
    tracker = tracker_of(scenario, design_controller("pole-placement"))  # only its inner law is used
    held = held_state(point, scenario.rig.gravity)
    crane = _crane_function(plant, point)
    command = _holding_command(crane, held, drive)
    sensing, delay = scenario.effects.sensing, scenario.effects.delay
    observer = None
    if sensing is not None:
        observer = make_observer(
            sensing.observer_bandwidth, period=tracker.period, gravity=tracker.gravity
        )  # fmt: skip
    law, memory = _law_function(tracker, observer, drive), _held_memory(held, command, observer, point)
    crane_matrix = differences(crane, np.concatenate([held.joints, command]), np.full(13, STEP))
    at = np.concatenate([held.joints, memory, held.virtual_input])
    steps = np.concatenate([np.full(10 + len(memory), STEP), np.full(3, V_STEP)])
    law_matrix = differences(law, at, steps)
    kept = [k for k in range(len(memory)) if drive == "velocity" or not SETPOINT <= k < ROBUSTIFIER]
    return LinearPlant(
        system=_joined(crane_matrix, law_matrix, len(memory), kept),
        delay=round(delay.seconds * NANOSECONDS / scenario.period_ns) if delay else 0,
        period=tracker.period,
        point=point,
    )


def bare_plant(scenario: Scenario, drive: Drive) -> Plant:
    """The MuJoCo plant of `scenario` without effects."""
    return make_plant("mujoco", scenario.model_copy(update={"effects": NO_EFFECTS}), drive)


def differences(function: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """Jacobian of `function` by central differences: (outputs, inputs)."""
    columns = []
    for k, step in enumerate(steps):
        offset = np.zeros(len(at))
        offset[k] = step
        columns.append((function(at + offset) - function(at - offset)) / (2.0 * step))
    return np.column_stack(columns)


def _crane_function(plant: Plant, point: OperatingPoint) -> Callable[[Array], Array]:
    """(joints (10), command (3)) → joints one period later, under the point's disturbance."""
    disturbance, air, load = np.array(point.tilt), np.zeros(3), np.zeros(7)

    def crane(values: Array) -> Array:
        after = np.zeros(10)
        plant.reset(values[:10])
        plant.advance(values[10:13], disturbance, air, load)
        plant.measure(after)
        return after

    return crane


def _holding_command(crane: Callable[[Array], Array], held: HeldState, drive: Drive) -> Array:
    """The command (3,) under which the drives keep their velocities: set-points that make up for sag."""
    command = np.zeros(3) if drive == "ideal" else held.joints[1:6:2].copy()
    for _ in range(3):  # Newton; the drives are linear in their command
        matrix = differences(
            lambda c: crane(np.concatenate([held.joints, c]))[1:6:2], command, np.full(3, STEP)
        )
        drift = crane(np.concatenate([held.joints, command]))[1:6:2] - held.joints[1:6:2]
        command = command - np.linalg.solve(matrix, drift)
    return command


def _held_memory(held: HeldState, command: Array, observer: Observer | None, point: OperatingPoint) -> Array:
    memory = np.zeros(ROBUSTIFIER)
    memory[ZETA], memory[SETPOINT:ROBUSTIFIER] = held.zeta, command
    if observer is None:
        return memory
    estimate = initial_estimate(held.joints)
    estimate[DISTURBANCE + 3 : DISTURBANCE + JOINTS] = point.tilt
    return np.concatenate([memory, estimate])


def _law_function(tracker: Tracker, observer: Observer | None, drive: Drive) -> Callable[[Array], Array]:
    """(joints, memory, v) → (memory one period later, command (3), flat state (12))."""
    size = ROBUSTIFIER + (0 if observer is None else MEMORY)
    first = 0 if drive == "ideal" else 3

    def law(values: Array) -> Array:
        joints, memory, v = values[:10].copy(), values[10 : 10 + size].copy(), values[10 + size :]
        given, flat = np.zeros(6), np.zeros(15)
        estimate = memory[ROBUSTIFIER:]
        if observer is not None:
            for joint in range(JOINTS):
                correct(observer, joint, joints[2 * joint], estimate)
            joints[0::2], joints[1::2] = estimate[:JOINTS], estimate[JOINTS : 2 * JOINTS]
        flat_output(joints, memory[ZETA], memory[ZETA + 1], tracker.gravity, flat)
        inner_law(tracker, joints, memory, v, given)
        if observer is not None:
            predict(observer, given[:3], estimate)
        return np.concatenate([memory, given[first : first + 3], flat[:12]])

    return law


def _joined(crane: Array, law: Array, size: int, kept: list[int]) -> SampledSystem:
    """Crane and law in one system, of the memory only `kept`: set-points mean nothing to ideal drives."""
    state = [*range(10), *(10 + k for k in kept)]
    rows = [*kept, *range(size, size + 15)]
    law_a, law_b = law[np.ix_(rows, state)], law[np.ix_(rows, range(10 + size, 13 + size))]
    n, m = len(state), len(kept)
    a, b = np.zeros((n, n)), np.zeros((n, 6))
    a[:10, :10], b[:10, ARRIVING] = crane[:, :10], crane[:, 10:]
    a[10:], b[10:, V] = law_a[:m], law_b[:m]
    d = np.zeros((15, 6))
    d[:, V] = law_b[m:]
    return SampledSystem(a, b, law_a[m:], d)

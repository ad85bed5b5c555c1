"""Run the control loop: one sample, and a block of samples on any plant.

The loop runs in plain Python, or compiled once for all plants that have kernels. A test ensures that both
give the same results to the last bit. A block is short enough for progress, Ctrl-C and live changes between
blocks.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from cranectl.controllers import JOINTS, ROPE_TAUT, CompiledController, addressed_step, addressed_wait
from cranectl.plants import ADDRESSED, AddressedPlant, Plant
from cranectl.signals import COLUMN
from cranectl.simulate.actuation import (
    Actuation,
    UnloadedDrives,
    actuate,
    brake,
    drive_command,
    follow_set_points,
    follow_velocity,
    take_forces,
    take_set_points,
)
from cranectl.simulate.signal_path import SignalPath, act, sense
from cranectl.status import RunStatus
from cranectl.support import Array, Specialised, jit

RUNNING = int(RunStatus.RUNNING)
SLACK_ROPE = int(RunStatus.SLACK_ROPE)
NON_FINITE = int(RunStatus.NON_FINITE)
WORKSPACE_LEFT = int(RunStatus.WORKSPACE_LEFT)
ENGINE_WARNING = int(RunStatus.ENGINE_WARNING)


class LoopInputs(NamedTuple):
    """Everything a loop needs besides the plant, the record and the memory of the controller."""

    controller: CompiledController
    actuation: Actuation
    integral: Array  # (3,) memory of the actuation: set-points without lead [m/s]
    unloaded: UnloadedDrives  # their accelerations are recorded if the controller commands velocities
    reference: Array  # (N, 15)
    disturbance: Array  # (N, 2) [rad/s²]
    wind: Array  # (N, 6) velocity of the air [m/s], other force on the load [N]
    workspace: Array  # (3, 2) [m]
    stop_outside: bool  # whether the run ends if an axis leaves the workspace
    command_column: int  # first column of the record with the commands of this kind of drives
    recover: bool  # whether the run goes on after the rope was slack
    slack: Array  # (1,) 1 if the rope was slack at the last sample


@jit
def command_controller(inputs, path, state, k, memory, row):
    """Write the controller's command and its set-points into `row`, and return the status of the controller.

    If the rope is slack, the drives brake instead.
    """
    compiled, reference = inputs.controller, inputs.reference[k]
    command = row[COLUMN.input : COLUMN.input + 6]
    follow_velocity(inputs.actuation.masses, inputs.integral, state)
    write_measured(compiled, path, state, k)
    if inputs.slack[0] > 0.0:
        addressed_wait(compiled, state, reference, memory, row)
        brake(inputs.integral, command)
        actuate(inputs.actuation, inputs.integral, command)
        return RUNNING
    if inputs.recover and compiled.slack_place >= 0:
        memory[compiled.slack_place] = ROPE_TAUT
    status = addressed_step(compiled, state, reference, memory, row)
    if status != RUNNING:
        return status
    if compiled.velocity:
        take_set_points(inputs.actuation, inputs.integral, state, command)
    else:
        if compiled.force:
            take_forces(compiled.masses, state, command)
        actuate(inputs.actuation, inputs.integral, command)
    return RUNNING


@jit
def write_measured(compiled, path, state, k):
    """Write the measurements for the controller: joints and estimated disturbances, or encoder readings."""
    for i in range(2 * JOINTS):
        compiled.measured[i] = state[i]
    if path is not None:
        compiled.measured[10], compiled.measured[11] = path.record[k, 10], path.record[k, 11]
    if compiled.encoders:
        for joint in range(JOINTS):
            compiled.measured[joint] = state[2 * joint] if path is None else path.readings[joint]
        for i in range(JOINTS, 12):
            compiled.measured[i] = 0.0


@jit
def control_sample(inputs, path, k, row, memory):
    """Run the controller on the state in `row` of sample `k`; write the rest of the row except the load."""
    if path is None:
        status = command_controller(inputs, path, row[COLUMN.state : COLUMN.state + 10], k, memory, row)
    else:
        measured = path.record[k, : COLUMN.path_command]
        sense(path, row, measured)
        status = command_controller(inputs, path, measured[:10], k, memory, row)
        if status == RUNNING:
            command, actuation = row[COLUMN.input : COLUMN.input + 3], inputs.actuation
            requested = drive_command(
                actuation.masses, inputs.slack[0], inputs.command_column, measured, row, command
            )
            act(path, actuation, inputs.integral, requested, row, path.record[k, COLUMN.path_command :])
    if status == RUNNING and inputs.unloaded.are_read:
        commands = row[COLUMN.input : COLUMN.input + 6]
        follow_set_points(inputs.unloaded, inputs.controller.velocity, commands)
    row[COLUMN.disturbance] = inputs.disturbance[k, 0]
    row[COLUMN.disturbance + 1] = inputs.disturbance[k, 1]
    return status


@jit
def read_commands(inputs, path, k, row):
    """Return the three commands of the drives at sample `k`."""
    if path is None:
        first = inputs.command_column
        return row[first], row[first + 1], row[first + 2]
    else:  # noqa: RET505  the compiler leaves the other branch out only if there is an `else`
        commanded = path.record[k, COLUMN.path_command :]
        return commanded[0], commanded[1], commanded[2]


@jit
def judge_sample(inputs, row):
    """Return RUNNING, or the status with which the run ends at this row."""
    tension = row[COLUMN.tension]
    if not isfinite(tension):
        return NON_FINITE
    inputs.slack[0] = 1.0 if tension <= 0.0 and inputs.recover else 0.0
    if tension <= 0.0 and not inputs.recover:
        return SLACK_ROPE
    if inputs.stop_outside:
        for axis in range(3):
            position = row[COLUMN.state + 2 * axis]
            if position < inputs.workspace[axis, 0] or position > inputs.workspace[axis, 1]:
                return WORKSPACE_LEFT
    return RUNNING


@jit
def complete_rows(k, status):
    """Return the number of valid rows if the run ends at row `k`; this row is invalid if not finite."""
    return k if status == NON_FINITE else k + 1


# (inputs, path, record, memory, first, last) → (complete rows, sample of the end, status)
AdvanceBlock = Callable[[LoopInputs, SignalPath | None, Array, Array, int, int], tuple[int, int, int]]


def compiled_loop(plant: Plant) -> AdvanceBlock:
    """Return the compiled loop for `plant`, or the loop in Python if the plant has no kernels."""
    if plant.kernels is None:
        return python_loop(plant)
    handle = plant.handle
    return CompiledLoop(AddressedPlant.of(plant.kernels, handle), handle)


def python_loop(plant: Plant) -> AdvanceBlock:
    """Return the loop in plain Python, which is slower but easy to debug."""
    return functools.partial(advance_block, plant)


@dataclass(frozen=True)
class CompiledLoop:
    """The compiled loop with one plant."""

    plant: AddressedPlant
    handle: Any  # keeps the arrays alive to which `plant` refers

    def __call__(self, *arguments: Any) -> tuple[int, int, int]:
        """Run a block of samples; arguments and result are those of `AdvanceBlock`."""
        return shared_loop()(self.plant, *arguments)


@functools.cache
def shared_loop() -> Callable[..., tuple[int, int, int]]:
    """Return the loop that serves all plants with kernels."""
    return Specialised(advance_block, "addressed", **ADDRESSED._asdict()).loop()


def measure(plant: Plant, state: Array) -> None:
    """Read the joints of `plant`; the compiled loop replaces this and the next two functions by kernels."""
    plant.measure(state)


def advance(plant: Plant, command: Array, disturbance: Array, wind: Array, load: Array) -> None:
    """Advance `plant` by one control period."""
    plant.advance(np.array(command), disturbance, wind, load)


def warnings(plant: Plant) -> int:
    """Return the number of numerical warnings of `plant`."""
    return plant.warnings()


def advance_block(plant, inputs, path, record, memory, first, last):
    """Run samples `first` to `last` - 1; return (complete rows, sample of the end, status)."""
    for k in range(first, last):
        row = record[k]
        measure(plant, row[COLUMN.state : COLUMN.state + 10])
        status = control_sample(inputs, path, k, row, memory)
        if status != RUNNING:
            return k, k, status
        command = read_commands(inputs, path, k, row)
        disturbance = row[COLUMN.disturbance : COLUMN.disturbance + 2]
        # Load and tension are those at the start of the period: the row is judged by them.
        advance(plant, command, disturbance, inputs.wind[k], row[COLUMN.load : COLUMN.load + 7])
        status = judge_sample(inputs, row)
        if status == RUNNING and warnings(plant) != 0:
            status = ENGINE_WARNING
        if status != RUNNING:
            return complete_rows(k, status), k, status
    return last, last, RUNNING

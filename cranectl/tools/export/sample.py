"""One control sample as a target runs it: observer, controller, set-points and limits, in one function.

The functions are those of the loop, and a test holds both to the same bits. Faults of a rig stay outside: its
delay, its dead zone, wrong gains of drives, and an offset of the rope's encoder.
"""

from collections.abc import Callable
from math import isfinite
from typing import Any, NamedTuple, cast

import numba
import numpy as np
from numba import carray  # type: ignore[attr-defined]
from numba.core.types import Array as ArrayType
from numba.core.types import CPointer, float64
from numba.extending import intrinsic

from cranectl.controllers import EXPECTED, JOINTS, Controller, Observer, Slots, observe, predict, regularity
from cranectl.model import AxisMasses, drive_forces
from cranectl.plants import DRIVES, Drive
from cranectl.signals import State
from cranectl.simulate import (
    Actuation,
    PreparedController,
    SetpointLimits,
    SignalPath,
    actuate,
    limit_command,
    take_forces,
    take_set_points,
)
from cranectl.status import RunStatus
from cranectl.support import Array, CompiledStep

_POINTER: Any = CPointer
RUNNING, CONTROLLER_FAILED = int(RunStatus.RUNNING), int(RunStatus.CONTROLLER_FAILED)
STATE_SIZE = 2 * JOINTS
NUMBERS = Slots(
    observer=len(Observer._fields), lag=3, time_constant=3, moves=3, period=1,
    velocity_limit=3, change_limit=3, masses=len(AxisMasses._fields), controller=0,
)  # fmt: skip
KEPT = Slots(
    estimate=EXPECTED.size, measured=12, given=3, inputs=6, integral=3, previous=3, commanded=6, clock=1,
    controller=0,
)  # fmt: skip


class ControlSample(NamedTuple):
    """The function of one control sample, and its constants."""

    function: Callable[..., int]  # its arguments are those of a controller's step
    parameters: Array
    memory: Array  # at the start of a run
    measured: int  # numbers that it gets: encoder readings (5,), or the state (10,)
    compiled: CompiledStep  # the same function, for this machine

    @property
    def address(self) -> int:
        """The address of the compiled function, valid as long as this object lives."""
        return int(cast(Any, self.compiled).address)


def control_sample_of(
    prepared: PreparedController, controller: Controller, drive: Drive, start: Array
) -> ControlSample:
    """Return the function of one control sample of a run that starts at `start` (10,)."""
    path = SignalPath.of(prepared.nominal, start, drive=drive)
    actuation = Actuation.of(prepared.nominal, drive)
    compiled = prepared.compiled
    parameters = NUMBERS.array(
        observer=path.observer,
        lag=actuation.lag,
        time_constant=actuation.time_constant,
        moves=actuation.moves,
        period=actuation.period,
        velocity_limit=path.limits.velocity,
        change_limit=path.limits.change,
        masses=compiled.masses,
    )
    memory = KEPT.array(estimate=path.estimate, integral=State(start).axis_rates, previous=path.previous)
    function = _sample_function(controller, prepared, drive, observes=path.sensed)
    machine_code = CompiledStep(function)
    machine_code.compile()
    return ControlSample(
        function,
        np.concatenate([parameters, compiled.parameters]),
        np.concatenate([memory, compiled.start]),
        JOINTS if path.sensed else STATE_SIZE,
        machine_code,
    )


@cast(Any, intrinsic)
def pointer_to(_typing, array):
    """Return the pointer to the first number of an array."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return _POINTER(float64)(array) if isinstance(array, ArrayType) else None, generate


def _sample_function(
    controller: Controller, prepared: PreparedController, drive: Drive, *, observes: bool
) -> Callable[..., int]:
    """Return the function of one control sample; Numba and the translation leave out what does not apply."""
    step, compiled = numba.njit(error_model="numpy")(controller.step), prepared.compiled
    size, kept_size, every = len(compiled.parameters), len(compiled.start), compiled.every
    given_size = JOINTS if observes else STATE_SIZE
    encoders, velocity, force = compiled.encoders, compiled.velocity, compiled.force
    checks_itself, gives = compiled.records_all, DRIVES[drive].command
    gives_velocity, gives_force = gives == "velocity", gives == "force"

    def sample(parameters, measured, reference, memory, command):
        """Take one control sample: estimate the state, run the controller, and limit the commands."""
        numbers, kept = carray(parameters, (NUMBERS.size + size,)), carray(memory, (KEPT.size + kept_size,))
        readings = carray(measured, (given_size,))
        state = kept[KEPT.measured : KEPT.given]
        estimate = kept[KEPT.estimate : KEPT.measured]
        given, inputs = kept[KEPT.given : KEPT.inputs], kept[KEPT.inputs : KEPT.integral]
        integral = kept[KEPT.integral : KEPT.previous]
        observer = Observer(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4])
        masses = AxisMasses(
            numbers[NUMBERS.masses],
            numbers[NUMBERS.masses + 1],
            numbers[NUMBERS.masses + 2],
            numbers[NUMBERS.masses + 3],
            numbers[NUMBERS.masses + 4],
        )
        actuation = Actuation(
            numbers[NUMBERS.lag : NUMBERS.time_constant],
            numbers[NUMBERS.time_constant : NUMBERS.moves],
            numbers[NUMBERS.moves : NUMBERS.period],
            numbers[NUMBERS.period],
            masses,
        )
        limits = SetpointLimits(
            numbers[NUMBERS.velocity_limit : NUMBERS.change_limit],
            numbers[NUMBERS.change_limit : NUMBERS.masses],
        )
        if observes:
            observe(observer, readings, estimate, state)
        else:
            for i in range(STATE_SIZE):
                state[i] = readings[i]
        if gives_force:
            for axis in range(3):
                integral[axis] = state[2 * axis + 1]
        if not checks_itself:
            status = regularity(state[:STATE_SIZE], 0.0, 1.0)
            if status != RUNNING:
                return status
        if every == 1 or kept[KEPT.clock] == 0.0:
            seen = np.empty(12) if encoders else state
            if encoders:
                for i in range(12):
                    seen[i] = 0.0
                for joint in range(JOINTS):
                    seen[joint] = readings[joint] if observes else readings[2 * joint]
            status = step(
                pointer_to(numbers[NUMBERS.controller :]),
                pointer_to(seen),
                reference,
                pointer_to(kept[KEPT.controller :]),
                pointer_to(given),
            )
            if status != RUNNING:
                return status
            for axis in range(3):
                if not isfinite(given[axis]):
                    return CONTROLLER_FAILED
        if every > 1:
            kept[KEPT.clock] = kept[KEPT.clock] + 1.0 if kept[KEPT.clock] < every - 1.0 else 0.0
        for axis in range(3):
            inputs[axis] = given[axis]
        if velocity:
            take_set_points(actuation, integral, state, inputs)
        else:
            if force:
                take_forces(masses, state, inputs)
            actuate(actuation, integral, inputs)
        if gives_force:
            intended = drive_forces(masses, state, inputs[0], inputs[1], inputs[2])
        elif gives_velocity:
            intended = (inputs[3], inputs[4], inputs[5])
        else:
            intended = (inputs[0], inputs[1], inputs[2])
        assumed = np.empty(3)
        for axis in range(3):
            assumed[axis] = inputs[axis]
        commanded = kept[KEPT.commanded : KEPT.clock]
        limit_command(
            limits, actuation, integral, intended, kept[KEPT.previous : KEPT.commanded], estimate, assumed,
            commanded,
        )  # fmt: skip
        if observes:
            predict(observer, assumed, estimate)
        for axis in range(3):
            command[axis] = commanded[axis]
        return RUNNING

    return sample

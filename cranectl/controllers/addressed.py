"""Call the step of any controller by address, so that the loop is compiled only once for all controllers.

The step may be written in any language that makes a function with the C signature of `controller`.
"""

from math import isfinite
from typing import Any, NamedTuple, cast

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from cranectl.controllers.controller import ROPE_SLACK, Controller, Nominal, Sizes
from cranectl.controllers.flat import RUNNING, regularity
from cranectl.controllers.preparation import prepared
from cranectl.controllers.registry import OPEN
from cranectl.model import AxisMasses, flat_output, movable_masses
from cranectl.signals import COLUMN
from cranectl.status import RunStatus
from cranectl.support import Array, CompiledStep, ForeignCode, InputError, jit

SLACK_ROPE = int(RunStatus.SLACK_ROPE)
NON_FINITE = int(RunStatus.NON_FINITE)
CONTROLLER_FAILED = int(RunStatus.CONTROLLER_FAILED)


class CompiledController(NamedTuple):
    """A controller in the form that the loop runs: its constants, then its memories."""

    address: int  # of its step; 0 until `bound` sets it
    parameters: Array  # the controller's constants
    reference: Array  # (N + preview, 15); after its end the last row is repeated
    samples: int  # N
    every: int  # control periods between two steps
    encoders: bool  # whether it measures encoder readings; else the state
    velocity: bool  # whether it commands velocities
    force: bool  # whether it commands forces; if neither, accelerations
    masses: AxisMasses  # of the nominal crane, to turn forces into accelerations
    places: NDArray[np.int64]  # indices of the memory that are recorded
    start: Array  # memory at the start of a run
    measured: Array  # (12,)
    command: Array  # (3,) held between two steps
    scratch: Array  # (12,)
    clock: NDArray[np.int64]  # (1,) control samples since the start
    entry: int  # index in `OpenControllers.entries`
    slack_place: int  # index of the memory that says whether the rope is slack; -1: no step while it is
    records_all: bool  # whether `places` has all signals that are recorded of the controller
    outside: bool  # whether it comes from a file, and might write to arrays other than memory and command

    @classmethod
    def of(cls, controller: Controller, nominal: Nominal, recorded: int) -> "CompiledController":
        """Prepare `controller`; `recorded` is the number of signals of it in a run, with load and error."""
        parameters, memory = prepared(controller, nominal)
        reference = nominal.reference
        places = np.array([place for place, _ in controller.logged], dtype=np.int64)
        if controller.records_all:
            places = np.arange(len(memory) - recorded, len(memory))
        if controller.preview:  # the step reads that many rows more, and behind a pointer sees no end
            reference = np.concatenate([reference, np.repeat(reference[-1:], controller.preview, axis=0)])
        # Before there is a step, a function makes it: of a library, another process or an interpreter. It is
        # told how long the five arrays are.
        rows = 15 * (1 + controller.preview)
        sizes = Sizes(len(parameters), 12, rows, len(memory), 3)
        compiled = cls(
            address=0 if controller.entry else _compiled(controller),
            parameters=parameters,
            reference=reference,
            samples=len(nominal.reference),
            every=controller.every,
            encoders=controller.measures == "encoders",
            velocity=controller.command == "velocity",
            force=controller.command == "force",
            masses=movable_masses(nominal.rig),
            places=places,
            start=memory,
            **_memories(),
            entry=len(OPEN.entries),
            slack_place=-1 if controller.slack_place is None else controller.slack_place,
            records_all=controller.records_all,
            outside=controller.origin is not None,
        )
        if controller.entry:
            OPEN.entries.append((controller.entry, sizes))
        return compiled

    def bound(self) -> "CompiledController":
        """Return the controller with the address of its step in this process."""
        if self.address:
            return self
        # Not before: an address is good in one process only, and a controller may be prepared in another.
        entry, sizes = OPEN.entries[self.entry]
        with ForeignCode.environment_kept():
            address = entry(sizes, self.parameters)
        return self._replace(address=ForeignCode.keeping_environment(address))

    def with_own_memory(self) -> "CompiledController":
        """Return the controller with new work arrays; one from outside also gets copies of its constants."""
        own = _memories()
        if self.outside:  # what its step writes there by mistake must not reach another run
            own |= {"parameters": self.parameters.copy(), "reference": self.reference.copy()}
        return self._replace(**own)


def _compiled(controller: Controller) -> int:
    """Return the address of the compiled step; raise InputError with Numba's reason if that fails."""
    try:
        address = CompiledStep.address_of(controller.step)
    except Exception as error:  # Numba raises many unrelated classes
        said, where = CompiledStep.why_not(controller.step, error)
        raise InputError(
            f"the step of {controller.name} cannot be compiled: {said}",
            allowed="Python that Numba compiles: numbers, items of the five arrays, functions of math",
            remedy=f"correct {where}",
        ) from error
    if controller.origin is None:
        return address
    return ForeignCode.keeping_environment(address)


def _memories() -> dict[str, Any]:
    clock = np.zeros(1, dtype=np.int64)
    return {"measured": np.zeros(12), "command": np.zeros(3), "scratch": np.zeros(12), "clock": clock}


@cast(Any, intrinsic)
def _call(_typing, _address, parameters, measured, reference, memory, command):
    """Call the step at an address with pointers to the data of five arrays."""
    from llvmlite import ir

    arrays = (parameters, measured, reference, memory, command)

    # The address is a number and not a part of a type, so one compiled loop serves all controllers.
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        double = ir.DoubleType().as_pointer()
        step = ir.FunctionType(ir.IntType(64), [double] * 5).as_pointer()
        pointers = [
            context.make_array(kind)(context, builder, value).data
            for kind, value in zip(arrays, arguments[1:], strict=True)
        ]
        return builder.call(builder.inttoptr(arguments[0], step), pointers)

    return types.int64(types.int64, *arrays), generate


def _call_uncompiled(address, *arrays):
    """Do what `_call` does in a process where Numba's compiler is switched off."""
    return CompiledStep.call(address, *arrays)


if CompiledStep.UNCOMPILED:
    _call = _call_uncompiled


@jit
def record_controller(compiled, state, reference, memory, row):
    """Write load and error, computed from the joints, and the controller's own signals into `row`."""
    recorded = compiled.places.shape[0]
    if compiled.records_all:  # the flat tracker, which keeps load and error at the end of its memory
        first = memory.shape[0] - recorded
        for i in range(recorded):
            row[COLUMN.flat_output + i] = memory[first + i]
        return
    flat_output(state, 0.0, 0.0, 0.0, compiled.scratch)
    for i in range(6):
        row[COLUMN.flat_output + i] = compiled.scratch[i]
        row[COLUMN.own_error + i] = reference[i] - compiled.scratch[i]
    for i in range(recorded):
        row[COLUMN.own_signals + i] = memory[compiled.places[i]]


@jit
def addressed_step(compiled, state, reference, memory, row):
    """Take one sample of any controller, with the measurements in `compiled.measured`.

    Returns RUNNING, or the status with which the run ends. In this case nothing is written to `row`.
    """
    if not compiled.records_all:  # else the step checks the state itself
        status = regularity(state, 0.0, 1.0)
        if status != RUNNING:
            return status
    sample = compiled.clock[0]
    # Between two steps the command is held: `compiled.command` still has it.
    if compiled.every == 1 or sample % compiled.every == 0:
        rows = compiled.reference[min(sample, compiled.samples - 1)]
        status = _call(
            compiled.address, compiled.parameters, compiled.measured, rows, memory, compiled.command
        )
        if status != 0:
            # A step may end the run for one of these reasons; any other number means that it failed.
            return status if SLACK_ROPE <= status <= NON_FINITE else CONTROLLER_FAILED
        for i in range(3):
            if not isfinite(compiled.command[i]):
                return CONTROLLER_FAILED
    for i in range(3):
        row[COLUMN.input + i] = compiled.command[i]
    compiled.clock[0] += 1
    record_controller(compiled, state, reference, memory, row)
    return RUNNING


@jit
def addressed_wait(compiled, state, reference, memory, row):
    """Take one sample while the rope is slack; only a controller with a `slack_place` takes a step."""
    if compiled.slack_place >= 0:
        memory[compiled.slack_place] = ROPE_SLACK
        rows = compiled.reference[min(compiled.clock[0], compiled.samples - 1)]
        # What it commands and returns is not used, because the drives brake while the rope is slack.
        _call(compiled.address, compiled.parameters, compiled.measured, rows, memory, compiled.command)
    compiled.clock[0] += 1
    record_controller(compiled, state, reference, memory, row)

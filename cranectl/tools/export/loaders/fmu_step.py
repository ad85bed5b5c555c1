"""Take a control step of an FMU by calling its C functions at the addresses among the parameters.

Addresses have 48 bits and fit into doubles. The step sets the inputs, lets the FMU advance by one period of
the controller, and reads the outputs. The functions of FMI 3 differ only in their arguments.
"""

from typing import Any, cast

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from cranectl.controllers import Slots
from cranectl.support import jit

# Addresses, then what does not change, then the source of each input, and for each command the output that it
# is, or HELD, then the SI units in one unit of each input and of each command.
PARAMETERS = Slots(
    instance=1, set=1, exit=1, step=1, get=1, tell=1, in_references=1, out_references=1,
    fmi=1, period=1, inputs=1, outputs=1, sources=0,
)  # fmt: skip
# Steps done, then what fmi3DoStep tells; outputs, those commanded first, and inputs.
MEMORY = Slots(steps=1, event=1, terminate=1, early=1, last=1, values=0)
MEASURED = 12  # sources below it are places of what is measured, from it on places of the reference
HELD = -1  # a command that stays zero
FAILED = -1
DISCARD = 2
FUNCTIONS = {
    PARAMETERS.exit: "ExitInitializationMode",
    PARAMETERS.set: "Set",
    PARAMETERS.step: "DoStep",
    PARAMETERS.get: "Get",
}


@cast(Any, intrinsic)
def _call(_typing, _address, arguments):
    """Return the int that a C function at an address returns; pointers among the arguments are int64."""
    from llvmlite import ir

    def generate(context: Any, builder: Any, _: Any, called_with: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in arguments.types]
        function = ir.FunctionType(ir.IntType(32), kinds).as_pointer()
        values = cgutils.unpack_tuple(builder, called_with[1])
        return builder.call(builder.inttoptr(called_with[0], function), values)

    return types.int32(types.int64, arguments), generate


@cast(Any, intrinsic)
def _place(_typing, pointer, _index):
    """Return the address of a double."""
    from llvmlite import ir

    def generate(_context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.ptrtoint(builder.gep(arguments[0], [arguments[1]]), ir.IntType(64))

    return types.int64(pointer, types.int64), generate


@jit
def _exchange(parameters, function, references, count, values):
    """Set or get `count` numbers at the address `values`; return the status."""
    if count == 0:
        return 0
    c, instance = np.int64(parameters[function]), np.int64(parameters[PARAMETERS.instance])
    numbers = np.int64(parameters[references])
    if parameters[PARAMETERS.fmi] == 2.0:
        return _call(c, (instance, numbers, count, values))
    return _call(c, (instance, numbers, count, values, count))


@jit
def _do_step(parameters, memory):
    """Advance the FMU by one period; return the status."""
    c, instance = np.int64(parameters[PARAMETERS.step]), np.int64(parameters[PARAMETERS.instance])
    period, final = parameters[PARAMETERS.period], np.int32(1)  # no earlier state is restored
    time = memory[MEMORY.steps] * period
    if parameters[PARAMETERS.fmi] == 2.0:
        return _call(c, (instance, time, period, final))
    memory[MEMORY.terminate] = 0.0
    event, terminate = _place(memory, MEMORY.event), _place(memory, MEMORY.terminate)
    reported = (event, terminate, _place(memory, MEMORY.early), _place(memory, MEMORY.last))
    status = _call(c, (instance, time, period, final, *reported))
    # The FMU writes a one-byte flag, the lowest byte of the double.
    return np.int32(DISCARD) if status < DISCARD and memory[MEMORY.terminate] != 0.0 else status


@jit
def _failed(parameters, memory, function, status):
    """Report the failure; return the code of a failed step."""
    time = memory[MEMORY.steps] * parameters[PARAMETERS.period]
    instance = np.int64(parameters[PARAMETERS.instance])
    _call(np.int64(parameters[PARAMETERS.tell]), (instance, np.int64(function), np.int64(status), time))
    return FAILED


def step(parameters, measured, reference, memory, command):
    """Take one control step; the FMU keeps its own state."""
    if parameters[PARAMETERS.instance] == 0.0:
        return FAILED
    inputs, outputs = np.int64(parameters[PARAMETERS.inputs]), np.int64(parameters[PARAMETERS.outputs])
    first, factors = MEMORY.values + outputs, PARAMETERS.sources + inputs + 3
    for i in range(inputs):
        source = np.int64(parameters[PARAMETERS.sources + i])
        value = measured[source] if source < MEASURED else reference[source - MEASURED]
        memory[first + i] = value / parameters[factors + i]
    status = _exchange(parameters, PARAMETERS.set, PARAMETERS.in_references, inputs, _place(memory, first))
    if not 0 <= status < DISCARD:
        return _failed(parameters, memory, PARAMETERS.set, status)
    if memory[MEMORY.steps] == 0.0:  # initialisation ends with the first measured values
        status = _call(np.int64(parameters[PARAMETERS.exit]), (np.int64(parameters[PARAMETERS.instance]),))
        if not 0 <= status < DISCARD:
            return _failed(parameters, memory, PARAMETERS.exit, status)
    status = _do_step(parameters, memory)
    if not 0 <= status < DISCARD:
        return _failed(parameters, memory, PARAMETERS.step, status)
    status = _exchange(
        parameters, PARAMETERS.get, PARAMETERS.out_references, outputs, _place(memory, MEMORY.values)
    )
    if not 0 <= status < DISCARD:
        return _failed(parameters, memory, PARAMETERS.get, status)
    memory[MEMORY.steps] += 1.0
    for i in range(3):
        output = np.int64(parameters[PARAMETERS.sources + inputs + i])
        scale = parameters[factors + inputs + i]
        command[i] = 0.0 if output == HELD else scale * memory[MEMORY.values + output]
    return 0

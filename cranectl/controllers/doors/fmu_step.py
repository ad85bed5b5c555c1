"""The step of every FMU: its C functions, called by the addresses that the parameters hold.

Addresses have 48 bits and fit into doubles. Inputs are set, the FMU does a step of the law's period, outputs
are read. FMI 3's functions differ by arguments only.
"""

from typing import Any, cast

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from cranectl.support.jit import jit

# Places of the parameters: addresses, then what does not change, then the source of each input.
INSTANCE, SET, EXIT, STEP, GET, TELL, IN_REFERENCES, OUT_REFERENCES = range(8)
FMI, PERIOD, INPUTS, OUTPUTS, SOURCES = range(8, 13)
# Places of the memory: steps done, then what fmi3DoStep tells; outputs, those commanded first, and inputs.
STEPS, EVENT, TERMINATE, EARLY, LAST, VALUES = range(6)
MEASURED = 12  # sources below it are places of what is measured, from it on places of the reference
FAILED = -1
DISCARD = 2
FUNCTIONS = {EXIT: "ExitInitializationMode", SET: "Set", STEP: "DoStep", GET: "Get"}


@cast(Any, intrinsic)
def _call(_typing, _address, arguments):
    """The int that a C function at an address returns; pointers among the arguments are int64."""
    from llvmlite import ir

    def generate(context: Any, builder: Any, _: Any, given: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in arguments.types]
        function = ir.FunctionType(ir.IntType(32), kinds).as_pointer()
        values = cgutils.unpack_tuple(builder, given[1])
        return builder.call(builder.inttoptr(given[0], function), values)

    return types.int32(types.int64, arguments), generate


@cast(Any, intrinsic)
def _place(_typing, pointer, _index):
    """The address of a double."""
    from llvmlite import ir

    def generate(_context: Any, builder: Any, _: Any, given: Any) -> Any:
        return builder.ptrtoint(builder.gep(given[0], [given[1]]), ir.IntType(64))

    return types.int64(pointer, types.int64), generate


@jit
def _exchange(parameters, function, references, count, values):
    """Set or get `count` numbers at the address `values`; returns the status."""
    c, instance = np.int64(parameters[function]), np.int64(parameters[INSTANCE])
    numbers = np.int64(parameters[references])
    if parameters[FMI] == 2.0:
        return _call(c, (instance, numbers, count, values))
    return _call(c, (instance, numbers, count, values, count))


@jit
def _do_step(parameters, memory):
    """Do the step; returns the status."""
    c, instance = np.int64(parameters[STEP]), np.int64(parameters[INSTANCE])
    time, period, final = memory[STEPS] * parameters[PERIOD], parameters[PERIOD], np.int32(1)
    if parameters[FMI] == 2.0:
        return _call(c, (instance, time, period, final))
    memory[TERMINATE] = 0.0
    event, terminate = _place(memory, EVENT), _place(memory, TERMINATE)
    told = (event, terminate, _place(memory, EARLY), _place(memory, LAST))
    status = _call(c, (instance, time, period, final, *told))
    # Its byte is the lowest of the double.
    return np.int32(DISCARD) if status < DISCARD and memory[TERMINATE] != 0.0 else status


@jit
def _failed(parameters, memory, function, status):
    """Have it told."""
    time = memory[STEPS] * parameters[PERIOD]
    instance = np.int64(parameters[INSTANCE])
    _call(np.int64(parameters[TELL]), (instance, np.int64(function), np.int64(status), time))
    return FAILED


def step(parameters, measured, reference, memory, command):
    """One step of the law, as all have it; the FMU's state is its own."""
    if parameters[INSTANCE] == 0.0:
        return FAILED
    inputs, outputs = np.int64(parameters[INPUTS]), np.int64(parameters[OUTPUTS])
    first = VALUES + outputs
    for i in range(inputs):
        source = np.int64(parameters[SOURCES + i])
        memory[first + i] = measured[source] if source < MEASURED else reference[source - MEASURED]
    status = _exchange(parameters, SET, IN_REFERENCES, inputs, _place(memory, first))
    if status >= DISCARD:
        return _failed(parameters, memory, SET, status)
    if memory[STEPS] == 0.0:  # initialised with what is measured first
        status = _call(np.int64(parameters[EXIT]), (np.int64(parameters[INSTANCE]),))
        if status >= DISCARD:
            return _failed(parameters, memory, EXIT, status)
    status = _do_step(parameters, memory)
    if status >= DISCARD:
        return _failed(parameters, memory, STEP, status)
    status = _exchange(parameters, GET, OUT_REFERENCES, outputs, _place(memory, VALUES))
    if status >= DISCARD:
        return _failed(parameters, memory, GET, status)
    memory[STEPS] += 1.0
    for i in range(3):
        command[i] = memory[VALUES + i]
    return 0

"""Call the kernels of any plant by address, so that the loop is compiled only once for all plants.

For each type of handle the kernels of a plant are compiled to one C function, which contains them inline.
"""

import functools
import hashlib
from typing import Any, NamedTuple, cast

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from cranectl.plants.plant import Kernels, Plant
from cranectl.support import Array, Block, CompiledStep, Specialised, jit

# What `_step` takes: block, action, state, three commands, then disturbance, wind and load. A C function
# takes neither arrays nor tuples, so arrays pass as pointers and the commands one by one.
_NUMBERS: Any = types.CPointer(types.float64)
_ARGUMENTS = (_NUMBERS, types.int64, _NUMBERS, *[types.float64] * 3, *[_NUMBERS] * 3)
MEASURE, ADVANCE = 0, 1  # actions of `_step`
array_at = Block.array_at  # compiled code looks up no members


class AddressedPlant(NamedTuple):
    """A plant in the form that compiled code steps; its caller must keep the handle alive."""

    address: int  # of its compiled functions
    block: Array  # the packed handle
    warned: NDArray[np.int64]  # (1,) numerical warnings by the end of the last period

    @classmethod
    def of(cls, kernels: Kernels, handle: Any) -> "AddressedPlant":
        """Return the plant of `kernels` and `handle`; numbers of the handle are copied, arrays are shared."""
        warned = np.zeros(1, dtype=np.int64)
        if CompiledStep.UNCOMPILED:  # there are no addresses; `_call_uncompiled` calls the kernels themselves
            return cls(cast(Any, kernels), handle, warned)
        block = Block(handle)
        return cls(_address(kernels, block.kind), block.numbers, warned)

    @staticmethod
    def object_file(plant: Plant, name: str) -> tuple[bytes, dict[str, int]]:
        """Return an object file for use without Python, and the actions of its function `name`.

        The function is that which `_address` compiles. Its second argument is one of the actions.
        """
        if plant.kernels is None:
            raise TypeError(f"the {plant.name} plant has no kernels")
        unpack = Block.unpacker(Block(plant.handle).kind)
        specialised = Specialised(_step, name, unpack=unpack, **plant.kernels._asdict())
        return specialised.object_code(_ARGUMENTS), {"MEASURE": MEASURE, "ADVANCE": ADVANCE}


@functools.cache
def _address(kernels: Kernels, kind: Any) -> int:
    """Compile `_step` with `kernels` for handles of type `kind`; return its address. Both name it on disk."""
    # Python's hash() differs from process to process, and then no process would find the file of another.
    names = [f"{kernel.__module__}.{kernel.__qualname__}" for kernel in kernels]
    name = hashlib.sha256(" ".join([*names, str(kind)]).encode()).hexdigest()[:16]
    return Specialised(_step, name, unpack=Block.unpacker(kind), **kernels._asdict()).address(_ARGUMENTS)


# `_address` replaces these names by the kernels of a plant when it compiles `_step`.
unpack: Any = None
measure: Any = None
advance: Any = None
warnings: Any = None


def _step(block, action, state, bridge, trolley, winch, disturbance, wind, load):
    """Measure or advance the plant whose handle is packed in `block`; return its number of warnings."""
    handle = unpack(block)
    if action == MEASURE:
        measure(handle, array_at(state, 10))
        return 0
    command = (bridge, trolley, winch)
    advance(handle, command, array_at(disturbance, 2), array_at(wind, 6), array_at(load, 7))
    return warnings(handle)


@cast(Any, intrinsic)
def _call(_typing, _address, block, _action, state, command, disturbance, wind, load):
    """Call `_step` at an address, with pointers to the data of contiguous arrays."""
    if any(array.layout != "C" for array in (block, state, disturbance, wind, load)):
        return None  # Numba refuses the call: behind a pointer, `_step` cannot see strides

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        from llvmlite import ir

        def pointer(kind: Any, array: Any) -> Any:
            return context.make_array(kind)(context, builder, array).data

        values = [
            pointer(block, arguments[1]),
            arguments[2],
            pointer(state, arguments[3]),
            *[builder.extract_value(arguments[4], axis) for axis in range(3)],
            *map(pointer, (disturbance, wind, load), arguments[5:]),
        ]
        # The address is a number and not a part of a type, so one compiled loop serves all plants.
        step = ir.FunctionType(ir.IntType(64), [argument.type for argument in values]).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], step), values)

    integer = types.int64
    return integer(integer, block, integer, state, command, disturbance, wind, load), generate


def _call_uncompiled(kernels, handle, action, state, *command_to_load):
    """Do what `_call` does in a process where Numba's compiler is switched off."""
    if action == MEASURE:
        kernels.measure(handle, state)
        return 0
    kernels.advance(handle, *command_to_load)
    return int(kernels.warnings(handle))


if CompiledStep.UNCOMPILED:
    _call = _call_uncompiled


@jit
def measure_addressed(plant, state):
    """Write the joint positions and velocities (10,) into `state`."""
    # To measure reads none of the arguments after `state`; any array will do in their places.
    _call(plant.address, plant.block, MEASURE, state, (0.0, 0.0, 0.0), state, state, state)


@jit
def advance_addressed(plant, command, disturbance, wind, load):
    """Advance by one control period; see `Plant.advance`."""
    # The first `load` stands in place of the state, which is not read. Kernels return nothing, so the number
    # of warnings is kept here until the loop asks for it.
    plant.warned[0] = _call(plant.address, plant.block, ADVANCE, load, command, disturbance, wind, load)


@jit
def addressed_warnings(plant):
    """Return the number of numerical warnings, or -1 if a kernel raised an exception."""
    return plant.warned[0]


ADDRESSED = Kernels(measure_addressed, advance_addressed, addressed_warnings)  # they take an AddressedPlant

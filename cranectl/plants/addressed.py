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
from cranectl.support import (
    UNCOMPILED,
    Array,
    array_at,
    jit,
    jit_address,
    jit_called,
    jit_object,
    packed,
    type_of,
    unpacker,
)

_NUMBERS: Any = types.CPointer(types.float64)
_ARGUMENTS = (_NUMBERS, types.int64, _NUMBERS, *[types.float64] * 3, *[_NUMBERS] * 3)
MEASURE, ADVANCE = 0, 1  # what a call asks of a plant


class AddressedPlant(NamedTuple):
    """A plant in the form that compiled code steps; its caller must keep the handle alive."""

    address: int  # of its compiled functions
    block: Array  # the packed handle
    warned: NDArray[np.int64]  # (1,) numerical warnings by the end of the last period


def addressed_plant(kernels: Kernels, handle: Any) -> AddressedPlant:
    """Return the plant of `kernels` and `handle`; numbers of the handle are copied, arrays are shared."""
    warned = np.zeros(1, dtype=np.int64)
    if UNCOMPILED:
        return AddressedPlant(cast(Any, kernels), handle, warned)
    return AddressedPlant(_address(kernels, type_of(handle)), packed(handle), warned)


@functools.cache
def _address(kernels: Kernels, kind: Any) -> int:
    """Compile `_step` with `kernels` for handles of type `kind`; return its address. Both name it on disk."""
    names = [f"{kernel.__module__}.{kernel.__qualname__}" for kernel in kernels]
    name = hashlib.sha256(" ".join([*names, str(kind)]).encode()).hexdigest()[:16]
    return jit_address(_step, name, _ARGUMENTS, unpack=unpacker(kind), **kernels._asdict())


def plant_object(plant: Plant, name: str) -> bytes:
    """Return an object file with the function `name` that `_address` compiles, for use without Python."""
    if plant.kernels is None:
        raise TypeError(f"the {plant.name} plant has no kernels")
    unpack = unpacker(type_of(plant.handle))
    return jit_object(_step, name, _ARGUMENTS, unpack=unpack, **plant.kernels._asdict())


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
        return None

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


if UNCOMPILED:
    _call = _call_uncompiled


@jit
def measure_addressed(plant, state):
    """Write the joint positions and velocities (10,) into `state`."""
    _call(plant.address, plant.block, MEASURE, state, (0.0, 0.0, 0.0), state, state, state)


@jit
def advance_addressed(plant, command, disturbance, wind, load):
    """Advance by one control period; see `Plant.advance`."""
    plant.warned[0] = _call(plant.address, plant.block, ADVANCE, load, command, disturbance, wind, load)


@jit
def addressed_warnings(plant):
    """Return the number of numerical warnings, or -1 if a kernel raised an exception."""
    return plant.warned[0]


@jit_called
def step_each(plant, state, load, ports, winds, following):
    """Write the states one control period after `ports`, see `next_states`, into `following`.

    `state` is that of `plant`; `load` (7,) is work space.
    """
    size = state.shape[0]
    for k in range(len(following)):
        for i in range(size):
            state[i] = ports[k, i]
        command = (ports[k, size], ports[k, size + 1], ports[k, size + 2])
        advance_addressed(plant, command, ports[k, size + 3 :], winds[k], load)
        for i in range(size):
            following[k, i] = state[i]


def next_states(plant: Plant, ports: Array, winds: Array) -> Array:
    """Return the states (N, s) of a plant one control period after `ports`, in `winds` (N, 6).

    `ports` (N, s + 5) has its state, the command and the disturbance of the angles. The plant must have
    kernels, whose handle has the state.
    """
    assert plant.kernels is not None
    following, handle = np.zeros((len(ports), ports.shape[1] - 5)), plant.handle
    ports, winds = np.ascontiguousarray(ports), np.ascontiguousarray(winds)
    step_each(addressed_plant(plant.kernels, handle), handle.state, np.zeros(7), ports, winds, following)
    return following

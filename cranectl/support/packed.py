"""Pass numbers and arrays of any types to compiled code as one block of memory.

A block holds 8 bytes for each number. For each array it holds the address of the data, the shape and the
strides. It does not keep arrays alive: the user of a block must keep the packed objects.
"""

import functools
import struct
from collections.abc import Iterator
from itertools import count
from typing import Any, cast

import numba
import numpy as np
from numba import types
from numba._dispatcher import compute_fingerprint
from numba.extending import intrinsic

from cranectl.support.arrays import Array

_WORD = 64  # bits
_TYPES: dict[bytes, Any] = {}  # by what Numba itself knows them by


@cast(Any, intrinsic)
def _pointer_after(_typing, pointer, words):  # noqa: ARG001
    """Return, in compiled code, a pointer to the block that lies `words` numbers after `pointer`."""

    def generate(_context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.gep(arguments[0], [arguments[1]])

    return pointer(pointer, types.int64), generate


@cast(Any, intrinsic)
def _array_at(_typing, pointer, length):
    """Return, in compiled code, the array of `length` doubles at `pointer`; `length` is a constant."""
    kind = types.Array(types.float64, 1, "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        length = context.cast(builder, arguments[1], signature.args[1], types.intp)
        size = context.get_constant(types.intp, np.dtype(float).itemsize)
        return _array(context, builder, kind, arguments[0], [length, size])

    return kind(pointer, length), generate


def _array(context: Any, builder: Any, kind: Any, data: Any, extent: list[Any]) -> Any:
    """Generate code that makes an array which counts no references; `extent` is shape and strides."""
    from numba.np.arrayobj import populate_array

    array = context.make_array(kind)(context, builder)
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    itemsize = context.get_constant(types.intp, size)
    shape, strides = extent[: kind.ndim], extent[kind.ndim :]
    populate_array(array, data=data, shape=shape, strides=strides, itemsize=itemsize, meminfo=None)
    return array._getvalue()


def _read(context: Any, builder: Any, kind: Any, block: Any, places: Iterator[int]) -> Any:
    """Generate code that reads a value of Numba's type `kind` from the next `places` of a block."""
    from llvmlite import ir

    integer = ir.IntType(_WORD)

    def word(form: Any) -> Any:
        pointer = builder.gep(block, [ir.Constant(integer, next(places))])
        return builder.load(builder.bitcast(pointer, form.as_pointer()))

    if isinstance(kind, types.NoneType):
        return context.get_dummy_value()
    if isinstance(kind, types.BaseTuple):
        parts = [_read(context, builder, part, block, places) for part in cast(Any, kind)]
        return context.make_tuple(builder, kind, parts)
    if isinstance(kind, types.Array):
        item = context.get_data_type(kind.dtype)
        data = builder.inttoptr(word(integer), item.as_pointer())
        return _array(context, builder, kind, data, [word(integer) for _ in range(2 * kind.ndim)])
    if isinstance(kind, types.Float):
        return context.cast(builder, word(ir.DoubleType()), types.float64, kind)
    return context.cast(builder, word(integer), types.int64, kind)


class Block:
    """Numbers and arrays, None, and tuples of all these, as one block of memory.

    Raises TypeError for anything else.
    """

    pointer_after = _pointer_after
    array_at = _array_at

    def __init__(self, value: Any) -> None:
        """Pack `value`, which the user must keep."""
        self.numbers = _packed(value)
        # For nested tuples `typeof` takes a hundred times longer than the key, which dispatchers use too.
        key = compute_fingerprint(value)
        if key not in _TYPES:
            _TYPES[key] = numba.typeof(value)
        self.kind = _TYPES[key]  # Numba's type of it

    @staticmethod
    def places(value: Any) -> Iterator[tuple[int, Any]]:
        """Yield the numbers and arrays of `value`, each with its place in the block; None is left out."""
        place = 0
        for leaf in _leaves(value):
            yield place, leaf
            place += _words(leaf)

    @staticmethod
    @functools.cache
    def unpacker(kind: Any) -> Any:
        """Return a compiled function that reads a value of Numba's type `kind` from a pointer to a block."""

        @cast(Any, intrinsic)
        def unpack(_typing, pointer):
            def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
                return _read(context, builder, kind, arguments[0], count())

            return kind(pointer), generate

        return unpack


def _packed(value: Any) -> Array:
    """Return the block of `value`."""
    forms: list[str] = []
    words: list[float | int] = []
    for _, leaf in Block.places(value):
        if isinstance(leaf, np.ndarray):
            forms.append(f"{_words(leaf)}q")
            words += (leaf.ctypes.data, *leaf.shape, *leaf.strides)
        elif isinstance(leaf, float | np.floating):
            forms.append("d")
            words.append(float(leaf))
        elif isinstance(leaf, int | np.integer | np.bool_):
            forms.append("q")
            words.append(int(leaf))
        else:
            raise TypeError(f"{type(leaf).__name__} is neither a number nor an array, and cannot be packed")
    return np.frombuffer(bytearray(struct.pack("".join(forms), *words) or bytes(8)))


def _leaves(value: Any) -> Iterator[Any]:
    """Yield what nested tuples hold; None is left out."""
    if isinstance(value, tuple):
        for part in value:
            yield from _leaves(part)
    elif value is not None:
        yield value


def _words(leaf: Any) -> int:
    """Return how many numbers describe a leaf; those of an array are its address, shape and strides."""
    return 1 + 2 * leaf.ndim if isinstance(leaf, np.ndarray) else 1

"""What is packed in a block is what compiled code finds there."""

import ctypes
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import types

from cranectl.support.jit import Specialised
from cranectl.support.packed import Block


class Part(NamedTuple):
    """A value of each kind that plants have."""

    flag: bool
    number: float
    nothing: None
    whole: int
    triple: tuple[float, float, float]
    grid: Any  # (2, 3), with gaps
    small: Any  # (4,) int32


class Whole(NamedTuple):
    """A part in a part, with something behind it."""

    part: Part
    last: float


unpack: Any = None
array_at = Block.array_at


def _look(block, found):  # type: ignore[no-untyped-def]
    part, last = unpack(block)
    out = array_at(found, 8)
    out[0], out[1], out[2] = 1.0 if part.flag else 0.0, part.number, part.whole
    out[3], out[4] = part.triple[2], part.grid[1, 2]
    out[5], out[6], out[7] = part.small[3], part.grid.shape[1] + part.small.shape[0], last
    if part.nothing is None:
        part.grid[0, 1] = -7.0
    return 5


def test_compiled_code_finds_what_was_packed_and_shares_its_arrays() -> None:
    grid = np.arange(24.0).reshape(4, 6)[::2, ::2]
    small = np.array([1, 2, 3, -4], dtype=np.int32)
    whole = Whole(Part(True, 2.5, None, -3, (0.1, 0.2, 0.3), grid, small), np.float64(9.75))
    pointer: Any = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
    block, found = Block(whole), np.zeros(8)
    address = Specialised(_look, "test", unpack=Block.unpacker(block.kind)).address((pointer, pointer))
    call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)(address)
    assert call(block.numbers.ctypes.data, found.ctypes.data) == 5
    assert found.tolist() == [1.0, 2.5, -3.0, 0.3, grid[1, 2], -4.0, 7.0, 9.75]
    assert grid[0, 1] == -7.0


def test_only_numbers_arrays_and_tuples_are_packed() -> None:
    assert Block(()).numbers.shape == (1,)
    with pytest.raises(TypeError, match="str is neither a number nor an array"):
        Block((1.0, ("text",)))

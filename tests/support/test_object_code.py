"""A function that is compiled to an object file needs no Python; plants as FMUs are made of such files."""

from typing import Any

import pytest
from numba import types

from cranectl.support.jit import Specialised
from cranectl.support.packed import Block

array_at = Block.array_at
POINTER: Any = types.CPointer(types.float64)  # type: ignore[no-untyped-call]


def needing(pointer, places):  # type: ignore[no-untyped-def]
    """Print, which only Python can do."""
    print(array_at(pointer, 2)[0], places)
    return 0


def test_a_function_that_needs_python_is_refused() -> None:
    with pytest.raises(TypeError, match=r"needs .*Py"):
        Specialised(needing, "needing").object_code((POINTER, types.int64))

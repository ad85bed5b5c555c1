"""Steps that stay in the interpreter: the compiled loop calls them by address all the same.

What a callback raises would be printed and its result be garbage. So it is caught here, told once, and the
step says that it failed.
"""

import ctypes
import os
import traceback
from collections.abc import Callable

import numpy as np

from cranectl.controllers.controller import Sizes
from cranectl.support.arrays import Array

FAILED = -1
_DOUBLES = ctypes.POINTER(ctypes.c_double)
_STEP = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 5)
_KEPT: list[object] = []  # what has an address must not be collected


def called_back(step: Callable[..., int], name: str, sizes: Sizes) -> int:
    """The address of a C function that calls `step` with arrays; all but memory and command are read-only."""
    lengths = tuple(sizes)
    known: dict[tuple[int, int], Array] = {}

    def array(address: int, k: int) -> Array:
        found = known.get((address, k))
        if found is None:
            found = np.ctypeslib.as_array(ctypes.cast(address, _DOUBLES), (lengths[k],))
            found.flags.writeable = k > 2
            if k != 2:  # the rows of the reference are many
                known[address, k] = found
        return found

    def call(*addresses: int) -> int:
        try:
            return int(step(*(array(address, k) for k, address in enumerate(addresses))))
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            where = f" in {last.filename.rpartition('/')[2]}:{last.lineno}"
            if isinstance(error, OSError):  # comes from outside
                where = ""
            text = f"cranectl: {name} failed{where}: {type(error).__name__}: {error}\n"
            os.write(2, text.encode())  # a forked process may not wait for the lock of sys.stderr
            return FAILED

    function = _STEP(call)
    _KEPT.append(function)
    address = ctypes.cast(function, ctypes.c_void_p).value
    assert address is not None
    return address

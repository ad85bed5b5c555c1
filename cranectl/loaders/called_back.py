"""Let the compiled loop call a step that runs in the Python interpreter.

ctypes would only print an exception of a callback, and the callback's result would be garbage. So exceptions
are caught and reported here, and the step returns that it failed.
"""

import ctypes
from collections.abc import Callable

import numpy as np

from cranectl.controllers.controller import Sizes
from cranectl.support.arrays import Array
from cranectl.support.compiled_step import FAILED, report_failure

_DOUBLES = ctypes.POINTER(ctypes.c_double)
_STEP = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 5)
_KEPT: list[object] = []  # callbacks are called by address, so they must not be collected


def called_back(step: Callable[..., int], name: str, sizes: Sizes) -> int:
    """Return the address of a C function that calls `step`; only memory and command are writable."""
    lengths = tuple(sizes)
    known: dict[tuple[int, int], Array] = {}

    def array(address: int, k: int) -> Array:
        view = known.get((address, k))
        if view is None:
            view = np.ctypeslib.as_array(ctypes.cast(address, _DOUBLES), (lengths[k],))
            view.flags.writeable = k > 2
            if k != 2:  # the rows of the reference are many
                known[address, k] = view
        return view

    def call(*addresses: int) -> int:
        try:
            returned = step(*(array(address, k) for k, address in enumerate(addresses)))
            if not isinstance(returned, int | np.integer | np.bool_):
                raise TypeError(f"the step returns {returned!r}, which is no whole number")
            if abs(int(returned)) >= 2**63:  # its lowest 64 bits would count
                raise OverflowError(f"the step returns {returned}")
            return int(returned)
        except BaseException as error:  # whatever goes on from here would be ignored
            report_failure(name, error)
            return FAILED

    function = _STEP(call)
    _KEPT.append(function)
    return ctypes.cast(function, ctypes.c_void_p).value or 0

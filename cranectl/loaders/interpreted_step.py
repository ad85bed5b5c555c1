"""Let the compiled loop call a controller step that runs in the Python interpreter.

If a callback raises an exception, ctypes only prints it and returns an arbitrary number. So this module
catches and reports each exception, and the step returns a failure code.
"""

import ctypes
from collections.abc import Callable

import numpy as np

from cranectl.controllers import Sizes
from cranectl.support import Array, CompiledStep

_DOUBLES = ctypes.POINTER(ctypes.c_double)
_STEP = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 5)
_CALLBACKS: list[object] = []  # called by address, so they must not be collected


def callback_address(step: Callable[..., int], name: str, sizes: Sizes) -> int:
    """Return the address of a C function that calls `step`; only memory and command are writable."""
    lengths = tuple(sizes)
    views: dict[tuple[int, int], Array] = {}

    def array(address: int, k: int) -> Array:
        view = views.get((address, k))
        if view is None:
            view = np.ctypeslib.as_array(ctypes.cast(address, _DOUBLES), (lengths[k],))
            view.flags.writeable = k > 2
            if k != 2:  # not for the reference, which has a new address at each sample
                views[address, k] = view
        return view

    def call(*addresses: int) -> int:
        try:
            returned = step(*(array(address, k) for k, address in enumerate(addresses)))
            if not isinstance(returned, int | np.integer | np.bool_):
                raise TypeError(f"the step returns {returned!r}, which is no whole number")
            if abs(int(returned)) >= 2**63:  # C would keep only the lowest 64 bits
                raise OverflowError(f"the step returns {returned}")
            return int(returned)
        except BaseException as error:  # ctypes would ignore any exception that passes on
            CompiledStep.report(name, error)
            return CompiledStep.FAILED

    function = _STEP(call)
    _CALLBACKS.append(function)
    return ctypes.cast(function, ctypes.c_void_p).value or 0

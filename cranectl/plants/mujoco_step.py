"""MuJoCo's `mj_step` as a function that compiled code can call.

The symbol is resolved at link time from the library that the `mujoco` package has loaded, so no C compiler
and no struct offsets are needed and Numba's cache keeps working. An error inside the library ends the
process: callers take their first step through the Python binding.

The binding gives the engine a clock, which it reads at every part of a step to fill `mjData.timer`: a quarter
of the time of a step as small as the crane's. Loading this module takes it away again, for the whole process.
"""

import ctypes
from pathlib import Path

import llvmlite.binding as llvm
import mujoco
from numba import types

from cranectl.errors import CranectlError


def _library() -> str:
    candidates = sorted(Path(mujoco.__file__).parent.glob("*mujoco*.so*"))
    candidates += sorted(Path(mujoco.__file__).parent.glob("*mujoco*.dylib"))
    candidates += sorted(Path(mujoco.__file__).parent.glob("mujoco.dll"))
    for path in candidates:
        if path.name.startswith(("libmujoco", "mujoco")):
            return str(path)
    raise CranectlError("the mujoco package carries no engine library that compiled code could call")


def _stop_clock(library: str) -> None:
    ctypes.c_void_p.in_dll(ctypes.CDLL(library), "mjcb_time").value = None


llvm.load_library_permanently(_library())
_stop_clock(_library())

# mj_step(model address, data address)
mj_step = types.ExternalFunction("mj_step", types.void(types.intp, types.intp))

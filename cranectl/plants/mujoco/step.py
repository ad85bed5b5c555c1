"""Functions of MuJoCo's engine that compiled code can call.

The symbols are resolved at link time from the library that the `mujoco` package has loaded, so no C compiler
and no struct offsets are needed and Numba's cache keeps working. An error inside the library ends the
process: callers take their first step through the Python binding.

The binding gives the engine a clock, which it reads at every part of a step to fill `mjData.timer`: a quarter
of the time of a step as small as the crane's. Loading this module takes it away again, for the whole process.
"""

import ctypes
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import mujoco
import numba
from numba import types

from cranectl.support.errors import CranectlError

ADDRESS, FLAG, NUMBER = types.intp, types.int32, types.float64
_IN_PYTHON = {ADDRESS: ctypes.c_ssize_t, FLAG: ctypes.c_int, NUMBER: ctypes.c_double}
_numba_config: Any = numba.config


def _library() -> str:
    candidates = sorted(Path(mujoco.__file__).parent.glob("*mujoco*.so*"))
    candidates += sorted(Path(mujoco.__file__).parent.glob("*mujoco*.dylib"))
    candidates += sorted(Path(mujoco.__file__).parent.glob("mujoco.dll"))
    for path in candidates:
        if path.name.startswith(("libmujoco", "mujoco")):
            return str(path)
    raise CranectlError("the mujoco package carries no engine library that compiled code could call")


_LIBRARY = _library()
llvm.load_library_permanently(_LIBRARY)
ctypes.c_void_p.in_dll(ctypes.CDLL(_LIBRARY), "mjcb_time").value = None  # the clock


def _engine(name: str, *arguments: Any) -> Any:
    """The engine's function `name`, which returns nothing; callable from Python where nothing is compiled."""
    if not _numba_config.DISABLE_JIT:
        return types.ExternalFunction(name, types.void(*arguments))
    function = getattr(ctypes.CDLL(_LIBRARY), name)
    function.argtypes, function.restype = [_IN_PYTHON[kind] for kind in arguments], None
    return function


# All take the addresses of model and data; what follows them is said here.
mj_step = _engine("mj_step", ADDRESS, ADDRESS)
mj_check_pos = _engine("mj_checkPos", ADDRESS, ADDRESS)
mj_check_vel = _engine("mj_checkVel", ADDRESS, ADDRESS)
mj_check_acc = _engine("mj_checkAcc", ADDRESS, ADDRESS)
mj_fwd_position = _engine("mj_fwdPosition", ADDRESS, ADDRESS)
mj_fwd_velocity = _engine("mj_fwdVelocity", ADDRESS, ADDRESS)
mj_sensor_pos = _engine("mj_sensorPos", ADDRESS, ADDRESS)
mj_sensor_vel = _engine("mj_sensorVel", ADDRESS, ADDRESS)
# ... stage up to which nothing is computed anew, whether sensors are left out
mj_forward_skip = _engine("mj_forwardSkip", ADDRESS, ADDRESS, FLAG, FLAG)
# model, positions that change, velocities, time [s]
mj_integrate_pos = _engine("mj_integratePos", ADDRESS, ADDRESS, ADDRESS, NUMBER)

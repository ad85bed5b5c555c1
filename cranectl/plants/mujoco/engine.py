"""Call the engine's functions from compiled code.

Their symbols are resolved at link time from the library that the `mujoco` package has loaded. So neither a C
compiler nor struct offsets are needed, and Numba's cache works. An error inside the library ends the process.
Therefore callers take their first step through the Python binding.

The binding gives the engine a clock to fill `mjData.timer`. Reading it takes a quarter of the time of a step
as small as the crane's. Loading this module removes the clock, for the whole process.
"""

import ctypes
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import mujoco
import numba
from numba import types

from cranectl.support import CranectlError

ADDRESS, FLAG, NUMBER = types.intp, types.int32, types.float64
_IN_PYTHON = {ADDRESS: ctypes.c_ssize_t, FLAG: ctypes.c_int, NUMBER: ctypes.c_double}
_numba_config: Any = numba.config


def _library() -> str:
    for pattern in ("*mujoco*.so*", "*mujoco*.dylib", "mujoco.dll"):
        for path in sorted(Path(mujoco.__file__).parent.glob(pattern)):
            if path.name.startswith(("libmujoco", "mujoco")):
                return str(path)
    raise CranectlError("the mujoco package contains no engine library that compiled code can call")


_LIBRARY = _library()
llvm.load_library_permanently(_LIBRARY)
ctypes.c_void_p.in_dll(ctypes.CDLL(_LIBRARY), "mjcb_time").value = None  # the clock


def _engine(name: str, *arguments: Any) -> Any:
    """Return the engine's function `name`, which returns nothing: for compiled code or through ctypes."""
    if not _numba_config.DISABLE_JIT:
        return types.ExternalFunction(name, types.void(*arguments))
    function = getattr(ctypes.CDLL(_LIBRARY), name)
    function.argtypes, function.restype = [_IN_PYTHON[kind] for kind in arguments], None
    return function


# All take the addresses of model and data first; comments give further arguments.
mj_step = _engine("mj_step", ADDRESS, ADDRESS)
mj_check_pos = _engine("mj_checkPos", ADDRESS, ADDRESS)
mj_check_vel = _engine("mj_checkVel", ADDRESS, ADDRESS)
mj_check_acc = _engine("mj_checkAcc", ADDRESS, ADDRESS)
mj_fwd_position = _engine("mj_fwdPosition", ADDRESS, ADDRESS)
mj_fwd_velocity = _engine("mj_fwdVelocity", ADDRESS, ADDRESS)
mj_kinematics = _engine("mj_kinematics", ADDRESS, ADDRESS)
mj_com_pos = _engine("mj_comPos", ADDRESS, ADDRESS)
mj_com_vel = _engine("mj_comVel", ADDRESS, ADDRESS)
mj_sensor_pos = _engine("mj_sensorPos", ADDRESS, ADDRESS)
mj_sensor_vel = _engine("mj_sensorVel", ADDRESS, ADDRESS)
# ... stage up to which nothing is computed again, whether sensors are skipped
mj_forward_skip = _engine("mj_forwardSkip", ADDRESS, ADDRESS, FLAG, FLAG)
# model, positions that change, velocities, time [s]
mj_integrate_pos = _engine("mj_integratePos", ADDRESS, ADDRESS, ADDRESS, NUMBER)
# type and number of an object, address of six numbers for the result, whether in its own axes
mj_object_velocity = _engine("mj_objectVelocity", ADDRESS, ADDRESS, FLAG, FLAG, ADDRESS, FLAG)
SITE = int(mujoco.mjtObj.mjOBJ_SITE)

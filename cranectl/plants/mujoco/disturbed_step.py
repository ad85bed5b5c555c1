"""A step of the engine under what changes within it: the thesis's disturbance, drag, a rope that is paid out.

The engine holds applied forces, and the numbers of its model, over a step. Held, drag is of first order in
the step, a torque m l² cos² beta d_alpha of second, where all else is of fourth. So while such things act the
engine's own scheme is taken here, stage by stage, with what the state there makes of them; where
nothing changes it is `mj_step`, bit for bit where no ball joint turns, and to the fifth order of the step
where one does. (The engine's callback for such forces belongs to the whole process, and a model without
springs and dampers skips it.)

Compiled code calls the engine's functions. Their symbols are resolved at link time from the library that the
`mujoco` package has loaded, so no C compiler and no struct offsets are needed and Numba's cache keeps
working. An error inside the library ends the process: callers take their first step through the Python
binding.

The binding gives the engine a clock, which it reads at every part of a step to fill `mjData.timer`: a quarter
of the time of a step as small as the crane's. Loading this module takes it away again, for the whole process.
"""

import ctypes
from math import cos, sin, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import mujoco
import numba
import numpy as np
from numba import types

from cranectl.plants.mujoco.rope import pay_out
from cranectl.plants.surroundings import FORCE
from cranectl.support.arrays import Array
from cranectl.support.errors import CranectlError
from cranectl.support.jit import jit

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
    """Return the engine's function `name`, without a result; compiled or, without Numba, through ctypes."""
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

# The classical fourth-order scheme: how far the next stage reaches, and what each stage counts.
REACH = (0.5, 0.5, 1.0)
WEIGHT = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
VELOCITY_STAGE = 2  # of the engine's forward dynamics: up to it nothing depends on forces


class StageWork(NamedTuple):
    """What a step in stages reads and keeps of one MjModel/MjData pair besides the rig's own views."""

    qacc: Array  # view
    warmstart: Array  # view
    qpos_address: int
    slope_address: int
    swing: int  # of the load's ball joint in qvel; -1 without one
    start_position: Array  # (nq,)
    start_velocity: Array  # (nv,)
    slope: Array  # (nv,) rates of the positions, in the tangent space of the start
    turn: Array  # (3,) rotation vector of the load since the start, about its own axes
    mean_slope: Array  # (nv,)
    mean_acceleration: Array  # (nv,)
    sensed: Array  # (7,) of the load at the start of the step


def stage_work(model: mujoco.MjModel, data: mujoco.MjData, *, has_body: bool) -> StageWork:
    """Make the work space for steps of `data`."""
    slope = np.zeros(model.nv)
    return StageWork(
        qacc=data.qacc,
        warmstart=data.qacc_warmstart,
        qpos_address=data.qpos.ctypes.data,
        slope_address=slope.ctypes.data,
        swing=int(model.joint("swing").dofadr[0]) if has_body else -1,
        start_position=np.zeros(model.nq),
        start_velocity=np.zeros(model.nv),
        slope=slope,
        turn=np.zeros(3),
        mean_slope=np.zeros(model.nv),
        mean_acceleration=np.zeros(model.nv),
        sensed=np.zeros(7),
    )


@jit
def apply_disturbance(rig, disturbance):
    """Hinge torques that add `disturbance` (2,) [rad/s²] to the cardan accelerations at the present state."""
    length = rig.qpos[rig.distance[0]]
    cos_beta = cos(rig.qpos[rig.joints[4]])
    inertia = rig.load_mass * length * length
    rig.applied[rig.rates[3]] = inertia * cos_beta * cos_beta * disturbance[0]
    rig.applied[rig.rates[4]] = inertia * disturbance[1]


@jit
def push_body(rig, disturbance):
    """Apply the thesis's disturbance (2,) [rad/s²] to a load that swings below its hook.

    A force at its centre: torques at the cardan hinges would act on the hook, which has no mass. The trolley
    takes the opposite force, as it does from a torque, so that a load without extent moves the same.
    """
    length = rig.qpos[rig.joints[2]]
    alpha, beta = rig.qpos[rig.joints[3]], rig.qpos[rig.joints[4]]
    sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
    along_alpha = rig.load_mass * length * cb * disturbance[0]
    along_beta = rig.load_mass * length * disturbance[1]
    rig.reaction[0] = -cb * along_beta
    rig.reaction[1] = -(ca * along_alpha - sb * sa * along_beta)
    rig.reaction[2] = -(sa * along_alpha + ca * sb * along_beta)
    for i in range(3):
        rig.wrench[i] = rig.air[i] - rig.reaction[i]


@jit
def push_load(rig, disturbance):
    """Replace the last disturbance of the load by `disturbance` (2,) [rad/s²] at the present state."""
    if rig.has_body:
        push_body(rig, disturbance)
    else:
        apply_disturbance(rig, disturbance)


@jit
def apply_drag(rig, wind):
    """Drag on the load in air that moves, and the force on it, of `wind` (6,), at the sensed velocity."""
    v_x = wind[0] - rig.sensors[rig.load_sensors[3]]
    v_y = wind[1] - rig.sensors[rig.load_sensors[4]]
    v_z = wind[2] - rig.sensors[rig.load_sensors[5]]
    factor = rig.drag * sqrt(v_x * v_x + v_y * v_y + v_z * v_z)
    rig.air[0] = factor * v_x + wind[FORCE]
    rig.air[1] = factor * v_y + wind[FORCE + 1]
    rig.air[2] = factor * v_z + wind[FORCE + 2]
    for i in range(3):
        rig.wrench[i] = rig.air[i] - rig.reaction[i]


@jit
def evaluate(rig, disturbance, wind, first):
    """Accelerations at the present state under all that acts on it; `first`: and what the sensors say.

    In parts, for drag asks for the load's velocity, and constraints, the dearest of them, need solving once.
    """
    if rig.rope.active:
        pay_out(rig.rope, rig.qpos)
    push_load(rig, disturbance)
    mj_fwd_position(rig.model, rig.data)
    if first:
        mj_sensor_pos(rig.model, rig.data)
    mj_fwd_velocity(rig.model, rig.data)
    if first or rig.in_air:
        mj_sensor_vel(rig.model, rig.data)
    if rig.in_air:
        apply_drag(rig, wind)
    mj_forward_skip(rig.model, rig.data, VELOCITY_STAGE, not first)


@jit
def release_load(rig):
    """Remove disturbance and drag, and restore the sensor values of the start of the step."""
    rig.applied[rig.rates[3]] = rig.applied[rig.rates[4]] = 0.0
    for i in range(3):
        rig.wrench[i] = rig.reaction[i] = rig.air[i] = 0.0
    for i in range(7):
        rig.sensors[rig.load_sensors[i]] = rig.work.sensed[i]


@jit
def _begin(rig):
    """Note the state, in which the engine has brought quaternions to unit length by now."""
    work = rig.work
    for i in range(len(rig.qpos)):
        work.start_position[i] = rig.qpos[i]
    for i in range(len(rig.qvel)):
        work.start_velocity[i] = rig.qvel[i]
        work.mean_slope[i] = work.mean_acceleration[i] = 0.0
    for i in range(3):
        work.turn[i] = 0.0
    for i in range(7):
        work.sensed[i] = rig.sensors[rig.load_sensors[i]]


@jit
def turn_rate(turn, spin):
    """Rate of the rotation vector `turn` (3,) under a spin (3,) about the body's own axes, to fourth order.

    spin + turn x spin / 2 + turn x (turn x spin) / 12 (Munthe-Kaas, BIT 38, 1998).
    """
    x = turn[1] * spin[2] - turn[2] * spin[1]
    y = turn[2] * spin[0] - turn[0] * spin[2]
    z = turn[0] * spin[1] - turn[1] * spin[0]
    return (
        spin[0] + 0.5 * x + (turn[1] * z - turn[2] * y) / 12.0,
        spin[1] + 0.5 * y + (turn[2] * x - turn[0] * z) / 12.0,
        spin[2] + 0.5 * z + (turn[0] * y - turn[1] * x) / 12.0,
    )


@jit
def _keep_stage(rig, weight):
    """Count the rates of this stage by `weight`."""
    work = rig.work
    for i in range(len(rig.qvel)):
        work.slope[i] = rig.qvel[i]
    if work.swing >= 0:
        first = work.swing
        spin = rig.qvel[first : first + 3]
        work.slope[first], work.slope[first + 1], work.slope[first + 2] = turn_rate(work.turn, spin)
    for i in range(len(rig.qvel)):
        work.mean_slope[i] += work.slope[i] * weight
        work.mean_acceleration[i] += work.qacc[i] * weight


@jit
def _move(rig, slope, acceleration, reach):
    """Move from the start of the step along `slope` and `acceleration` (nv,) for `reach` [s]."""
    work = rig.work
    for i in range(len(slope)):
        work.slope[i] = slope[i]
    for i in range(len(rig.qpos)):
        rig.qpos[i] = work.start_position[i]
    mj_integrate_pos(rig.model, work.qpos_address, work.slope_address, reach)
    for i in range(len(rig.qvel)):
        rig.qvel[i] = work.start_velocity[i] + acceleration[i] * reach
    if work.swing >= 0:
        for i in range(3):
            work.turn[i] = reach * slope[work.swing + i]


@jit
def step_in_stages(rig, disturbance, wind):
    """Step as `mj_step` does, under `disturbance` (2,) [rad/s²] in `wind` (6,); the time stands still."""
    work = rig.work
    mj_check_pos(rig.model, rig.data)
    mj_check_vel(rig.model, rig.data)
    for stage in range(4):
        evaluate(rig, disturbance, wind, stage == 0)
        if stage == 0:
            mj_check_acc(rig.model, rig.data)
            _begin(rig)
        _keep_stage(rig, WEIGHT[stage])
        if stage < 3:
            _move(rig, work.slope, work.qacc, REACH[stage] * rig.step)
    _move(rig, work.mean_slope, work.mean_acceleration, rig.step)
    for i in range(len(rig.qvel)):
        work.warmstart[i] = work.qacc[i]
    release_load(rig)

"""A step of MuJoCo under forces that change within the step: the thesis's disturbance, drag, an elastic rope.

The engine keeps applied forces and the numbers of its model constant over a step. Constant drag would have an
error of first order in the step, and a constant torque m l² cos² beta d_alpha one of second order. All else
is of fourth order. So this module takes the engine's own scheme stage by stage, and computes such forces from
the state of each stage. Without them it gives the same bits as `mj_step` if no ball joint turns, and agrees
to the fifth order of the step if one does. (The engine's callback for such forces belongs to the whole
process, and a model without springs and dampers skips it.)
"""

from math import cos, exp, sin, sqrt
from typing import NamedTuple

import mujoco
import numpy as np

from cranectl.plants.mujoco.engine import (
    mj_check_acc,
    mj_check_pos,
    mj_check_vel,
    mj_forward_skip,
    mj_fwd_position,
    mj_fwd_velocity,
    mj_integrate_pos,
    mj_sensor_pos,
    mj_sensor_vel,
)
from cranectl.plants.mujoco.rope import pay_out
from cranectl.plants.mujoco.sites import swing_of
from cranectl.plants.surroundings import FORCE
from cranectl.support import Array, jit

# The classical Runge-Kutta scheme of order 4: where the next stage is, and the weight of each stage.
REACH = (0.5, 0.5, 1.0)
WEIGHT = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
VELOCITY_STAGE = 2  # of the engine's forward dynamics; nothing up to it depends on forces


class StageWork(NamedTuple):
    """Views and work space that a step in stages needs, besides the views of the rig."""

    qacc: Array  # view
    warmstart: Array  # view
    act: Array  # (na,) view of the activations of drives
    act_dot: Array  # (na,) view
    qpos_address: int
    slope_address: int
    swing: int  # index in qvel of the load's ball joint; -1 without one
    start_position: Array  # (nq,)
    start_velocity: Array  # (nv,)
    slope: Array  # (nv,) rates of the positions, in the tangent space of the start
    turn: Array  # (3,) rotation vector of the load since the start, about its own axes
    mean_slope: Array  # (nv,)
    mean_acceleration: Array  # (nv,)
    start_act: Array  # (na,)
    act_rate: Array  # (na,) of the last stage
    mean_act_rate: Array  # (na,)
    act_times: Array  # (na,) time constants [s] of activations that the engine advances exactly, else 0
    act_ranges: Array  # (na, 2)
    sensed: Array  # sensor values of the load at the start of the step


def stage_work(model: mujoco.MjModel, data: mujoco.MjData, *, swing: int, sensors: int) -> StageWork:
    """Make the work space for steps of `data`, whose load has `sensors` sensor values."""
    slope = np.zeros(model.nv)
    times, ranges = _activations(model)
    return StageWork(
        qacc=data.qacc,
        warmstart=data.qacc_warmstart,
        act=data.act,
        act_dot=data.act_dot,
        qpos_address=data.qpos.ctypes.data,
        slope_address=slope.ctypes.data,
        swing=swing,
        start_position=np.zeros(model.nq),
        start_velocity=np.zeros(model.nv),
        slope=slope,
        turn=np.zeros(3),
        mean_slope=np.zeros(model.nv),
        mean_acceleration=np.zeros(model.nv),
        start_act=np.zeros(model.na),
        act_rate=np.zeros(model.na),
        mean_act_rate=np.zeros(model.na),
        act_times=times,
        act_ranges=ranges,
        sensed=np.zeros(sensors),
    )


def _activations(model: mujoco.MjModel) -> tuple[Array, Array]:
    """Return time constants (na,) and ranges (na, 2) of the activations, as `StageWork` has them."""
    times, ranges = np.zeros(model.na), np.full((model.na, 2), [-np.inf, np.inf])
    for k in np.flatnonzero(model.actuator_actnum == 1):
        address = model.actuator_actadr[k]
        if model.actuator_dyntype[k] == int(mujoco.mjtDyn.mjDYN_FILTEREXACT):
            times[address] = max(model.actuator_dynprm[k, 0], mujoco.mjMINVAL)
        if model.actuator_actlimited[k]:
            ranges[address] = model.actuator_actrange[k]
    return times, ranges


@jit
def apply_disturbance(rig, disturbance):
    """Set hinge torques that add `disturbance` (2,) [rad/s²] to the cardan accelerations at this state."""
    length = rig.qpos[rig.distance[0]]
    cos_beta = cos(rig.qpos[rig.joints[4]])
    inertia = rig.load_mass * length * length
    rig.applied[rig.rates[3]] = inertia * cos_beta * cos_beta * disturbance[0]
    rig.applied[rig.rates[4]] = inertia * disturbance[1]


@jit
def push_body(rig, disturbance):
    """Apply the thesis's disturbance (2,) [rad/s²] to a load that swings below its hook.

    It is a force at the load's centre, since torques at the cardan hinges would act on the massless hook. The
    opposite force acts on the trolley, as it does with a torque. So a load of no size moves the same.
    """
    length, alpha, beta = swing_of(rig)
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
    """Apply `disturbance` (2,) [rad/s²] at the present state, in place of the last one."""
    if rig.has_body:
        push_body(rig, disturbance)
    else:
        apply_disturbance(rig, disturbance)


@jit
def apply_drag(rig, wind):
    """Apply the drag and the force of `wind` (6,) to the load, at the velocity that its sensors give."""
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
    """Compute the accelerations at the present state under all forces; if `first`, also all sensor values.

    The engine's parts are called one by one. Drag needs the velocity of the load first, and the constraints,
    which take the most time, are solved only once.
    """
    if rig.rope.active:
        pay_out(rig.rope, rig.qpos)
    mj_fwd_position(rig.model, rig.data)
    push_load(rig, disturbance)
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
    for i in range(len(rig.load_sensors)):
        rig.sensors[rig.load_sensors[i]] = rig.work.sensed[i]


@jit
def _begin(rig):
    """Copy the state at the start of the step; the engine has normalised its quaternions by now."""
    work = rig.work
    for i in range(len(rig.qpos)):
        work.start_position[i] = rig.qpos[i]
    for i in range(len(rig.qvel)):
        work.start_velocity[i] = rig.qvel[i]
        work.mean_slope[i] = work.mean_acceleration[i] = 0.0
    for i in range(len(work.act)):
        work.start_act[i] = work.act[i]
        work.mean_act_rate[i] = 0.0
    for i in range(3):
        work.turn[i] = 0.0
    for i in range(len(rig.load_sensors)):
        work.sensed[i] = rig.sensors[rig.load_sensors[i]]


@jit
def turn_rate(turn, spin):
    """Return the rate of the rotation vector `turn` (3,) at `spin` (3,) about body axes, to fourth order.

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
    """Add the rates of this stage, times `weight`, to the mean rates."""
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
    for i in range(len(work.act)):
        work.act_rate[i] = work.act_dot[i]
        work.mean_act_rate[i] += work.act_dot[i] * weight


@jit
def _advance_activations(rig):
    """Set the activations at the end of the step, as the engine does from their mean rates."""
    work = rig.work
    for i in range(len(work.act)):
        time, reach = work.act_times[i], rig.step
        if time > 0.0:
            reach = time * (1.0 - exp(-rig.step / time))
        end = work.start_act[i] + work.mean_act_rate[i] * reach
        work.act[i] = min(max(end, work.act_ranges[i, 0]), work.act_ranges[i, 1])


@jit
def _move(rig, slope, acceleration, reach):
    """Set the state at `reach` [s] after the start of the step, with `slope` and `acceleration` (nv,)."""
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
    """Step as `mj_step` does, with `disturbance` (2,) [rad/s²] and `wind` (6,); `mjData.time` stays."""
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
            for i in range(len(work.act)):
                work.act[i] = work.start_act[i] + work.act_rate[i] * REACH[stage] * rig.step
    _move(rig, work.mean_slope, work.mean_acceleration, rig.step)
    _advance_activations(rig)
    for i in range(len(rig.qvel)):
        work.warmstart[i] = work.qacc[i]
    release_load(rig)

"""Express the engine's whole state as a change from one state, including the coordinates of effects.

Changes of position are in the tangent space. So a ball joint has three coordinates, turns about the body's
own axes, and not four. Its rates are about the axes that the body has at the first state. So a turn about the
rope, on which nothing depends, does not change the rates either.

The ten measured signals come first, in the order of `signals.STATE`. Positions and velocities of the other
joints follow. With drag the last three are the load's velocity, from which the next step computes the drag.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.mujoco.disturbed_step import evaluate
from cranectl.plants.mujoco.plant import MujocoPlant, set_command
from cranectl.support import Array


class BaseState(NamedTuple):
    """The state from which changes are counted."""

    qpos: Array  # (nq,)
    qvel: Array  # (nv,)
    load_velocity: Array  # (3,) [m/s], sensed at the start of the last step


def present_state(plant: MujocoPlant) -> BaseState:
    """Return the present state of `plant`, to count changes from."""
    mujoco.mj_forward(plant.model, plant.data)
    return BaseState(plant.data.qpos.copy(), plant.data.qvel.copy(), load_velocity(plant))


def load_velocity(plant: MujocoPlant) -> Array:
    """Return the velocity of the load (3,) from the sensors [m/s]."""
    velocity: Array = plant.data.sensordata[plant.rig.load_sensors[3:6]].copy()
    return velocity


def free_coordinates(plant: MujocoPlant) -> NDArray[np.int64]:
    """Return the indices in qvel of the coordinates without a drive."""
    return np.setdiff1d(np.arange(plant.model.nv), plant.rig.rates[:3])


def displace(plant: MujocoPlant, base: BaseState, displacement: Array) -> BaseState:
    """Return `base` with its positions changed by `displacement` (nv,), in the tangent space."""
    qpos = base.qpos.copy()
    mujoco.mj_integratePos(plant.model, qpos, displacement, 1.0)
    return base._replace(qpos=qpos)


def unbalanced_forces(plant: MujocoPlant, base: BaseState, command: Array, tilt: Array, air: Array) -> Array:
    """Return the unbalanced generalised forces (nv,) at `base`, mass matrix times acceleration.

    The accelerations themselves would be ill conditioned for a hook without mass.
    """
    _set_positions_and_rates(plant, base)
    set_command(plant.rig, command)
    evaluate(plant.rig, tilt, air, True)
    force = np.zeros(plant.model.nv)
    mujoco.mj_mulM(plant.model, plant.data, force, plant.data.qacc)
    return force


def rope_stretch(plant: MujocoPlant, base: BaseState) -> float:
    """Return the stretch of the rope, its length minus the length paid out [m]; infinite for a rigid rope."""
    rig = plant.rig
    return float(base.qpos[rig.distance[0]] - base.qpos[rig.joints[2]]) if rig.rope.active else np.inf


def count_coordinates(plant: MujocoPlant) -> int:
    """Return the number of coordinates that a change of state has."""
    return 2 * int(plant.model.nv) + (3 if plant.rig.drag > 0.0 else 0)


def set_state(plant: MujocoPlant, base: BaseState, change: Array) -> None:
    """Set the state to `base` changed by `change`."""
    nv, total = plant.model.nv, np.zeros(count_coordinates(plant))
    total[_order(plant)] = change
    changed = displace(plant, base, total[:nv])
    qvel = _about_axes_of(plant, changed, base, base.qvel + total[nv : 2 * nv])
    _set_positions_and_rates(plant, changed._replace(qvel=qvel))
    if plant.rig.drag > 0.0:
        plant.data.sensordata[plant.rig.load_sensors[3:6]] = base.load_velocity + total[2 * nv :]


def change_since(plant: MujocoPlant, base: BaseState) -> Array:
    """Return the present state as a change from `base`, the inverse of `set_state`."""
    data, position = plant.data, np.zeros(plant.model.nv)
    mujoco.mj_differentiatePos(plant.model, position, 1.0, base.qpos, data.qpos)
    now = base._replace(qpos=data.qpos)
    parts = [position, _about_axes_of(plant, base, now, data.qvel) - base.qvel]
    if plant.rig.drag > 0.0:
        parts.append(load_velocity(plant) - base.load_velocity)
    return np.array(np.concatenate(parts)[_order(plant)])


def _about_axes_of(plant: MujocoPlant, new: BaseState, old: BaseState, qvel: Array) -> Array:
    """Return `qvel` (nv,) with the load's spin turned from its axes at `old` to those at `new`."""
    if not plant.rig.has_body:
        return qvel
    swing, back, turn = plant.model.joint("swing"), np.zeros(4), np.zeros(4)
    address, rate = int(swing.qposadr[0]), int(swing.dofadr[0])
    mujoco.mju_negQuat(back, new.qpos[address : address + 4])
    mujoco.mju_mulQuat(turn, back, old.qpos[address : address + 4])
    turned = qvel.copy()
    mujoco.mju_rotVecQuat(turned[rate : rate + 3], qvel[rate : rate + 3], turn)
    return turned


def _set_positions_and_rates(plant: MujocoPlant, base: BaseState) -> None:
    mujoco.mj_resetData(plant.model, plant.data)
    plant.data.qpos[:], plant.data.qvel[:] = base.qpos, base.qvel


def _order(plant: MujocoPlant) -> NDArray[np.int64]:
    """Return, for each coordinate of a change, its index in (positions, velocities, sensors)."""
    nv, rates = plant.model.nv, plant.rig.rates
    measured = np.column_stack([rates, nv + rates]).ravel()
    return np.concatenate([measured, np.setdiff1d(np.arange(count_coordinates(plant)), measured)])

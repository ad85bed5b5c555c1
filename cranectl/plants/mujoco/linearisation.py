"""Linearise the engine's crane over one control period at an equilibrium, with all coordinates of effects.

Newton's method on the forces of the engine finds the equilibrium of a crane with effects. Given are the
measured rope length and its rate, with drives at rest. Unknown are all other coordinates (angles, stretch of
the rope, body under its hook, frame) and the command that compensates the static error of the servos. A
coordinate that affects no force, such as the rotation of the load about its rope, keeps its value.

A state is expressed as a change from one state, including the coordinates of effects. Changes of position are
in the tangent space. So a ball joint has three coordinates, turns about the body's own axes, and not four.
Its rates are about the axes that the body has at the first state. So a turn about the rope, on which nothing
depends, does not change the rates either.

The ten measured signals come first, ordered as `SignalGroup.STATE`. Positions and velocities of the other
joints follow. With drag the last three are the load's velocity, from which the next step computes the drag.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.differences import jacobian
from cranectl.plants.mujoco.disturbed_step import evaluate
from cranectl.plants.plant import DRIVES
from cranectl.signals import ROPE_RATE
from cranectl.support import Array

if TYPE_CHECKING:
    from cranectl.plants.mujoco.plant import MujocoPlant

JOINT_SIGNALS = 10
ZERO_TOLERANCE = 1e-7  # smaller entries of a matrix are rounding errors
STEP = 1e-5  # of the differences, in each signal's unit
MAX_STRETCH_SHARE = 0.1  # largest step as a share of the rope's stretch, so that the rope stays taut
REST_FORCE_TOLERANCE = 1e-9  # of the load's weight [N, N m]
SINGULAR = 1e-10  # smaller singular values, as a share of the largest, belong to coordinates without effect
REST_ITERATIONS = 30


class BaseState(NamedTuple):
    """The state from which changes are counted."""

    qpos: Array  # (nq,)
    qvel: Array  # (nv,)
    load_velocity: Array  # (3,) [m/s], sensed at the start of the last step


@dataclass(frozen=True)
class Equilibrium:
    """A state in which no drive accelerates and the angles rest, under a constant disturbance and wind.

    Parameters
    ----------
    plant : MujocoPlant
        The plant; its state may be another by now.
    base : BaseState
        All coordinates, also those of effects.
    command : Array
        Command (3,) that keeps the state, in the unit of the drives.
    tilt : Array
        Disturbance (2,) of the angles [rad/s²].
    air : Array
        Wind (6,), as in `Plant.advance`.
    """

    plant: "MujocoPlant"
    base: BaseState
    command: Array
    tilt: Array
    air: Array

    @property
    def joints(self) -> Array:
        """Joint positions and velocities (10,), in the order of `SignalGroup.STATE`."""
        joints, rig = np.zeros(JOINT_SIGNALS), self.plant.rig
        joints[0::2], joints[1::2] = self.base.qpos[rig.joints], self.base.qvel[rig.rates]
        return joints

    def linearise(self) -> Array:
        """Return the matrix (n, n + 3) from (change of state, command) to the change one period later.

        The ten joints come first. Coordinates that affect nothing are left out.
        """
        plant, n, load = self.plant, count_coordinates(self.plant), np.zeros(7)

        def crane(values: Array) -> Array:
            set_state(plant, self.base, values[:n])
            plant.advance(values[n:], self.tilt, self.air, load)
            return change_since(plant, self.base)

        at, step = np.append(np.zeros(n), self.command), _difference_step(plant, self.base)
        matrix = jacobian(crane, at, np.full(n + 3, step))
        moving = np.abs(matrix[:, :n] * (1.0 - np.eye(n))) >= ZERO_TOLERANCE  # [state, by another]
        retained = np.arange(n)
        # Once a coordinate is left out, another one may affect nothing that remains.
        while not (
            needed := (retained < JOINT_SIGNALS) | moving[np.ix_(retained, retained)].any(axis=0)
        ).all():
            retained = retained[needed]
        reduced: Array = matrix[np.ix_(retained, [*retained, *range(n, n + 3)])]
        return reduced


def find_equilibrium(plant: "MujocoPlant", start: Array, *, tilt: Array, air: Array) -> Equilibrium | None:
    """Return the equilibrium near the joints `start` (10,), whose rope length and rate it keeps, or None.

    `tilt` (2,) is the disturbance of the angles [rad/s²], and `air` (6,) the wind.
    """
    first, free = _first_guess(plant, start), _free_coordinates(plant)
    commands = 0 if DRIVES[plant.drive].at_rest == "nothing" else 3

    def split(unknown: Array) -> tuple[BaseState, Array]:
        displacement, command = np.zeros(plant.model.nv), np.zeros(3)
        displacement[free], command[:commands] = unknown[commands:], unknown[:commands]
        return _displace(plant, first, displacement), command

    def residual(unknown: Array) -> Array:
        force = _unbalanced_forces(plant, *split(unknown), tilt, air)
        return force if commands else force[free]

    unknown = np.zeros(commands + len(free))
    tolerance = REST_FORCE_TOLERANCE * plant.rig.load_mass * plant.parameters.gravity
    for _ in range(REST_ITERATIONS):
        force = residual(unknown)
        if np.abs(force).max() < tolerance:
            break
        steps = np.full(len(unknown), _difference_step(plant, split(unknown)[0]))
        unknown -= np.linalg.lstsq(jacobian(residual, unknown, steps), force, rcond=SINGULAR)[0]
    base, command = split(unknown)
    if not np.abs(force).max() < tolerance:  # also if it is NaN
        return None
    base = base._replace(load_velocity=_load_velocity(plant))
    return Equilibrium(plant, base, command, tilt, air)


def _first_guess(plant: "MujocoPlant", start: Array) -> BaseState:
    """Return the state at the joints `start`, of which only the rope moves, stretched as at rest."""
    resting = start.copy()
    resting[1::2] = 0.0
    plant.reset(resting)
    mujoco.mj_forward(plant.model, plant.data)
    base = BaseState(plant.data.qpos.copy(), plant.data.qvel.copy(), _load_velocity(plant))
    base.qvel[[plant.rig.rates[2], plant.rig.distance[1]]] = start[ROPE_RATE]
    return base


def _difference_step(plant: "MujocoPlant", base: BaseState) -> float:
    """Return the step of the differences about `base`, less for a rope that is stretched less."""
    rig, stretch = plant.rig, np.inf
    if rig.rope.active:  # length minus the length paid out [m]
        stretch = float(base.qpos[rig.distance[0]] - base.qpos[rig.joints[2]])
    return min(STEP, MAX_STRETCH_SHARE * max(stretch, 1e-9))


def _load_velocity(plant: "MujocoPlant") -> Array:
    """Return the velocity of the load (3,) from the sensors [m/s]."""
    velocity: Array = plant.data.sensordata[plant.rig.load_sensors[3:6]].copy()
    return velocity


def _free_coordinates(plant: "MujocoPlant") -> NDArray[np.int64]:
    """Return the indices in qvel of the coordinates without a drive."""
    return np.setdiff1d(np.arange(plant.model.nv), plant.rig.rates[:3])


def _displace(plant: "MujocoPlant", base: BaseState, displacement: Array) -> BaseState:
    """Return `base` with its positions changed by `displacement` (nv,), in the tangent space."""
    qpos = base.qpos.copy()
    mujoco.mj_integratePos(plant.model, qpos, displacement, 1.0)
    return base._replace(qpos=qpos)


def _unbalanced_forces(
    plant: "MujocoPlant", base: BaseState, command: Array, tilt: Array, air: Array
) -> Array:
    """Return the unbalanced generalised forces (nv,) at `base`, mass matrix times acceleration.

    The accelerations themselves would be ill conditioned for a hook without mass.
    """
    _set_positions_and_rates(plant, base)
    plant.set_command(command)
    evaluate(plant.rig, tilt, air, True)
    force = np.zeros(plant.model.nv)
    mujoco.mj_mulM(plant.model, plant.data, force, plant.data.qacc)
    return force


def count_coordinates(plant: "MujocoPlant") -> int:
    """Return the number of coordinates that a change of state has."""
    return 2 * int(plant.model.nv) + (3 if plant.rig.drag > 0.0 else 0)


def set_state(plant: "MujocoPlant", base: BaseState, change: Array) -> None:
    """Set the state to `base` changed by `change`."""
    nv, total = plant.model.nv, np.zeros(count_coordinates(plant))
    total[_order(plant)] = change
    changed = _displace(plant, base, total[:nv])
    qvel = _about_axes_of(plant, changed, base, base.qvel + total[nv : 2 * nv])
    _set_positions_and_rates(plant, changed._replace(qvel=qvel))
    if plant.rig.drag > 0.0:
        plant.data.sensordata[plant.rig.load_sensors[3:6]] = base.load_velocity + total[2 * nv :]


def change_since(plant: "MujocoPlant", base: BaseState) -> Array:
    """Return the present state as a change from `base`, the inverse of `set_state`."""
    data, position = plant.data, np.zeros(plant.model.nv)
    mujoco.mj_differentiatePos(plant.model, position, 1.0, base.qpos, data.qpos)
    now = base._replace(qpos=data.qpos)
    parts = [position, _about_axes_of(plant, base, now, data.qvel) - base.qvel]
    if plant.rig.drag > 0.0:
        parts.append(_load_velocity(plant) - base.load_velocity)
    return np.array(np.concatenate(parts)[_order(plant)])


def _about_axes_of(plant: "MujocoPlant", new: BaseState, old: BaseState, qvel: Array) -> Array:
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


def _set_positions_and_rates(plant: "MujocoPlant", base: BaseState) -> None:
    mujoco.mj_resetData(plant.model, plant.data)
    plant.data.qpos[:], plant.data.qvel[:] = base.qpos, base.qvel


def _order(plant: "MujocoPlant") -> NDArray[np.int64]:
    """Return, for each coordinate of a change, its index in (positions, velocities, sensors)."""
    nv, rates = plant.model.nv, plant.rig.rates
    measured = np.column_stack([rates, nv + rates]).ravel()
    return np.concatenate([measured, np.setdiff1d(np.arange(count_coordinates(plant)), measured)])

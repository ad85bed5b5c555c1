"""Balances of a crane: the work of drives, wind and gravity is stored or lost, and forces change momentum.

Of any plant: from where everything is and how fast, and from the tension that the plant tells.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from cranectl.plants.elastic.crane import BODY, RAILS, SPIN, STATES, STRETCH, STRETCH_RATE, directions
from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.plant import Drive, Plant
from cranectl.plants.surroundings import gravity_in_rig
from cranectl.scenario.effects import EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.support.arrays import Array


class Books(NamedTuple):
    """N samples of stored energy and momentum, and of the power and force that change them.

    Of ideal drives nobody tells the forces: their energy, and momentum but with a frame, are no book.
    """

    energy: Array  # (N,) [J]
    power: Array  # (N,) [W]
    momentum: Array  # (N, 5) of the load with its rope along x, y, z, of all that moves along x and y [N s]
    force: Array  # (N, 5) [N]
    load: Array  # (N, 3) where it is [m]
    speed: Array  # (N, 3) and its velocity [m/s]


def whole_state(plant: Plant) -> Array:
    """Return the state (22,) of any plant, in the order of `plants.elastic.crane`."""
    state = np.zeros(STATES)
    plant.measure(state[:10])
    if plant.name == "elastic":
        return plant.state.copy()
    if isinstance(plant, MujocoPlant):
        add_hidden(plant, state)
    elif plant.name == "drake" and plant.effects.body:
        plant.rates(plant.state)
        state[BODY : BODY + 3] = -plant.load.EvalPoseInWorld(plant.context).rotation().matrix()[:, 2]
        state[SPIN : SPIN + 3] = plant.load.EvalSpatialVelocityInWorld(plant.context).rotational()
    if plant.name == "drake" and plant.effects.frame:
        joints = [plant.crane.GetJointByName(name) for name in ("frame_x", "frame_y")]
        positions = plant.crane.num_positions()
        state[RAILS::2] = [plant.state[joint.position_start()] for joint in joints]
        state[RAILS + 1 :: 2] = [plant.state[positions + joint.velocity_start()] for joint in joints]
    return state


def add_hidden(engine: MujocoPlant, state: Array) -> None:
    """Write what the joints do not show into `state`: stretch, rails, attitude and spin of the body."""
    data, rig = engine.data, engine.rig
    if rig.rope.active:
        state[STRETCH] = data.qpos[rig.distance[0]] - state[4]
        state[STRETCH_RATE] = data.qvel[rig.distance[1]] - state[5]
    for k, name in enumerate(("frame_x", "frame_y") if engine.effects.frame else ()):
        joint = engine.model.joint(name)
        state[RAILS + 2 * k] = data.qpos[joint.qposadr[0]]
        state[RAILS + 2 * k + 1] = data.qvel[joint.dofadr[0]]
    if engine.effects.body:
        mujoco.mj_kinematics(engine.model, data)
        rotation = data.body("load").xmat.reshape(3, 3)
        first = engine.model.joint("swing").dofadr[0]
        state[BODY : BODY + 3] = -rotation[:, 2]
        state[SPIN : SPIN + 3] = hook_spin(state[None])[0] + rotation @ data.qvel[first : first + 3]


def hook_spin(states: Array) -> Array:
    """Return the angular velocity (N, 3) of the rope's end at states (N, 22)."""
    sa, ca = np.sin(states[:, 6]), np.cos(states[:, 6])
    return np.column_stack([states[:, 7], -states[:, 9] * ca, -states[:, 9] * sa])


def books(
    rig: RigParameters,
    effects: EffectSettings,
    drive: Drive,
    states: Array,
    loads: Array,
    commands: Array,
    air: Array,
) -> Books:
    """Return the balances of states (N, 22), measured loads (N, 7) and commands (N, 3), in wind (6,)."""
    rope, body, frame, friction = effects.rope, effects.body, effects.frame, effects.friction
    gravity, mass = np.array(gravity_in_rig(rig.gravity, effects)), rig.load_mass
    offset = body.hook_offset if body else 0.0
    axes, rates = states[:, 0:6:2], states[:, 1:6:2]
    rails, rail_rates = states[:, RAILS::2], states[:, RAILS + 1 :: 2]
    n, spin, hook = directions(states), states[:, SPIN : SPIN + 3], hook_spin(states)
    turn = np.cross(hook, n)
    paid_out, paid_rate = axes[:, 2] - offset, rates[:, 2]
    distance = (paid_out + states[:, STRETCH])[:, None]
    apart = (paid_rate + states[:, STRETCH_RATE])[:, None]
    flat = np.zeros((len(states), 1))
    pivot, pivot_speed = np.hstack([axes[:, :2] + rails, flat]), np.hstack([rates[:, :2] + rail_rates, flat])
    arm = offset * states[:, BODY : BODY + 3]
    position = pivot + distance * n + arm
    speed = pivot_speed + apart * n + distance * turn + np.cross(spin, arm)

    # Load and air.
    push = np.tile(air[3:], (len(states), 1))
    if effects.wind:
        through = air[:3] - speed
        push += (
            0.5
            * effects.wind.density
            * effects.wind.drag_area
            * np.sqrt(_dot(through, through))[:, None]
            * through
        )
    energy = mass * (0.5 * _dot(speed, speed) - position @ gravity)
    power = _dot(push, speed)
    momentum, force = mass * speed, push + mass * gravity - loads[:, 6:] * n
    torque = np.zeros((len(states), 2))  # on alpha, beta
    if friction:
        turning = states[:, 7:10:2]
        torque -= friction.pivot_viscous * turning + friction.pivot_coulomb * np.sign(turning)
        power += _dot(torque, turning)
    if body:
        end, end_speed = pivot + distance * n, pivot_speed + apart * n + distance * turn
        energy += body.hook_mass * (0.5 * _dot(end_speed, end_speed) - end @ gravity)
        momentum, force = momentum + body.hook_mass * end_speed, force + body.hook_mass * gravity
        slip = hook - spin
        energy += 0.5 * body.inertia * _dot(spin, spin)
        power -= body.swing_damping * _dot(slip, slip)
        back = -body.swing_damping * slip
        sa, ca = np.sin(states[:, 6]), np.cos(states[:, 6])
        torque = torque + np.column_stack([back[:, 0], -ca * back[:, 1] - sa * back[:, 2]])

    # The rope is a thin rod from its end up to the winch. What is paid out has the rope's mass and strain.
    if rope:
        strain, rate = states[:, STRETCH], states[:, STRETCH_RATE]
        stored = 0.5 * rope.stiffness / paid_out * strain**2 * (strain > 0.0)
        energy += stored
        power -= stored * paid_rate / paid_out
        power -= (loads[:, 6] - rope.stiffness / paid_out * np.maximum(strain, 0.0)) * rate
        rod, middle = rope.mass * paid_out, distance[:, 0] - 0.5 * paid_out
        middle_speed = pivot_speed + apart * n + middle[:, None] * turn
        energy += 0.5 * rod * (_dot(middle_speed, middle_speed) + paid_out**2 / 12.0 * _dot(turn, turn))
        energy -= rod * ((pivot + middle[:, None] * n) @ gravity)
        momentum = momentum + rod[:, None] * middle_speed
        force = force + rod[:, None] * gravity
        # Per metre that is paid out: at the pivot's end, middle and inertia with it.
        at_pivot = (distance[:, 0] - paid_out)[:, None]
        upper = pivot_speed + apart * n + at_pivot * turn
        power += rope.mass * paid_rate * (0.5 * _dot(upper, upper) - (pivot + at_pivot * n) @ gravity)
        force = force + rope.mass * paid_rate[:, None] * upper

    # A torque on the joint pushes the end of a massless rope aside.
    by_alpha = np.column_stack([0.0 * n[:, 0], -n[:, 2], n[:, 1]])
    by_beta = np.cross(np.column_stack([flat, -np.cos(states[:, 6]), -np.sin(states[:, 6])]), n)
    aside = (
        torque[:, :1] / _dot(by_alpha, by_alpha)[:, None] * by_alpha + torque[:, 1:] * by_beta
    ) / distance

    # Axes and rails.
    trolley = rates[:, :2] + rail_rates
    bridge = np.column_stack([trolley[:, 0], rail_rates[:, 1]])
    energy += 0.5 * rig.bridge_mass * _dot(bridge, bridge) + 0.5 * rig.trolley_mass * _dot(trolley, trolley)
    energy += 0.5 * rig.winch_mass * rates[:, 2] ** 2
    bridge_at = np.column_stack([axes[:, 0] + rails[:, 0], rails[:, 1]])
    trolley_at = axes[:, :2] + rails
    energy -= (rig.bridge_mass * bridge_at + rig.trolley_mass * trolley_at) @ gravity[:2]
    holding = [0.0, 0.0, rig.hanging_mass(effects) * rig.gravity]
    drive_forces = commands if drive == "force" else rig.velocity_gains * (commands - rates) - holding
    if friction:
        drive_forces = (
            drive_forces - np.array(friction.viscous) * rates - np.array(friction.coulomb) * np.sign(rates)
        )
    power += _dot(drive_forces, rates)
    everything = momentum[:, :2] + rig.bridge_mass * bridge + rig.trolley_mass * trolley
    outside = (
        push[:, :2] + rig.trolley_mass * gravity[:2] + rig.bridge_mass * gravity[:2] * [1.0, bool(frame)]
    )
    outside += force[:, :2] - push[:, :2] + loads[:, 6:] * n[:, :2]
    if frame:
        standing = rig.bridge_mass + rig.trolley_mass + frame.mass
        omega = 2.0 * np.pi * np.array(frame.frequency)
        spring = -standing * omega**2 * rails
        damper = -2.0 * frame.damping_ratio * standing * omega * rail_rates
        energy += 0.5 * frame.mass * _dot(rail_rates, rail_rates) - 0.5 * _dot(spring, rails)
        power += _dot(damper, rail_rates)
        everything = everything + frame.mass * rail_rates
        outside = outside + spring + damper
    else:
        outside = outside + drive_forces[:, :2]
    momenta, forces = np.hstack([momentum, everything]), np.hstack([force + aside, outside])
    return Books(energy, power, momenta, forces, position, speed)


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.einsum("ij,ij->i", a, b)
    return product

"""The rig as a tree of Drake's bodies and joints, built here from its numbers.

Drake's parser of MJCF would put the hinges of `models/crane.xml`, two of one body, in the wrong place, and
leave out drives and rotors. Tests hold this tree to the engine's, state by state.
"""

from math import pi

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    Joint,
    PrismaticJoint,
    PrismaticSpring,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)

from cranectl.plants.plant import Drive
from cranectl.plants.surroundings import gravity_in_rig
from cranectl.scenario.effects import EffectSettings, Frame
from cranectl.scenario.rig import RigParameters
from cranectl.support.arrays import Array

AXES = ("bridge_position", "trolley_position", "rope_length")  # each with an actuator of its name
JOINTS = (*AXES, "alpha", "beta")  # in the order of signals.STATE
LOAD = "load"

# An ideal drive turns a rotor so inert that no crane slows it: its acceleration is force / inertia.
IDEAL_INERTIA = 1e16  # per kg of the crane


def build_crane(rig: RigParameters, drive: Drive, effects: EffectSettings) -> MultibodyPlant:
    """Bridge, trolley, cardan joint, rope and load, with drives that take forces; of continuous time.

    What is linear in the rates is damping of the joints: velocity drives, viscous friction.
    """
    crane = MultibodyPlant(0.0)
    crane.mutable_gravity_field().set_gravity_vector(gravity_in_rig(rig.gravity, effects))
    base = crane.world_body()
    if effects.frame:
        base = _add_frame(crane, effects.frame, rig)
    slowed = axis_damping(rig, drive, effects)
    turned = effects.friction.pivot_viscous if effects.friction else 0.0
    bridge = _add_body(crane, "bridge", rig.bridge_mass)
    trolley = _add_body(crane, "trolley", rig.trolley_mass)
    outer, inner = _add_body(crane, "outer"), _add_body(crane, "inner")
    load = _add_body(crane, LOAD, rig.load_mass)
    axes = (
        _slide(crane, AXES[0], base, bridge, (1, 0, 0), slowed[0]),
        _slide(crane, AXES[1], bridge, trolley, (0, 1, 0), slowed[1]),
        _slide(crane, AXES[2], inner, load, (0, 0, -1), slowed[2]),
    )
    _turn(crane, "alpha", trolley, outer, (1, 0, 0), turned)
    _turn(crane, "beta", outer, inner, (0, -1, 0), turned)
    for axis, inertia in zip(axes, rotor_inertias(rig, drive), strict=True):
        _add_rotor(crane, axis, inertia)
    crane.Finalize()
    return crane


def rotor_inertias(rig: RigParameters, drive: Drive) -> tuple[float, float, float]:
    """What each drive turns besides the crane [kg]."""
    if drive == "ideal":
        return (ideal_inertia(rig),) * 3
    return 0.0, 0.0, rig.winch_mass


def ideal_inertia(rig: RigParameters) -> float:
    """Of an ideal drive [kg]."""
    return IDEAL_INERTIA * (rig.bridge_mass + rig.trolley_mass + rig.load_mass)


def drive_forces(rig: RigParameters, drive: Drive) -> tuple[Array, Array]:
    """Of the forces of the drives [N], gain · command + offset: (3,) each."""
    if drive == "ideal":
        return np.array(rotor_inertias(rig, drive)), np.zeros(3)
    if drive == "velocity":
        return rig.velocity_gains, np.array([0.0, 0.0, -rig.weight])
    return np.ones(3), np.zeros(3)


def axis_damping(rig: RigParameters, drive: Drive, effects: EffectSettings) -> list[float]:
    """Of the driven joints [N s/m]: a velocity drive's gain on what it measures, and viscous friction."""
    friction = np.array(effects.friction.viscous if effects.friction else (0.0, 0.0, 0.0))
    gains = rig.velocity_gains if drive == "velocity" else np.zeros(3)
    damping: list[float] = (gains + friction).tolist()
    return damping


def _add_frame(crane: MultibodyPlant, frame: Frame, rig: RigParameters) -> RigidBody:
    """Rails on a damped spring along x and along y, whose frequency is the empty rig's.

    Their mass is that of rotors: it moves with them and weighs nothing on rails that slope.
    """
    mass = frame.mass + rig.bridge_mass + rig.trolley_mass
    base = crane.world_body()
    for name, direction, frequency in zip(
        ("frame_x", "frame_y"), ((1, 0, 0), (0, 1, 0)), frame.frequency, strict=True
    ):
        omega = 2.0 * pi * frequency
        below, base = base, _add_body(crane, name)
        joint = _slide(crane, name, below, base, direction, 2.0 * frame.damping_ratio * mass * omega)
        crane.AddForceElement(PrismaticSpring(joint, 0.0, mass * omega**2))
        _add_rotor(crane, joint, frame.mass)
    return base


def _add_body(crane: MultibodyPlant, name: str, mass: float = 0.0) -> RigidBody:
    """A point."""
    return crane.AddRigidBody(name, SpatialInertia(mass, np.zeros(3), UnitInertia(0.0, 0.0, 0.0)))


def _add_rotor(crane: MultibodyPlant, joint: Joint, inertia: float) -> None:
    actuator = crane.AddJointActuator(joint.name(), joint)
    actuator.set_default_gear_ratio(1.0)
    actuator.set_default_rotor_inertia(inertia)


def _slide(
    crane: MultibodyPlant,
    name: str,
    below: RigidBody,
    body: RigidBody,
    axis: tuple[int, int, int],
    damping: float,
) -> PrismaticJoint:
    joint = PrismaticJoint(name, below.body_frame(), body.body_frame(), axis, damping=damping)
    return crane.AddJoint(joint)


def _turn(
    crane: MultibodyPlant,
    name: str,
    below: RigidBody,
    body: RigidBody,
    axis: tuple[int, int, int],
    damping: float,
) -> None:
    crane.AddJoint(RevoluteJoint(name, below.body_frame(), body.body_frame(), axis, damping=damping))

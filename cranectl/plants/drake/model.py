"""Build the rig as a tree of Drake's bodies and joints.

The tree is not parsed from `models/crane.xml`. Drake's MJCF parser would misplace the two hinges of one body,
and would leave out drives and rotors. Tests compare this tree with MuJoCo's, state by state.
"""

from math import pi

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    Joint,
    PrismaticJoint,
    PrismaticSpring,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.multibody.tree import Frame as JointFrame

from cranectl.plants.plant import DRIVES, Drive
from cranectl.plants.surroundings import gravity_in_rig
from cranectl.scenario import Body, EffectSettings, Frame, RigParameters
from cranectl.support import Array

AXES = ("bridge_position", "trolley_position", "rope_length")  # joints; each has an actuator of its name
JOINTS = (*AXES, "alpha", "beta")  # in the order of SignalGroup.STATE
LOAD, HOOK = "load", "hook"  # the hook is the rope's end if the load is a body under it

# An ideal drive turns a rotor so inert that no crane slows it: its acceleration is force / inertia.
IDEAL_INERTIA = 1e16  # [kg] of rotor for each kg of the crane


def build_crane(rig: RigParameters, drive: Drive, effects: EffectSettings) -> MultibodyPlant:
    """Build bridge, trolley, cardan joint, rope and load, with drives that take forces, in continuous time.

    Forces that are linear in the rates are damping of the joints: velocity drives and viscous friction.
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
    top, end = inner.body_frame(), _add_load(crane, rig.load_mass, effects.body)
    if effects.body:  # the rope length is measured to the centre of mass of the load, hanging straight
        top = _add_point(crane, "rope_top", inner, effects.body.hook_offset)
    axes = (
        _slide(crane, AXES[0], base.body_frame(), bridge, (1, 0, 0), damping=slowed[0]),
        _slide(crane, AXES[1], bridge.body_frame(), trolley, (0, 1, 0), damping=slowed[1]),
        _slide(crane, AXES[2], top, end, (0, 0, -1), damping=slowed[2]),
    )
    crane.AddJoint(
        RevoluteJoint("alpha", trolley.body_frame(), outer.body_frame(), (1, 0, 0), damping=turned)
    )
    crane.AddJoint(RevoluteJoint("beta", outer.body_frame(), inner.body_frame(), (0, -1, 0), damping=turned))
    for axis, inertia in zip(axes, rotor_inertias(rig, drive), strict=True):
        _add_rotor(crane, axis, inertia)
    crane.Finalize()
    return crane


def rotor_inertias(rig: RigParameters, drive: Drive) -> tuple[float, float, float]:
    """Return the rotor inertia of each drive [kg], which it moves in addition to the crane."""
    inertia = ideal_inertia(rig)
    if DRIVES[drive].is_prescribed:
        return inertia, inertia, inertia
    bridge, trolley, winch = rig.moves
    return (
        0.0 if bridge else inertia,
        rig.trolley_motor_mass if trolley else inertia,
        rig.winch_mass if winch else inertia,
    )


def ideal_inertia(rig: RigParameters) -> float:
    """Return the rotor inertia of an ideal drive [kg]."""
    return IDEAL_INERTIA * (rig.bridge_mass + rig.trolley_mass + rig.load_mass)


def drive_forces(rig: RigParameters, drive: Drive, effects: EffectSettings) -> tuple[Array, Array]:
    """Return gain (3,) and offset (3,) of the drives, whose forces are gain · command + offset [N]."""
    if DRIVES[drive].is_prescribed:
        return np.array(rotor_inertias(rig, drive)), np.zeros(3)
    gain, _, load_force = DRIVES[drive].push(rig, effects)
    return np.array(gain), 0.0 - np.array(load_force)  # no -0.0, as in the MJCF


def axis_damping(rig: RigParameters, drive: Drive, effects: EffectSettings) -> list[float]:
    """Return the damping of the driven joints [N s/m]: gain of a velocity drive plus viscous friction."""
    friction = np.array(effects.friction.viscous if effects.friction else (0.0, 0.0, 0.0))
    damping: list[float] = (np.array(DRIVES[drive].push(rig, effects)[1]) + friction).tolist()
    return damping


def _add_frame(crane: MultibodyPlant, frame: Frame, rig: RigParameters) -> RigidBody:
    """Add rails on a damped spring along x and along y; return the body that carries the bridge.

    The frequency is that of the empty rig. The mass of the rails is that of rotors, since it moves with them
    and has no weight along rails that slope.
    """
    mass = frame.mass + rig.bridge_mass + rig.trolley_mass
    base = crane.world_body()
    for name, direction, frequency in zip(
        ("frame_x", "frame_y"), ((1, 0, 0), (0, 1, 0)), frame.frequency, strict=True
    ):
        omega = 2.0 * pi * frequency
        below, base = base, _add_body(crane, name)
        joint = _slide(
            crane, name, below.body_frame(), base, direction, damping=2.0 * frame.damping_ratio * mass * omega
        )
        crane.AddForceElement(PrismaticSpring(joint, 0.0, mass * omega**2))
        _add_rotor(crane, joint, frame.mass)
    return base


def _add_load(crane: MultibodyPlant, mass: float, body: Body | None) -> RigidBody:
    """Add the load, a point or a body hinged under its hook; return the body at the rope's end."""
    if body is None:
        return _add_body(crane, LOAD, mass)
    hook = _add_body(crane, HOOK, body.hook_mass)
    load = _add_body(crane, LOAD, mass, body.inertia)
    hinge = _add_point(crane, "hinge", load, body.hook_offset)
    crane.AddJoint(BallRpyJoint("swing", hook.body_frame(), hinge, damping=body.swing_damping))
    return hook


def _add_point(crane: MultibodyPlant, name: str, body: RigidBody, height: float) -> JointFrame:
    """Add a coordinate frame `height` [m] above the origin of `body`."""
    return crane.AddFrame(FixedOffsetFrame(name, body.body_frame(), RigidTransform([0.0, 0.0, height])))


def _add_body(crane: MultibodyPlant, name: str, mass: float = 0.0, inertia: float = 0.0) -> RigidBody:
    """Add a body with the same inertia [kg m²] about all axes through its centre; 0 for a point."""
    about_axis = inertia / mass if inertia else 0.0
    return crane.AddRigidBody(name, SpatialInertia(mass, np.zeros(3), UnitInertia(*(about_axis,) * 3)))


def _add_rotor(crane: MultibodyPlant, joint: Joint, inertia: float) -> None:
    actuator = crane.AddJointActuator(joint.name(), joint)
    actuator.set_default_gear_ratio(1.0)
    actuator.set_default_rotor_inertia(inertia)


def _slide(
    crane: MultibodyPlant,
    name: str,
    below: JointFrame,
    body: RigidBody,
    axis: tuple[int, int, int],
    *,
    damping: float,
) -> PrismaticJoint:
    return crane.AddJoint(PrismaticJoint(name, below, body.body_frame(), axis, damping=damping))

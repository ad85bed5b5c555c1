"""A frame that gives way under its bridge."""

from math import pi

import mujoco

from cranectl.effects.settings import Frame

JOINTS = ("frame_x", "frame_y")
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def add_frame(spec: mujoco.MjSpec, frame: Frame) -> None:
    """Put the bridge on a damped spring along x and along y; its joints stay relative to the rails.

    The frame's mass is the inertia (armature) of these two joints. Its frequency is the empty rig's: no load,
    bridge and trolley standing on it.
    """
    bridge = spec.body("bridge")
    mass = frame.mass + bridge.mass + spec.body("trolley").mass
    for name, axis, frequency in zip(JOINTS, AXES, frame.frequency, strict=True):
        omega = 2.0 * pi * frequency
        joint = bridge.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        joint.armature = frame.mass
        joint.stiffness[0] = mass * omega**2
        joint.damping[0] = 2.0 * frame.damping_ratio * mass * omega

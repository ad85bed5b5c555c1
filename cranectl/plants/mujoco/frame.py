"""A frame that gives way under its bridge."""

from math import pi

import mujoco

from cranectl.plants.mujoco.entries import Entry
from cranectl.scenario.effects import Frame
from cranectl.scenario.rig import RigParameters

JOINTS = ("frame_x", "frame_y")
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def add_frame(spec: mujoco.MjSpec) -> None:
    """Put the bridge on a damped spring along x and along y; its joints stay relative to the rails."""
    for name, axis in zip(JOINTS, AXES, strict=True):
        spec.body("bridge").add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)


def frame_entries(frame: Frame, rig: RigParameters) -> list[Entry]:
    """The frame's mass, which is the inertia (armature) of the two joints, and their springs.

    Its frequency is the empty rig's: no load, bridge and trolley standing on it.
    """
    mass = frame.mass + rig.bridge_mass + rig.trolley_mass
    found: list[Entry] = []
    for name, frequency in zip(JOINTS, frame.frequency, strict=True):
        omega = 2.0 * pi * frequency
        found += [
            Entry("joint", name, "armature", frame.mass),
            Entry("joint", name, "stiffness", mass * omega**2),
            Entry("joint", name, "damping", 2.0 * frame.damping_ratio * mass * omega),
        ]
    return found

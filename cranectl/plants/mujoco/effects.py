"""Effects that are parts of the model: each adds what it is made of, then lists the numbers of it.

A load that swings under its hook, a frame that gives way under its bridge, friction, limits of force; the
rope has a file of its own. MADE has them all.
"""

from collections.abc import Callable
from math import pi
from typing import Any, NamedTuple

import mujoco

from cranectl.plants.mujoco.entries import Entry, Setting
from cranectl.plants.mujoco.rope import add_rope, rope_entries
from cranectl.scenario.effects import Body, DriveLimits, Frame, Friction

DRIVEN_JOINTS = ("bridge_position", "trolley_position", "rope_length")
CARDAN_JOINTS = ("alpha", "beta")
ACTUATORS = ("bridge_drive", "trolley_drive", "winch_drive")

# A hook has at least so much mass: MuJoCo wants some of every body that moves.
HOOK_MASS = 1e-9  # of the load's mass
HOOK_INERTIA = 1e-15  # [kg m²]


def hang_body(spec: mujoco.MjSpec, _body: Body, _of: Setting) -> None:
    """Part the filed point load in hook and load, joined by a ball joint `hook_offset` above the load."""
    hook = spec.body("load")
    geoms = [(g.name, g.type, g.size.copy(), g.fromto.copy(), g.material) for g in hook.geoms]
    hook.name = "hook"
    hook.inertia = (HOOK_INERTIA,) * 3
    spec.site("load").name = "hook"
    spec.sensor("rope_force").objname = "hook"
    load = hook.add_body(name="load")
    load.explicitinertial, load.ipos = True, (0.0, 0.0, 0.0)
    load.add_joint(name="swing", type=mujoco.mjtJoint.mjJNT_BALL)
    for geom in list(hook.geoms):
        spec.delete(geom)
    for name, kind, size, fromto, material in geoms:
        load.add_geom(name=name, type=kind, size=size, fromto=fromto, material=material)
    load.add_site(name="load")
    filed = spec.tendon("rope")
    width, material = filed.width, filed.material
    spec.delete(filed)
    rope = spec.add_tendon(name="rope", width=width, material=material)
    rope.wrap_site("pivot")
    rope.wrap_site("hook")


def body_entries(body: Body, of: Setting) -> list[Entry]:
    """Hook, load and the joint between them; the load's own mass is the rig's."""
    return [
        Entry("body", "hook", "mass", max(body.hook_mass, HOOK_MASS * of.rig.load_mass)),
        Entry("body", "load", "pos", (0.0, 0.0, -body.hook_offset)),
        Entry("body", "load", "inertia", (body.inertia,) * 3),
        Entry("joint", "swing", "pos", (0.0, 0.0, body.hook_offset)),
        Entry("joint", "swing", "damping", body.swing_damping),
    ]


FRAME = {"frame_x": (1.0, 0.0, 0.0), "frame_y": (0.0, 1.0, 0.0)}  # joints and their axes


def add_frame(spec: mujoco.MjSpec, _frame: Frame, _of: Setting) -> None:
    """Put the bridge on a damped spring along x and along y; its joints stay relative to the rails."""
    for name, axis in FRAME.items():
        spec.body("bridge").add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)


def frame_entries(frame: Frame, of: Setting) -> list[Entry]:
    """The frame's mass, which is the inertia (armature) of the two joints, and their springs.

    Its frequency is the empty rig's: no load, bridge and trolley standing on it.
    """
    mass = frame.mass + of.rig.bridge_mass + of.rig.trolley_mass
    found: list[Entry] = []
    for name, frequency in zip(FRAME, frame.frequency, strict=True):
        omega = 2.0 * pi * frequency
        found += [
            Entry("joint", name, "armature", frame.mass),
            Entry("joint", name, "stiffness", mass * omega**2),
            Entry("joint", name, "damping", 2.0 * frame.damping_ratio * mass * omega),
        ]
    return found


# A sticking joint creeps with force / mass · (1 - impedance) / impedance · time constant / 2, with these and
# steps of 1 ms with 1e-7 s · force / mass. A time constant below two steps is not stable.
IMPEDANCE = 0.9999  # the hardest that the engine takes
STEPS = 2.0
# The solver stops where its progress is small against the mean inertia, which ideal drives make 1e12 times
# that of the crane. With the engine's own 1e-8 it would not start.
TOLERANCE = 1e-30


def add_friction(spec: mujoco.MjSpec, _friction: Friction, of: Setting) -> None:
    """Friction of the engine's own: Coulomb's as a constraint that holds at rest, viscous as damping."""
    for name in (*CARDAN_JOINTS, *(DRIVEN_JOINTS if of.is_moved_by_force else ())):
        joint = spec.joint(name)
        joint.solref_friction = (STEPS * spec.option.timestep, 1.0)
        joint.solimp_friction[:2] = IMPEDANCE
    spec.option.tolerance = TOLERANCE


def friction_entries(friction: Friction, of: Setting) -> list[Entry]:
    """Coulomb's and viscous friction of each joint."""
    pivot = (friction.pivot_coulomb, friction.pivot_viscous)
    axes = zip(DRIVEN_JOINTS, friction.coulomb, friction.viscous, strict=True)
    found = [(name, *pivot) for name in CARDAN_JOINTS] + (list(axes) if of.is_moved_by_force else [])
    return [
        entry
        for name, coulomb, viscous in found
        for entry in (Entry("joint", name, "frictionloss", coulomb), Entry("joint", name, "damping", viscous))
    ]


def limit_forces(spec: mujoco.MjSpec, _limits: DriveLimits, _of: Setting) -> None:
    """Limit the whole force of each drive, the weight that the winch holds included."""
    for name in ACTUATORS:
        spec.actuator(name).forcelimited = True


def limit_entries(limits: DriveLimits, _of: Setting) -> list[Entry]:
    """The largest force of each drive."""
    forces = zip(ACTUATORS, limits.force, strict=True)
    return [Entry("actuator", name, "forcerange", (-force, force)) for name, force in forces]


class Made(NamedTuple):
    """How the engine shows an effect: what it adds, its numbers, and what of the engine it needs."""

    add: Callable[[mujoco.MjSpec, Any, Setting], None]
    entries: Callable[[Any, Setting], list[Entry]]
    needs: tuple[mujoco.mjtDisableBit, ...] = ()  # else switched off
    is_shown: Callable[[Setting], bool] = lambda _: True


_BIT = mujoco.mjtDisableBit
MADE = {
    "body": Made(hang_body, body_entries, needs=(_BIT.mjDSBL_DAMPER,)),
    "rope": Made(add_rope, rope_entries),
    "frame": Made(add_frame, frame_entries, needs=(_BIT.mjDSBL_SPRING, _BIT.mjDSBL_DAMPER)),
    "friction": Made(
        add_friction,
        friction_entries,
        needs=(_BIT.mjDSBL_CONSTRAINT, _BIT.mjDSBL_WARMSTART, _BIT.mjDSBL_DAMPER),
    ),
    "limits": Made(limit_forces, limit_entries, is_shown=lambda of: of.is_moved_by_force),
}

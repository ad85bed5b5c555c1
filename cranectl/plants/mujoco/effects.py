"""Effects that are parts of the model: each adds what it is made of, then lists the numbers of it.

Numbers that follow from parameters are written alike into a spec and into what is compiled of it. So a model
that takes other parameters in place becomes, bit for bit, the one that would be compiled for them. Effects
are a load that swings under its hook, a rope that gives, a frame that gives way under its bridge, friction,
limits of force. MADE has them all.
"""

from collections.abc import Callable, Iterable
from math import pi
from typing import Any, NamedTuple

import mujoco
import numpy as np

from cranectl.plants.mujoco.rope import DISTANCE, ELASTICITY, MASS
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import Body, DriveLimits, Frame, Friction, Rope
from cranectl.scenario.rig import RigParameters

DRIVEN_JOINTS = ("bridge_position", "trolley_position", "rope_length")
CARDAN_JOINTS = ("alpha", "beta")
ACTUATORS = ("bridge_drive", "trolley_drive", "winch_drive")

COMPILED = {"ref": "qpos0"}  # fields that have another name in a compiled model


class Entry(NamedTuple):
    """A number of one element, or the first numbers of a list, by their names in MJCF."""

    element: str  # body, joint, actuator; or option, which has no name
    name: str
    field: str
    value: float | tuple[float, ...]


class Setting(NamedTuple):
    """What an effect is part of."""

    rig: RigParameters
    drive: Drive
    drawn: float  # length of rope in the file, measured to the load [m]
    length: float  # and to the hook

    @property
    def is_moved_by_force(self) -> bool:
        """False for ideal drives, which no force can hold."""
        return not DRIVES[self.drive].is_prescribed


def write_spec(spec: mujoco.MjSpec, entries: Iterable[Entry]) -> None:
    """Set all entries before compiling."""
    for element, name, field, value in entries:
        owner: Any = spec.option if element == "option" else getattr(spec, element)(name)
        if isinstance(getattr(owner, field), np.ndarray):
            numbers = np.atleast_1d(value)
            getattr(owner, field)[: len(numbers)] = numbers
        else:
            setattr(owner, field, value)


def write_model(model: mujoco.MjModel, entries: Iterable[Entry]) -> None:
    """Set all entries in a compiled model, but nothing that follows from them."""
    for element, name, field, value in entries:
        owner = model.opt if element == "option" else getattr(model, element)(name)
        view = getattr(owner, COMPILED.get(field, field))
        size = len(value) if isinstance(value, tuple) else len(view)  # one number: of a ball joint, all three
        view[:size] = value


def derive_constants(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Bring what the compiler derives from entries up to date: `mj_setConst`, and what that leaves alone.

    That is the mean inertia, by which the solver of friction stops, the mean mass, and the tendons' lengths
    at rest. `data` is left anyhow.
    """
    mujoco.mj_resetData(model, data)
    mujoco.mj_setConst(model, data)
    model.stat.meaninertia = np.cumsum(model.dof_M0)[-1] / model.nv  # summed in the engine's order
    model.stat.meanmass = np.cumsum(model.body_mass[1:])[-1] / (model.nbody - 1)
    data.qpos[:] = model.qpos_spring
    for positions in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon):
        positions(model, data)
    model.tendon_lengthspring[:] = data.ten_length[:, np.newaxis]


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
    """Return the numbers of hook, load and the joint between them; the mass of the load is the rig's."""
    return [
        Entry("body", "hook", "mass", max(body.hook_mass, HOOK_MASS * of.rig.load_mass)),
        Entry("body", "load", "pos", (0.0, 0.0, -body.hook_offset)),
        Entry("body", "load", "inertia", (body.inertia,) * 3),
        Entry("joint", "swing", "pos", (0.0, 0.0, body.hook_offset)),
        Entry("joint", "swing", "damping", body.swing_damping),
    ]


WINCH_MASS = 1e-9  # [kg] of the winch's body; the rotor's inertia is the joint's armature
LARGEST_FORCE = 1e12  # [N]
SLENDER = 1e-6  # inertia of the rope about itself, of that across


def add_rope(spec: mujoco.MjSpec, rope: Rope, _of: Setting) -> None:
    """Part the filed rope joint in winch and distance, and pull with a tendon between them."""
    distance = spec.joint("rope_length")
    distance.name = DISTANCE
    distance.armature = 0.0
    winch = spec.body("trolley").add_body(name="winch")
    winch.explicitinertial, winch.ipos = True, (0.0, 0.0, 0.0)
    winch.mass, winch.inertia = WINCH_MASS, (WINCH_MASS,) * 3
    winch.add_joint(name="rope_length", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0.0, 0.0, -1.0))
    stretch = spec.add_tendon(name=ELASTICITY)
    stretch.wrap_joint(DISTANCE, 1.0)
    stretch.wrap_joint("rope_length", -1.0)
    pull = spec.add_actuator(name=ELASTICITY, target=ELASTICITY, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    pull.gear[0] = -1.0  # a positive force pulls
    pull.gaintype, pull.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    pull.gainprm[0] = 0.0
    pull.forcelimited = True
    pull.forcerange = (0.0, LARGEST_FORCE)
    spec.delete(spec.sensor("rope_force"))
    spec.add_sensor(
        name="rope_force",
        type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
        objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
        objname=ELASTICITY,
    )
    if rope.mass > 0.0:
        distance.parent.add_body(name=MASS).explicitinertial = True


def rope_entries(rope: Rope, of: Setting) -> list[Entry]:
    """Return the numbers of the rope in the compiled model: no tension, and a mass if it has one.

    Its mass is a thin rod above its end, cut off at the pivot: it moves with what the winch pays out.
    """
    density, length = rope.mass, of.length
    entries = [
        Entry("joint", DISTANCE, "ref", of.drawn),
        Entry("joint", DISTANCE, "range", of.rig.rope_range),
        Entry("actuator", ELASTICITY, "biasprm", (0.0, 0.0, 0.0)),
    ]
    if density == 0.0:
        return entries
    across = density * length**3 / 12.0
    return [
        *entries,
        Entry("body", MASS, "mass", density * length),
        Entry("body", MASS, "ipos", (0.0, 0.0, 0.5 * length)),
        Entry("body", MASS, "inertia", (across, across, SLENDER * across)),
    ]


FRAME = {"frame_x": (1.0, 0.0, 0.0), "frame_y": (0.0, 1.0, 0.0)}  # joints and their axes


def add_frame(spec: mujoco.MjSpec, _frame: Frame, _of: Setting) -> None:
    """Put the bridge on a damped spring along x and along y; its joints stay relative to the rails."""
    for name, axis in FRAME.items():
        spec.body("bridge").add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)


def frame_entries(frame: Frame, of: Setting) -> list[Entry]:
    """Return the frame's mass, as inertia (armature) of its two joints, and their springs.

    Its frequency is the empty rig's: no load, bridge and trolley standing on it.
    """
    mass = frame.mass + of.rig.bridge_mass + of.rig.trolley_mass
    entries: list[Entry] = []
    for name, frequency in zip(FRAME, frame.frequency, strict=True):
        omega = 2.0 * pi * frequency
        entries += [
            Entry("joint", name, "armature", frame.mass),
            Entry("joint", name, "stiffness", mass * omega**2),
            Entry("joint", name, "damping", 2.0 * frame.damping_ratio * mass * omega),
        ]
    return entries


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
    joints = [(name, *pivot) for name in CARDAN_JOINTS] + (list(axes) if of.is_moved_by_force else [])
    return [
        entry
        for name, coulomb, viscous in joints
        for entry in (Entry("joint", name, "frictionloss", coulomb), Entry("joint", name, "damping", viscous))
    ]


def limit_forces(spec: mujoco.MjSpec, _limits: DriveLimits, _of: Setting) -> None:
    """Limit the whole force of each drive, the weight that the winch holds included."""
    for name in ACTUATORS:
        spec.actuator(name).forcelimited = True


def limit_entries(limits: DriveLimits, _of: Setting) -> list[Entry]:
    """Return the largest force of each drive."""
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

"""Effects as parts of the MuJoCo model: a function adds the elements of each, another lists their numbers.

Numbers that depend on parameters can be written into a spec or into its compiled model. So a compiled model
that takes other parameters becomes, bit for bit, the one that would be compiled for them.

The effects are a load that swings under its hook, an elastic rope, an elastic frame, friction and limits of
force. EFFECT_MODELS lists them all.
"""

from collections.abc import Callable, Iterable
from math import pi
from typing import Any, NamedTuple

import mujoco
import numpy as np

from cranectl.plants.mujoco.rope import DISTANCE, ELASTICITY, MASS
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario import Body, DriveLimits, Frame, Friction, RigParameters, Rope

DRIVEN_JOINTS = ("bridge_position", "trolley_position", "rope_length")
CARDAN_JOINTS = ("alpha", "beta")
ACTUATORS = ("bridge_drive", "trolley_drive", "winch_drive")

COMPILED_NAMES = {"ref": "qpos0"}  # names in a compiled model of fields that have another one in a spec


class Entry(NamedTuple):
    """A number of an element, or the first numbers of a list, by its name in MJCF."""

    element: str  # body, joint, actuator; or option, with an empty name
    name: str
    field: str
    value: float | tuple[float, ...]


class Setting(NamedTuple):
    """What effects need to know of the model that they are added to."""

    rig: RigParameters
    drive: Drive
    drawn: float  # length of rope in the model file [m], measured to the load's centre
    length: float  # the same, measured to the hook [m]

    @property
    def is_moved_by_force(self) -> bool:
        """Whether forces move the drives; False for ideal drives."""
        return not DRIVES[self.drive].is_prescribed


def write_spec(spec: mujoco.MjSpec, entries: Iterable[Entry]) -> None:
    """Set all entries in a spec, before it is compiled."""
    for element, name, field, value in entries:
        owner: Any = spec.option if element == "option" else getattr(spec, element)(name)
        if isinstance(getattr(owner, field), np.ndarray):
            numbers = np.atleast_1d(value)
            getattr(owner, field)[: len(numbers)] = numbers
        else:
            setattr(owner, field, value)


def write_model(model: mujoco.MjModel, entries: Iterable[Entry]) -> None:
    """Set all entries in a compiled model; `derive_constants` must follow."""
    for element, name, field, value in entries:
        owner = model.opt if element == "option" else getattr(model, element)(name)
        view = getattr(owner, COMPILED_NAMES.get(field, field))
        size = len(value) if isinstance(value, tuple) else len(view)  # one number sets all of a ball joint
        view[:size] = value


def derive_constants(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Update what the compiler derives from entries: with `mj_setConst`, and here what that does not update.

    Not updated by it are the mean inertia, which the solver of friction uses to stop, the mean mass, and the
    tendons' lengths at rest. The state in `data` is lost.
    """
    mujoco.mj_resetData(model, data)
    mujoco.mj_setConst(model, data)
    model.stat.meaninertia = np.cumsum(model.dof_M0)[-1] / model.nv  # summed in the engine's order
    model.stat.meanmass = np.cumsum(model.body_mass[1:])[-1] / (model.nbody - 1)
    data.qpos[:] = model.qpos_spring
    for positions in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon):
        positions(model, data)
    model.tendon_lengthspring[:] = data.ten_length[:, np.newaxis]


# Least mass and inertia of a hook: MuJoCo requires some of every moving body.
HOOK_MASS = 1e-9  # of the load's mass
HOOK_INERTIA = 1e-15  # [kg m²]


def hang_body(spec: mujoco.MjSpec, _body: Body, _of: Setting) -> None:
    """Split the model file's point load into hook and load, joined by a ball joint."""
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
    # The file's tendon ends at a site called `load`, which is now below the hook.
    filed = spec.tendon("rope")
    width, material = filed.width, filed.material
    spec.delete(filed)
    rope = spec.add_tendon(name="rope", width=width, material=material)
    rope.wrap_site("pivot")
    rope.wrap_site("hook")


def body_entries(body: Body, of: Setting) -> list[Entry]:
    """Return the numbers of hook and load, except the load's mass, and of the ball joint above the load."""
    return [
        Entry("body", "hook", "mass", max(body.hook_mass, HOOK_MASS * of.rig.load_mass)),
        Entry("body", "load", "pos", (0.0, 0.0, -body.hook_offset)),
        Entry("body", "load", "inertia", (body.inertia,) * 3),
        Entry("joint", "swing", "pos", (0.0, 0.0, body.hook_offset)),
        Entry("joint", "swing", "damping", body.swing_damping),
    ]


WINCH_MASS = 1e-9  # [kg] of the winch's body; the rotor's inertia is the joint's armature
MAX_FORCE = 1e12  # [N]
SLENDER = 1e-6  # inertia of the rope about its own axis, as a share of that across; MuJoCo asks for some


def add_rope(spec: mujoco.MjSpec, rope: Rope, _of: Setting) -> None:
    """Split the model file's rope joint into winch and distance, and add a tendon that pulls between them."""
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
    pull.gainprm[0] = 0.0  # no command acts: the force is the bias
    pull.forcelimited = True
    pull.forcerange = (0.0, MAX_FORCE)
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
    """Return the numbers of the rope as compiled: no tension yet, and its mass, if it has any.

    The mass is a thin rod from the rope's end up to the pivot, and moves with the rope that is paid out.
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
    """Put the bridge on a damped spring along x and along y; its own joint stays relative to the rails."""
    for name, axis in FRAME.items():
        spec.body("bridge").add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)


def frame_entries(frame: Frame, of: Setting) -> list[Entry]:
    """Return the frame's mass, as inertia (armature) of its two joints, and the springs and dampers.

    The frequency is that of the empty rig: bridge and trolley stand on the frame, without a load.
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


# A stuck joint creeps at force / mass · (1 - impedance) / impedance · time constant / 2. With these values
# and steps of 1 ms this is 1e-7 s · force / mass. A time constant below two steps is not stable.
MAX_IMPEDANCE = 0.9999  # the largest that the engine accepts
FRICTION_STEPS = 2.0  # time constant of friction, in steps
# The solver stops when its progress is small compared with the mean inertia. Ideal drives make that 1e12
# times the crane's, so with the engine's default of 1e-8 the solver would not start.
SOLVER_TOLERANCE = 1e-30


def add_friction(spec: mujoco.MjSpec, _friction: Friction, of: Setting) -> None:
    """Switch on the engine's friction: Coulomb's is a constraint that holds at rest, viscous is damping."""
    for name in (*CARDAN_JOINTS, *(DRIVEN_JOINTS if of.is_moved_by_force else ())):
        joint = spec.joint(name)
        joint.solref_friction = (FRICTION_STEPS * spec.option.timestep, 1.0)
        joint.solimp_friction[:2] = MAX_IMPEDANCE
    spec.option.tolerance = SOLVER_TOLERANCE


def friction_entries(friction: Friction, of: Setting) -> list[Entry]:
    """Return Coulomb's and viscous friction of each joint."""
    pivot = (friction.pivot_coulomb, friction.pivot_viscous)
    axes = zip(DRIVEN_JOINTS, friction.coulomb * np.array(of.rig.moves), friction.viscous, strict=True)
    joints = [(name, *pivot) for name in CARDAN_JOINTS] + (list(axes) if of.is_moved_by_force else [])
    return [
        entry
        for name, coulomb, viscous in joints
        for entry in (Entry("joint", name, "frictionloss", coulomb), Entry("joint", name, "damping", viscous))
    ]


def limit_forces(spec: mujoco.MjSpec, _limits: DriveLimits, _of: Setting) -> None:
    """Limit the whole force of each drive, including the weight that the winch holds."""
    for name in ACTUATORS:
        spec.actuator(name).forcelimited = True


def limit_entries(limits: DriveLimits, _of: Setting) -> list[Entry]:
    """Return the largest force of each drive."""
    forces = zip(ACTUATORS, limits.force, strict=True)
    return [Entry("actuator", name, "forcerange", (-force, force)) for name, force in forces]


class EffectModel(NamedTuple):
    """An effect in the engine: what it adds, its numbers, and which features of the engine it needs."""

    add: Callable[[mujoco.MjSpec, Any, Setting], None]  # must keep the names of the driven joints
    entries: Callable[[Any, Setting], list[Entry]]
    needs: tuple[mujoco.mjtDisableBit, ...] = ()  # features that stay on; without effects they are off
    is_shown: Callable[[Setting], bool] = lambda _: True


_BIT = mujoco.mjtDisableBit
EFFECT_MODELS = {
    "body": EffectModel(hang_body, body_entries, needs=(_BIT.mjDSBL_DAMPER,)),
    "rope": EffectModel(add_rope, rope_entries),
    "frame": EffectModel(add_frame, frame_entries, needs=(_BIT.mjDSBL_SPRING, _BIT.mjDSBL_DAMPER)),
    "friction": EffectModel(
        add_friction,
        friction_entries,
        needs=(_BIT.mjDSBL_CONSTRAINT, _BIT.mjDSBL_WARMSTART, _BIT.mjDSBL_DAMPER),
    ),
    "limits": EffectModel(limit_forces, limit_entries, is_shown=lambda of: of.is_moved_by_force),
}

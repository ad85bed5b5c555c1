"""`models/crane.xml` for one run: parameters set by name, velocity drives as filed or motors instead."""

import functools

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.mujoco.effects import (
    CARDAN_JOINTS,
    DRIVEN_JOINTS,
    add_frame,
    add_friction,
    body_entries,
    frame_entries,
    friction_entries,
    hang_body,
)
from cranectl.plants.mujoco.entries import Entry, write_spec
from cranectl.plants.mujoco.geometry import draw_to_scale
from cranectl.plants.mujoco.rope import DISTANCE, add_rope, rope_entries
from cranectl.plants.plant import Drive
from cranectl.plants.surroundings import gravity_in_rig
from cranectl.scenario.effects import NO_EFFECTS, EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.support import resources

JOINTS = (*DRIVEN_JOINTS, *CARDAN_JOINTS)
BODIES = ("bridge", "trolley", "load")
DRIVES = ("bridge_drive", "trolley_drive", "winch_drive")
DRAWN_LENGTH = 0.7  # [m] of rope in the file, without which the cardan angles would have no inertia

# An ideal drive is a motor on a joint so inert that nothing can move it: acceleration = command to 1e-12.
IDEAL_INERTIA = 1e12  # per kg of the crane


@functools.lru_cache(maxsize=8)
def compiled_model(
    rig: RigParameters, drive: Drive, step: float, effects: EffectSettings = NO_EFFECTS
) -> mujoco.MjModel:
    """The model of runs, without drawing; plants of the same rig copy it, and must not change it."""
    spec = model_spec(rig, drive=drive, step=step, effects=effects)
    leave_out_idle(spec, effects)
    return spec.compile()


@functools.lru_cache(maxsize=8)
def model_description(
    rig: RigParameters, drive: Drive, step: float, effects: EffectSettings = NO_EFFECTS
) -> str:
    """MJCF of the model as drawn, to the size of its rig."""
    spec = model_spec(rig, drive=drive, step=step, effects=effects)
    draw_to_scale(spec, rig)
    spec.compile()  # which writing it needs
    return str(spec.to_xml())


def model_spec(
    rig: RigParameters, *, drive: Drive, step: float, effects: EffectSettings = NO_EFFECTS
) -> mujoco.MjSpec:
    """The filed model, as drawn, with the parameters, drives, effects and physics step [s] of one run."""
    spec = mujoco.MjSpec.from_file(str(resources.MODEL_FILE))
    spec.option.timestep = step
    # The file's joint ranges are the rig's end stops. Leaving them is judged by the run, the same on every
    # plant, so that a run that is told to record a violation does not hit a wall on one plant only.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    _add_structure(spec, drive, effects)
    write_spec(spec, model_entries(rig, drive, effects))
    return spec


def _add_structure(spec: mujoco.MjSpec, drive: Drive, effects: EffectSettings) -> None:
    """What effects and drives are made of. The driven joints keep their names."""
    if effects.body:
        hang_body(spec)
    if effects.rope:
        add_rope(spec, heavy=effects.rope.mass > 0.0)
    if effects.frame:
        add_frame(spec)
    if effects.friction:
        add_friction(spec, on_axes=drive != "ideal")
    if effects.limits and drive != "ideal":
        for name in DRIVES:  # the whole force, the weight that the winch holds included
            spec.actuator(name).forcelimited = True
    if drive != "velocity":
        for name in DRIVES:
            spec.actuator(name).set_to_motor()


def structure_of(effects: EffectSettings) -> tuple[object, ...]:
    """What cannot change in a compiled model."""
    heavy = effects.rope is not None and effects.rope.mass > 0.0
    return (effects.names, heavy)


def model_entries(rig: RigParameters, drive: Drive, effects: EffectSettings) -> list[Entry]:
    """Every number of the model that depends on the parameters; which ones, on the structure only."""
    offset = effects.body.hook_offset if effects.body else 0.0
    drawn = DRAWN_LENGTH + offset  # measured length counts to the load's centre of mass, hanging still
    found = [Entry("option", "", "gravity", gravity_in_rig(rig.gravity, effects))]
    found += [Entry("body", body, "mass", getattr(rig, f"{body}_mass")) for body in BODIES]
    ranges = zip(DRIVEN_JOINTS, (rig.bridge_range, rig.trolley_range, rig.rope_range), strict=True)
    found += [Entry("joint", joint, "range", limits) for joint, limits in ranges]
    found += [Entry("joint", "rope_length", "ref", drawn)]
    if drive == "ideal":
        found += _set_ideal_drives(rig)
    elif drive == "velocity":
        found += _set_velocity_drives(rig)
    else:  # motors, a force for a command
        found += [Entry("joint", "rope_length", "armature", rig.winch_mass)]
    if effects.body:
        found += body_entries(effects.body, rig.load_mass)
    if effects.rope:
        found += [Entry("joint", DISTANCE, "ref", drawn), Entry("joint", DISTANCE, "range", rig.rope_range)]
        found += rope_entries(effects.rope.mass, drawn - offset)
    if effects.frame:
        found += frame_entries(effects.frame, rig)
    if effects.friction:
        found += friction_entries(effects.friction, on_axes=drive != "ideal")
    if effects.limits and drive != "ideal":
        forces = zip(DRIVES, effects.limits.force, strict=True)
        found += [Entry("actuator", name, "forcerange", (-force, force)) for name, force in forces]
    return found


def ideal_inertia(rig: RigParameters) -> float:
    """Of each ideal drive [kg]: 1e12 times whatever pulls on it, be it the load, rails that slope or give."""
    return IDEAL_INERTIA * (rig.bridge_mass + rig.trolley_mass + rig.load_mass)


def _set_ideal_drives(rig: RigParameters) -> list[Entry]:
    """Motors that accelerate what stands on their axes as well; the load, which hangs, only pulls."""
    inertia = ideal_inertia(rig)
    carried = (rig.bridge_mass + rig.trolley_mass, rig.trolley_mass, 0.0)
    drives = []
    for name, joint, mass in zip(DRIVES, DRIVEN_JOINTS, carried, strict=True):
        gear = (inertia + mass, 0.0, 0.0, 0.0, 0.0, 0.0)
        drives.append(Entry("actuator", name, "gear", gear))
        drives.append(Entry("joint", joint, "armature", inertia))
    return drives


def _set_velocity_drives(rig: RigParameters) -> list[Entry]:
    armature = rig.winch_mass
    held_forces = (0.0, 0.0, -rig.weight)
    drives = []
    for name, gain, held in zip(DRIVES, rig.velocity_gains.tolist(), held_forces, strict=True):
        proportional = (gain,)
        bias = (held, 0.0, -gain)
        drives.append(Entry("actuator", name, "gainprm", proportional))
        drives.append(Entry("actuator", name, "biasprm", bias))
    drives.append(Entry("joint", "rope_length", "armature", armature))
    return drives


def state_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Index of each of JOINTS in qpos."""
    return np.array([model.joint(name).qposadr[0] for name in JOINTS], dtype=np.int64)


def rate_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Index of each of JOINTS in qvel; not that in qpos behind a ball joint."""
    return np.array([model.joint(name).dofadr[0] for name in JOINTS], dtype=np.int64)


def sensor_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Index in sensordata of load position (3), load velocity (3), rope tension (1)."""
    position, velocity, force = (
        model.sensor(name).adr[0] for name in ("load_position", "load_velocity", "rope_force")
    )
    # The force of a rigid rope has three components, the last along the rope.
    last = model.sensor("rope_force").dim[0] - 1
    return np.array(
        [*range(position, position + 3), *range(velocity, velocity + 3), force + last], dtype=np.int64
    )


def drive_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Index of each of DRIVES in ctrl."""
    return np.array([model.actuator(name).id for name in DRIVES], dtype=np.int64)


DRAWN_ROPE = "rope"  # tendon
ENCODERS = (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL)


def leave_out_idle(spec: mujoco.MjSpec, effects: EffectSettings) -> None:
    """Take away what is only drawn, the encoders, which a run reads in qpos and qvel, and idle forces.

    All geoms are massless and touch nothing. The engine looks for springs, dampers and constraints at each
    stage of a step, of which the crane has only what effects bring; and for groups of bodies that constraints
    do not join, of which the crane is one. (Without a warm start friction would differ in the last digits,
    and take longer.)
    """
    encoders = [sensor for sensor in spec.sensors if sensor.type in ENCODERS]
    drawing = [*spec.geoms, spec.tendon(DRAWN_ROPE), *spec.materials, *spec.textures]
    drawing += [*spec.cameras, *spec.lights]
    for element in [*drawing, *encoders]:
        spec.delete(element)
    spec.stat.meansize = 1.0  # a scale of pictures, which the compiler would guess from the bodies
    idle = mujoco.mjtDisableBit
    _disable(spec, idle.mjDSBL_ISLAND)
    if not effects.friction:
        _disable(spec, idle.mjDSBL_CONSTRAINT, idle.mjDSBL_WARMSTART)
    if not effects.frame:
        _disable(spec, idle.mjDSBL_SPRING)
    if not (effects.frame or effects.friction or effects.body):
        _disable(spec, idle.mjDSBL_DAMPER)


def _disable(spec: mujoco.MjSpec, *flags: mujoco.mjtDisableBit) -> None:
    for flag in flags:
        spec.option.disableflags |= int(flag)

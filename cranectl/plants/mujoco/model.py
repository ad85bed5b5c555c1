"""`models/crane.xml` for one run: parameters set by name, velocity drives as filed or motors instead."""

import copy
import functools
from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.mujoco.effects import (
    ACTUATORS,
    CARDAN_JOINTS,
    DRIVEN_JOINTS,
    MADE,
    Entry,
    Made,
    Setting,
    write_spec,
)
from cranectl.plants.mujoco.geometry import draw_to_scale
from cranectl.plants.plant import DRIVES, Drive
from cranectl.plants.surroundings import gravity_in_rig
from cranectl.scenario.effects import NO_EFFECTS, Effect, EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.support import resources

JOINTS = (*DRIVEN_JOINTS, *CARDAN_JOINTS)
BODIES = ("bridge", "trolley", "load")
DRAWN_LENGTH = 0.7  # [m] of rope in the file, without which the cardan angles would have no inertia

# An ideal drive is a motor on a joint so inert that nothing can move it: acceleration = command to 1e-12.
IDEAL_INERTIA = 1e12  # per kg of the crane


@functools.lru_cache(maxsize=8)
def compiled_model(
    rig: RigParameters, drive: Drive, step: float, effects: EffectSettings = NO_EFFECTS
) -> mujoco.MjModel:
    """Compile the model of runs, without drawing; plants of the same rig copy it, and must not change it."""
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
    """Return the scaled model with the parameters, drives, effects and physics step [s] of one run."""
    spec = mujoco.MjSpec.from_file(str(resources.MODEL_FILE))
    spec.option.timestep = step
    # The file's joint ranges are the rig's end stops. Leaving them is judged by the run, the same on every
    # plant, so that a run that is told to record a violation does not hit a wall on one plant only.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    setting = _setting(rig, drive, effects)
    for made, own in _shown(effects, setting):
        made.add(spec, own, setting)
    if not DRIVES[drive].is_servo:
        for name in ACTUATORS:
            spec.actuator(name).set_to_motor()
    write_spec(spec, model_entries(rig, drive, effects))
    return spec


def _setting(rig: RigParameters, drive: Drive, effects: EffectSettings) -> Setting:
    offset = effects.body.hook_offset if effects.body else 0.0
    drawn = DRAWN_LENGTH + offset  # measured length counts to the load's centre of mass, hanging still
    return Setting(rig, drive, drawn, drawn - offset)


def _shown(effects: EffectSettings, setting: Setting) -> Iterator[tuple[Made, Effect]]:
    """Yield the effects that the model shows. The driven joints keep their names."""
    for name, made in MADE.items():
        own = getattr(effects, name)
        if own is not None and made.is_shown(setting):
            yield made, own


def structure_of(effects: EffectSettings) -> tuple[object, ...]:
    """Return what decides the structure of the compiled model."""
    heavy = effects.rope is not None and effects.rope.mass > 0.0
    return (effects.names, heavy)


def model_entries(rig: RigParameters, drive: Drive, effects: EffectSettings) -> list[Entry]:
    """Return every number of the model that depends on parameters; the structure decides which there are."""
    setting = _setting(rig, drive, effects)
    entries = [Entry("option", "", "gravity", gravity_in_rig(rig.gravity, effects))]
    entries += [Entry("body", body, "mass", getattr(rig, f"{body}_mass")) for body in BODIES]
    ranges = zip(DRIVEN_JOINTS, (rig.bridge_range, rig.trolley_range, rig.rope_range), strict=True)
    entries += [Entry("joint", joint, "range", limits) for joint, limits in ranges]
    entries += [Entry("joint", "rope_length", "ref", setting.drawn)]
    if DRIVES[drive].is_prescribed:
        entries += _set_ideal_drives(rig)
    elif DRIVES[drive].is_servo:
        entries += _set_velocity_drives(rig, drive, effects)
    else:  # motors, a force for a command
        entries += [Entry("joint", "rope_length", "armature", rig.winch_mass)]
    shown = _shown(effects, setting)
    return [*entries, *(entry for made, own in shown for entry in made.entries(own, setting))]


def ideal_inertia(rig: RigParameters) -> float:
    """Return the rotor inertia of each ideal drive [kg]: 1e12 times whatever pulls on it."""
    return IDEAL_INERTIA * (rig.bridge_mass + rig.trolley_mass + rig.load_mass)


def _set_ideal_drives(rig: RigParameters) -> list[Entry]:
    """Motors that accelerate what stands on their axes as well; the load, which hangs, only pulls."""
    inertia = ideal_inertia(rig)
    carried = (rig.bridge_mass + rig.trolley_mass, rig.trolley_mass, 0.0)
    drives = []
    for name, joint, mass in zip(ACTUATORS, DRIVEN_JOINTS, carried, strict=True):
        gear = (inertia + mass, 0.0, 0.0, 0.0, 0.0, 0.0)
        drives.append(Entry("actuator", name, "gear", gear))
        drives.append(Entry("joint", joint, "armature", inertia))
    return drives


def _set_velocity_drives(rig: RigParameters, drive: Drive, effects: EffectSettings) -> list[Entry]:
    armature = rig.winch_mass
    drives = []
    for name, gain, damping, load_force in zip(ACTUATORS, *DRIVES[drive].push(rig, effects), strict=True):
        proportional = (gain,)
        bias = (0.0 - load_force, 0.0, -damping)
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
    """Index of each of ACTUATORS in ctrl."""
    return np.array([model.actuator(name).id for name in ACTUATORS], dtype=np.int64)


DRAWN_ROPE = "rope"  # tendon
IDLE = frozenset({mujoco.mjtDisableBit.mjDSBL_ISLAND}.union(*(made.needs for made in MADE.values())))
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
    shown = [made.needs for name, made in MADE.items() if getattr(effects, name) is not None]
    for flag in IDLE.difference(*shown):
        spec.option.disableflags |= int(flag)


FINE_DIFFERENCE = 1e-9  # [m, rad, m/s, rad/s], below the stretch of a stiff rope


def fastest_rate(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Largest modulus of the poles about the state in `data` [1/s], which is left as it is.

    From finite differences of the engine's own accelerations, with axes that slide: Coulomb's friction, which
    the engine keeps slow enough by itself, would hide what they do.
    """
    model = copy.copy(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
    trial = mujoco.MjData(model)
    qpos, qvel = data.qpos.copy(), data.qvel.copy()
    n = model.nv

    def acceleration() -> NDArray[np.float64]:
        mujoco.mj_forward(model, trial)
        qacc: NDArray[np.float64] = trial.qacc.copy()
        return qacc

    trial.qpos[:], trial.qvel[:], trial.ctrl[:] = qpos, qvel, data.ctrl
    rest = acceleration()
    system = np.zeros((2 * n, 2 * n))
    system[:n, n:] = np.eye(n)
    for k in range(n):
        direction = np.zeros(n)
        direction[k] = 1.0
        trial.qpos[:] = qpos
        mujoco.mj_integratePos(model, trial.qpos, direction, FINE_DIFFERENCE)
        system[n:, k] = (acceleration() - rest) / FINE_DIFFERENCE
        trial.qpos[:] = qpos
        trial.qvel[:] = qvel + FINE_DIFFERENCE * direction
        system[n:, n + k] = (acceleration() - rest) / FINE_DIFFERENCE
        trial.qvel[:] = qvel
    return float(np.abs(np.linalg.eigvals(system)).max())

"""Make the MuJoCo model of a run from `models/crane.xml`.

Parameters are set by name. Drives are the velocity servos of the file, or motors instead.
"""

import copy
import functools
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.differences import FINE_DIFFERENCE
from cranectl.plants.mujoco.effects import (
    ACTUATORS,
    CARDAN_JOINTS,
    DRIVEN_JOINTS,
    EFFECT_MODELS,
    EffectModel,
    Entry,
    Setting,
    write_spec,
)
from cranectl.plants.mujoco.geometry import draw_to_scale
from cranectl.plants.plant import DRIVES, Drive
from cranectl.plants.surroundings import gravity_in_rig
from cranectl.scenario import EffectSettings, RigParameters
from cranectl.support import Shipped

JOINTS = (*DRIVEN_JOINTS, *CARDAN_JOINTS)
BODIES = ("bridge", "trolley", "load")
DRAWN_LENGTH = 0.7  # [m] of rope in the file; with none, the cardan angles would have no inertia

# An ideal drive is a motor on a joint so inert that nothing can move it: acceleration = command to 1e-12.
IDEAL_INERTIA = 1e12  # [kg] of rotor for each kg of the crane

STOPPING_RATE = 10.0  # [1/s] of the servos on fixed axes; slow for every step

# Features of the engine that take time and that a crane without effects does not need.
SWITCHABLE = frozenset(
    {mujoco.mjtDisableBit.mjDSBL_ISLAND}.union(*(model.needs for model in EFFECT_MODELS.values()))
)
ENCODERS = (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL)


@functools.lru_cache(maxsize=8)
def compiled_model(
    rig: RigParameters, drive: Drive, step: float, effects: EffectSettings = EffectSettings()
) -> mujoco.MjModel:
    """Return the compiled model without its drawing; it is shared, so copy it before changing it."""
    spec = model_spec(rig, drive=drive, step=step, effects=effects)
    leave_out_idle(spec, effects)
    return spec.compile()


@functools.lru_cache(maxsize=8)
def model_description(
    rig: RigParameters, drive: Drive, step: float, effects: EffectSettings = EffectSettings()
) -> str:
    """Return the model as MJCF, drawn to the size of its rig."""
    spec = model_spec(rig, drive=drive, step=step, effects=effects)
    draw_to_scale(spec, rig)
    spec.compile()  # `to_xml` needs a compiled spec
    return str(spec.to_xml())


def model_spec(
    rig: RigParameters, *, drive: Drive, step: float, effects: EffectSettings = EffectSettings()
) -> mujoco.MjSpec:
    """Return the model of one run: parameters, drives, effects and physics step [s] are set."""
    spec = mujoco.MjSpec.from_file(str(Shipped.MODEL_FILE))
    spec.option.timestep = step
    # The joint ranges of the file are the rig's end stops. The run judges violations, in the same way for all
    # plants. So a run that records violations must not hit a wall on this plant only.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    setting = _setting(rig, drive, effects)
    for model, effect in _shown_effects(effects, setting):
        model.add(spec, effect, setting)
    if not DRIVES[drive].is_servo:
        for name, moves in zip(ACTUATORS, rig.moves, strict=True):
            if moves:
                spec.actuator(name).set_to_motor()
    write_spec(spec, model_entries(rig, drive, effects))
    return spec


def _setting(rig: RigParameters, drive: Drive, effects: EffectSettings) -> Setting:
    offset = effects.body.hook_offset if effects.body else 0.0
    drawn = DRAWN_LENGTH + offset  # the rope is measured to the load's centre of mass
    return Setting(rig, drive, drawn, drawn - offset)


def _shown_effects(effects: EffectSettings, setting: Setting) -> Iterator[tuple[EffectModel, Any]]:
    """Yield each effect that is on and that this model shows, with its EffectModel."""
    for name, model in EFFECT_MODELS.items():
        effect = getattr(effects, name)
        if effect is not None and model.is_shown(setting):
            yield model, effect


def structure_of(effects: EffectSettings) -> tuple[object, ...]:
    """Return a key of the model's structure: models with equal keys differ only in numbers."""
    heavy = effects.rope is not None and effects.rope.mass > 0.0
    return (effects.names, heavy)


def model_entries(rig: RigParameters, drive: Drive, effects: EffectSettings) -> list[Entry]:
    """Return all numbers of the model that depend on parameters; equal structures have the same entries."""
    setting = _setting(rig, drive, effects)
    entries = [Entry("option", "", "gravity", gravity_in_rig(rig.gravity, effects))]
    entries += [Entry("body", body, "mass", getattr(rig, f"{body}_mass")) for body in BODIES]
    ranges = zip(DRIVEN_JOINTS, (rig.bridge_range, rig.trolley_range, rig.rope_range), strict=True)
    entries += [Entry("joint", joint, "range", limits) for joint, limits in ranges]
    entries += [Entry("joint", "rope_length", "ref", setting.drawn)]
    if DRIVES[drive].is_prescribed:
        entries += _ideal_drive_entries(rig)
    elif DRIVES[drive].is_servo:
        entries += _velocity_drive_entries(rig, drive, effects)
    else:  # motors, whose command is a force
        entries += _rotor_entries(rig)
    entries += _fixed_axis_entries(rig)
    shown = _shown_effects(effects, setting)
    return [*entries, *(entry for model, effect in shown for entry in model.entries(effect, setting))]


def ideal_inertia(rig: RigParameters) -> float:
    """Return the rotor inertia of each ideal drive [kg]: 1e12 times the mass of the crane with its load."""
    return IDEAL_INERTIA * (rig.bridge_mass + rig.trolley_mass + rig.load_mass)


def _ideal_drive_entries(rig: RigParameters) -> list[Entry]:
    """Return the entries of ideal drives: gears include the mass on an axis, so command = acceleration."""
    inertia = ideal_inertia(rig)
    carried = (*rig.axis_masses[:2].tolist(), 0.0)
    drives = []
    for name, joint, mass in zip(ACTUATORS, DRIVEN_JOINTS, carried, strict=True):
        gear = (inertia + mass, 0.0, 0.0, 0.0, 0.0, 0.0)
        drives.append(Entry("actuator", name, "gear", gear))
        drives.append(Entry("joint", joint, "armature", inertia))
    return drives


def _fixed_axis_entries(rig: RigParameters) -> list[Entry]:
    """Return the entries of fixed axes: a rotor as that of an ideal drive, and a servo that stops it."""
    inertia, fixed = ideal_inertia(rig), []
    for name, joint, moves in zip(ACTUATORS, DRIVEN_JOINTS, rig.moves, strict=True):
        if not moves:
            # Without the servo the weight of the load would pay out 0.1 µm of rope in ten minutes.
            fixed.append(Entry("actuator", name, "gear", (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
            fixed.append(Entry("actuator", name, "gainprm", (0.0,)))
            fixed.append(Entry("actuator", name, "biasprm", (0.0, 0.0, -STOPPING_RATE * inertia)))
            fixed.append(Entry("joint", joint, "armature", inertia))
    return fixed


def _velocity_drive_entries(rig: RigParameters, drive: Drive, effects: EffectSettings) -> list[Entry]:
    drives = _rotor_entries(rig)
    for name, gain, damping, load_force in zip(ACTUATORS, *DRIVES[drive].push(rig, effects), strict=True):
        proportional = (gain,)
        bias = (0.0 - load_force, 0.0, -damping)  # a minus sign alone would write "-0" for no force
        drives.append(Entry("actuator", name, "gainprm", proportional))
        drives.append(Entry("actuator", name, "biasprm", bias))
    return drives


def _rotor_entries(rig: RigParameters) -> list[Entry]:
    """Return the entries of the rotors of motors, which move with their axes alone."""
    rotors = {"trolley_position": rig.trolley_motor_mass, "rope_length": rig.winch_mass}
    return [Entry("joint", joint, "armature", mass) for joint, mass in rotors.items()]


def state_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the index of each of JOINTS in qpos."""
    return np.array([model.joint(name).qposadr[0] for name in JOINTS], dtype=np.int64)


def rate_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the index of each of JOINTS in qvel; after a ball joint it differs from that in qpos."""
    return np.array([model.joint(name).dofadr[0] for name in JOINTS], dtype=np.int64)


def sensor_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the indices in sensordata of load position (3), load velocity (3) and rope tension (1)."""
    position, velocity, force = map(model.sensor, ("load_position", "load_velocity", "rope_force"))
    # The force of a rigid rope has three components, the last along the rope.
    return np.concatenate(
        [position.adr + np.arange(3), velocity.adr + np.arange(3), force.adr + force.dim - 1]
    )


def drive_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the index of each of ACTUATORS in ctrl."""
    return np.array([model.actuator(name).id for name in ACTUATORS], dtype=np.int64)


def leave_out_idle(spec: mujoco.MjSpec, effects: EffectSettings) -> None:
    """Delete the drawing and the encoders, and switch off features of the engine that no effect needs.

    All geoms are massless and make no contact, and a run reads qpos and qvel instead of encoders. At each
    stage of a step the engine would look for springs, dampers and constraints, which only effects bring. It
    would look for separate groups of bodies too, but the crane is one. Friction keeps the warm start: without
    it, its results would differ in the last digits and take longer.
    """
    encoders = [sensor for sensor in spec.sensors if sensor.type in ENCODERS]
    drawing = [*spec.geoms, spec.tendon("rope"), *spec.materials, *spec.textures]
    drawing += [*spec.cameras, *spec.lights]
    for element in [*drawing, *encoders]:
        spec.delete(element)
    spec.stat.meansize = 1.0  # scale of pictures, which the compiler would else derive from the bodies
    needed = [model.needs for name, model in EFFECT_MODELS.items() if getattr(effects, name) is not None]
    for flag in SWITCHABLE.difference(*needed):
        spec.option.disableflags |= int(flag)


def fastest_rate(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the largest modulus of the poles [1/s] about the state in `data`, which is not changed.

    It is computed from finite differences of the engine's accelerations. Coulomb friction is off: it would
    hold the axes and hide their poles, and the engine itself keeps it slow enough.
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

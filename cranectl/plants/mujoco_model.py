"""`models/crane.xml` for one run: parameters set by name, velocity drives as filed or ideal ones."""

import functools

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl import resources
from cranectl.effects.settings import NO_EFFECTS, EffectSettings
from cranectl.parameters import RigParameters
from cranectl.plants.interface import Drive
from cranectl.plants.mujoco_effects.body import hang_body
from cranectl.plants.mujoco_effects.frame import add_frame
from cranectl.plants.mujoco_effects.friction import add_friction
from cranectl.plants.mujoco_effects.limits import limit_forces
from cranectl.plants.mujoco_effects.rope import add_rope

JOINTS = ("bridge_position", "trolley_position", "rope_length", "alpha", "beta")
DRIVEN_JOINTS = ("bridge_position", "trolley_position", "rope_length")
DRIVES = ("bridge_drive", "trolley_drive", "winch_drive")

# An ideal drive is a motor on a joint so inert that the load cannot move it: acceleration = command to 1e-12.
IDEAL_INERTIA = 1e12  # per kg of load


@functools.lru_cache(maxsize=8)
def compiled_model(
    rig: RigParameters, drive: Drive, step: float, effects: EffectSettings = NO_EFFECTS
) -> tuple[mujoco.MjModel, str]:
    """The compiled model and its MJCF; runs on the same rig share it, and must not change it."""
    spec = model_spec(rig, drive=drive, step=step, effects=effects)
    return spec.compile(), str(spec.to_xml())


def model_spec(
    rig: RigParameters, *, drive: Drive, step: float, effects: EffectSettings = NO_EFFECTS
) -> mujoco.MjSpec:
    """The filed model with the parameters, drives, effects and physics step [s] of one run."""
    spec = mujoco.MjSpec.from_file(str(resources.MODEL_FILE))
    spec.option.timestep = step
    spec.option.gravity = [0.0, 0.0, -rig.gravity]
    # The file's joint ranges are the rig's end stops. Leaving them is judged by the run, the same on every
    # plant, so that a run that is told to record a violation does not hit a wall on one plant only.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    for body in ("bridge", "trolley", "load"):
        spec.body(body).mass = getattr(rig, f"{body}_mass")
    for joint, limits in zip(DRIVEN_JOINTS, rig.workspace, strict=True):
        spec.joint(joint).range = limits
    _add_structure(spec, rig, effects)
    if drive == "ideal":
        _set_ideal_drives(spec, IDEAL_INERTIA * rig.load_mass)
    else:
        _set_velocity_drives(spec, rig)
    if effects.friction:
        add_friction(spec, effects.friction, on_axes=drive == "velocity")
    if effects.limits and drive == "velocity":
        limit_forces(spec, DRIVES, effects.limits)
    return spec


def _add_structure(spec: mujoco.MjSpec, rig: RigParameters, effects: EffectSettings) -> None:
    """Effects that add bodies and joints. The driven joints keep their names."""
    if effects.body:
        hang_body(spec, effects.body, rig.load_mass)
    if effects.rope:
        add_rope(spec, effects.rope, effects.body.hook_offset if effects.body else 0.0)
    if effects.frame:
        add_frame(spec, effects.frame)


def _set_ideal_drives(spec: mujoco.MjSpec, inertia: float) -> None:
    for name in DRIVES:
        actuator = spec.actuator(name)
        actuator.set_to_motor()
        actuator.gear = [inertia, 0.0, 0.0, 0.0, 0.0, 0.0]
    for name in DRIVEN_JOINTS:
        spec.joint(name).armature = inertia


def _set_velocity_drives(spec: mujoco.MjSpec, rig: RigParameters) -> None:
    spec.joint("rope_length").armature = rig.winch_mass
    held_forces = (0.0, 0.0, -rig.weight)
    for name, gain, held in zip(DRIVES, rig.velocity_gains, held_forces, strict=True):
        actuator = spec.actuator(name)
        actuator.gainprm[0] = gain
        actuator.biasprm[:3] = (held, 0.0, -gain)


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

"""`models/crane.xml` for one run: parameters set by name, velocity drives as filed or ideal ones."""

import functools

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl import resources
from cranectl.parameters import RigParameters
from cranectl.plants.interface import Drive

JOINTS = ("bridge_position", "trolley_position", "rope_length", "alpha", "beta")
DRIVEN_JOINTS = ("bridge_position", "trolley_position", "rope_length")
DRIVES = ("bridge_drive", "trolley_drive", "winch_drive")

# An ideal drive is a motor on a joint so inert that the load cannot move it: acceleration = command to 1e-12.
IDEAL_INERTIA = 1e12  # per kg of load


@functools.lru_cache(maxsize=8)
def compiled_model(rig: RigParameters, drive: Drive, step: float) -> tuple[mujoco.MjModel, str]:
    """The compiled model and its MJCF; runs on the same rig share it, and must not change it."""
    spec = model_spec(rig, drive=drive, step=step)
    return spec.compile(), str(spec.to_xml())


def model_spec(rig: RigParameters, *, drive: Drive, step: float) -> mujoco.MjSpec:
    """The filed model with the parameters, drives and physics step [s] of one run."""
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
    if drive == "ideal":
        _set_ideal_drives(spec, IDEAL_INERTIA * rig.load_mass)
    else:
        _set_velocity_drives(spec, rig)
    return spec


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
    """Index of each of JOINTS in qpos and qvel (all joints have one degree of freedom)."""
    return np.array([model.joint(name).qposadr[0] for name in JOINTS], dtype=np.int64)


def sensor_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Index in sensordata of load position (3), load velocity (3), rope tension (1)."""
    position, velocity, force = (
        model.sensor(name).adr[0] for name in ("load_position", "load_velocity", "rope_force")
    )
    return np.array(
        [*range(position, position + 3), *range(velocity, velocity + 3), force + 2], dtype=np.int64
    )


def drive_addresses(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Index of each of DRIVES in ctrl."""
    return np.array([model.actuator(name).id for name in DRIVES], dtype=np.int64)

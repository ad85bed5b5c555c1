"""Read a model file of a user: which files it may read, and what it must have to be run as a crane.

Nothing of the model is changed but the integrator, which is RK4 as for the shipped model.
"""

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.mujoco.own_size import check_files, check_finite
from cranectl.scenario import ModelNames
from cranectl.support import InputError

SENSOR_NAME = "cranectl_"  # beginning of the names of sensors that are added
# Sensors that are added: kind, and of what. The first three are read as a run's load, see `Plant.advance`.
SENSORS = (
    (mujoco.mjtSensor.mjSENS_FRAMEPOS, "load"),
    (mujoco.mjtSensor.mjSENS_FRAMELINVEL, "load"),
    (mujoco.mjtSensor.mjSENS_ACTUATORFRC, "winch_drive"),
    (mujoco.mjtSensor.mjSENS_FRAMEPOS, "pivot"),
    (mujoco.mjtSensor.mjSENS_FRAMELINVEL, "pivot"),
    (mujoco.mjtSensor.mjSENS_FRAMELINACC, "pivot"),
    (mujoco.mjtSensor.mjSENS_FRAMELINACC, "load"),
)


def spec_of_file(file: Path, names: ModelNames) -> mujoco.MjSpec:
    """Return the model of a file with RK4 and SENSORS, compiled.

    Raises InputError if it reads files elsewhere, is too large, lacks a name or cannot be compiled.
    """
    try:
        check_files(file)
        spec = mujoco.MjSpec.from_file(str(file))
        _check_names(file, spec, names)
        for k, (kind, of) in enumerate(SENSORS):
            objtype = mujoco.mjtObj.mjOBJ_ACTUATOR if of == "winch_drive" else mujoco.mjtObj.mjOBJ_SITE
            spec.add_sensor(name=f"{SENSOR_NAME}{k}", type=kind, objtype=objtype, objname=getattr(names, of))
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        # As in the shipped model: the engine must not go on from its initial state after a warning.
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        check_finite(file, spec.compile())
    except (OSError, ValueError, ElementTree.ParseError) as error:
        raise InputError(
            f"{file}: {error}",
            allowed=f"a model in MJCF that MuJoCo {mujoco.__version__} compiles",
            remedy="correct the file",
        ) from None
    return spec


def embed_files(spec: mujoco.MjSpec) -> None:
    """Put the meshes of a model into its text and leave out its images, so that it needs no other file."""
    model = spec.compile()
    for k, mesh in enumerate(spec.meshes):
        points, faces = (
            table[first : first + count]
            for table, first, count in (
                (model.mesh_vert, model.mesh_vertadr[k], model.mesh_vertnum[k]),
                (model.mesh_face, model.mesh_faceadr[k], model.mesh_facenum[k]),
            )
        )
        turn = np.zeros(9)  # from the axes of the mesh's inertia, in which the compiled points are
        mujoco.mju_quat2Mat(turn, model.mesh_quat[k])
        mesh.uservert = (points @ turn.reshape(3, 3).T + model.mesh_pos[k]).ravel()
        mesh.userface, mesh.file, mesh.scale = faces.ravel(), "", np.ones(3)
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in spec.textures:
        spec.delete(texture)


def _check_names(file: Path, spec: mujoco.MjSpec, names: ModelNames) -> None:
    """Raise InputError if a site or an actuator is not in the model."""
    for key, name in names:
        kind = "actuator" if key.endswith("drive") else "site"
        known = [element.name for element in (spec.actuators if kind == "actuator" else spec.sites)]
        if name not in known:
            raise InputError(
                f"{file} has no {kind} named '{name}' for the {key.replace('_', ' ')}",
                allowed=f"{kind}s of the model: {', '.join(filter(None, known)) or 'none'}",
                remedy=f"add --set rig.plant.names.{key}=NAME, or add the {kind} to the file",
            )


def sensor_values(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the indices in sensordata of the values of SENSORS."""
    sensors = [model.sensor(f"{SENSOR_NAME}{k}") for k in range(len(SENSORS))]
    return np.concatenate([sensor.adr[0] + np.arange(sensor.dim[0]) for sensor in sensors])


def servo_kind(file: Path, model: mujoco.MjModel, names: ModelNames) -> str:
    """Return what the drives take, "velocity", "position" or "force"; raise InputError if they differ."""
    kinds = {name: _kind(model, model.actuator(name).id) for name in names.drives}
    if "other" in kinds.values() or len(set(kinds.values())) > 1:
        raise InputError(
            f"{file}: {', '.join(f'{name} is of the kind {kind}' for name, kind in kinds.items())}",
            allowed="three actuators of one kind: velocity, position or force (motor)",
            remedy="change the actuators in the file",
        )
    return next(iter(kinds.values()))


def _kind(model: mujoco.MjModel, k: int) -> str:
    stiffness, damping = -model.actuator_biasprm[k, 1:3]
    is_plain = (
        model.actuator_dyntype[k] == int(mujoco.mjtDyn.mjDYN_NONE)
        and model.actuator_gaintype[k] == int(mujoco.mjtGain.mjGAIN_FIXED)
        and model.actuator_biastype[k] <= int(mujoco.mjtBias.mjBIAS_AFFINE)
        and model.actuator_gainprm[k, 0] > 0.0
    )
    if not is_plain:
        return "other"
    return "position" if stiffness > 0.0 else "velocity" if damping > 0.0 else "force"

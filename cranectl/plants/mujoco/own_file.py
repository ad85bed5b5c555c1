"""Read a model file of a user: which files it may read, and what it must have to be run as a crane.

Nothing of the model is changed but the integrator, which is RK4 as for the shipped model.
"""

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.scenario.rig import ModelNames
from cranectl.support.errors import InputError

FOLDERS = ("meshdir", "texturedir", "assetdir")  # attributes of a compiler element
PLAIN_BIASES = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
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


def drive_names(names: ModelNames) -> tuple[str, str, str]:
    """Return the names of the actuators of bridge, trolley and winch."""
    return names.bridge_drive, names.trolley_drive, names.winch_drive


def spec_of_file(file: Path, names: ModelNames) -> mujoco.MjSpec:
    """Return the model of a file with RK4 and SENSORS, compiled.

    Raises InputError if it reads files elsewhere, lacks a name or cannot be compiled.
    """
    check_files(file)
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        _check_names(file, spec, names)
        for k, (kind, of) in enumerate(SENSORS):
            objtype = mujoco.mjtObj.mjOBJ_ACTUATOR if of == "winch_drive" else mujoco.mjtObj.mjOBJ_SITE
            spec.add_sensor(name=f"cranectl_{k}", type=kind, objtype=objtype, objname=getattr(names, of))
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        spec.compile()
    except ValueError as error:
        raise InputError(
            f"{file}: {error}",
            allowed=f"a model in MJCF that MuJoCo {mujoco.__version__} compiles",
            remedy="correct the file",
        ) from None
    return spec


def sensor_values(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the indices in sensordata of the values of SENSORS."""
    sensors = [model.sensor(f"cranectl_{k}") for k in range(len(SENSORS))]
    return np.concatenate([sensor.adr[0] + np.arange(sensor.dim[0]) for sensor in sensors])


def check_files(file: Path) -> None:
    """Raise InputError if a model names a file outside its folder, also through files that it includes."""
    folder = file.parent.resolve()
    todo, seen, elements = [file], set[Path](), list[ElementTree.Element]()
    while todo:
        path = todo.pop()
        if path in seen or not path.is_file():
            continue
        seen.add(path)
        try:
            elements += ElementTree.parse(path).iter()
        except ElementTree.ParseError as error:
            raise InputError(
                f"{path}: {error}", allowed="a model in MJCF", remedy="correct the file"
            ) from None
        todo += [
            folder / name for element in elements if element.tag == "include" for name in _files(element)
        ]
    folders = [folder / value for element in elements for key, value in element.items() if key in FOLDERS]
    for name in (name for element in elements for name in _files(element)):
        for start in (folder, *folders):
            if not (start / name).resolve().is_relative_to(folder):
                raise InputError(
                    f"{file} reads {name}",
                    allowed="files in the folder of the model, or below it",
                    remedy="copy the file there, and name it without '..'",
                )


def _files(element: ElementTree.Element) -> list[str]:
    return [value for key, value in element.items() if key.startswith("file")]


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


def servo_kind(file: Path, model: mujoco.MjModel, names: ModelNames) -> str:
    """Return what the drives take, "velocity", "position" or "force"; raise InputError if they differ."""
    kinds = {}
    for name in drive_names(names):
        k = model.actuator(name).id
        stiffness, damping = -model.actuator_biasprm[k, 1:3]
        is_plain = (
            mujoco.mjtDyn(model.actuator_dyntype[k]) == mujoco.mjtDyn.mjDYN_NONE
            and mujoco.mjtGain(model.actuator_gaintype[k]) == mujoco.mjtGain.mjGAIN_FIXED
            and mujoco.mjtBias(model.actuator_biastype[k]) in PLAIN_BIASES
            and model.actuator_gainprm[k, 0] > 0.0
        )
        servo = "position" if stiffness > 0.0 else "velocity" if damping > 0.0 else "force"
        kinds[name] = servo if is_plain else "other"
    if "other" in kinds.values() or len(set(kinds.values())) > 1:
        raise InputError(
            f"{file}: {', '.join(f'{name} is of the kind {kind}' for name, kind in kinds.items())}",
            allowed="three actuators of one kind: velocity, position or force (motor)",
            remedy="change the actuators in the file",
        )
    return next(iter(kinds.values()))

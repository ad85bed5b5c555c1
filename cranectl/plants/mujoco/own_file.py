"""Read a model file of a user: which files it may read, and what it must have to be run as a crane.

Nothing of the model is changed but the integrator, which is RK4 as for the shipped model.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import ceil
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.mujoco.own_names import complete_names, guess_rig
from cranectl.plants.mujoco.own_size import check_files, check_finite
from cranectl.scenario import ModelNames, RigParameters
from cranectl.support import Array, InputError

INTEGRATOR, FILTER, FILTEREXACT = (
    int(getattr(mujoco.mjtDyn, f"mjDYN_{name}")) for name in ("INTEGRATOR", "FILTER", "FILTEREXACT")
)
ACTIVATIONS = (int(mujoco.mjtDyn.mjDYN_NONE), INTEGRATOR, FILTER, FILTEREXACT)
MAX_ROUNDING = 1e-9  # share of a delay by which its samples may be too few
MAX_DELAY = 10.0  # [s] as of `effects.delay`
MAX_KEPT_CONTROLS = 1e5  # samples of a delay; more come from a timestep that nobody means
GROUPS = 31  # of actuators that can be switched off
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


@contextmanager
def _told(file: Path) -> Iterator[None]:
    """Turn what Python and MuJoCo raise while a file is read into an InputError."""
    try:
        yield
    except (OSError, ValueError, UserWarning, ElementTree.ParseError) as error:  # masses near 0 warn
        raise InputError(
            f"{file}: {error}",
            allowed=f"a model in MJCF that MuJoCo {mujoco.__version__} compiles",
            remedy="correct the file",
        ) from None


class OwnFile:
    """A model file of a user as it is run: with RK4 and SENSORS, and `names` of what makes it a crane.

    The `delay` of its drives [s] is taken out of the model, since it is an effect on all plants. The engine's
    own would depend on the step, and would not act in steps in stages.

    Raises InputError if it reads files elsewhere, is too large, lacks a name or cannot be compiled.
    """

    def __init__(self, file: Path, names: ModelNames) -> None:
        self.file, self.names = file, names
        with _told(file):
            check_files(file)
            self.spec = mujoco.MjSpec.from_file(str(file))
            complete_names(file, self.spec, names)
            self.delay = self._take_delay()
            self._add_sensors()
            self.spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
            # As in the shipped model: the engine must not go on from its initial state after a warning.
            self.spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
            self.model = self.spec.compile()
            check_finite(file, self.model)

    @staticmethod
    def guess_rig(file: Path, overrides: Sequence[str] = ()) -> RigParameters:
        """Return a rig with the names that the geometry of a model in MJCF suggests, to be confirmed.

        Parameters
        ----------
        file : Path
            The model. It must be in SI units.
        overrides : sequence of str
            What is known and need not be guessed, such as "rig.plant.names.load=hook".

        Returns
        -------
        RigParameters
            Names of pivot, load, drives and perhaps a keyframe. An axis without a drive is fixed.

        Raises
        ------
        InputError
            If MuJoCo does not compile it, or if nothing shows where pivot and load are.
        """
        with _told(file):
            check_files(file)
            return guess_rig(file, mujoco.MjSpec.from_file(str(file)), overrides)

    def _take_delay(self) -> float:
        """Remove the delay of the drives and return it [s]; raise InputError if it is not one for all."""
        drives = [actuator for actuator in self.spec.actuators if actuator.name in {*self.names.drives}]
        delays, step = {a.name: float(a.delay) for a in drives}, float(self.spec.option.timestep)
        if impossible := [name for name, of in delays.items() if not 0.0 <= of <= MAX_DELAY]:
            found = ", ".join(f"{name} has a delay of {delays[name]:g} s" for name in impossible)
            raise InputError(
                f"{self.file}: {found}",
                allowed=f"delays of 0 to {MAX_DELAY:g} s",
                remedy=f"correct the delay of {' and '.join(impossible)} in the file",
            )
        if len({*delays.values()}) > 1:
            raise InputError(
                f"{self.file}: {', '.join(f'{name} has a delay of {of:g} s' for name, of in delays.items())}",
                allowed="one delay for all drives",
                remedy="give all drives the same delay",
            )
        delay = max(delays.values(), default=0.0)
        for actuator in drives:
            kept = actuator.nsample * step
            if not kept >= delay * (1.0 - MAX_ROUNDING):
                count = delay / step if step > 0.0 else MAX_KEPT_CONTROLS
                raise InputError(
                    f"{self.file}: {actuator.name} is {delay:g} s late and keeps {kept:g} s of controls",
                    allowed="as many samples, a timestep apart, as the delay has",
                    remedy=f'write nsample="{ceil(count)}" for {actuator.name}'
                    if count < MAX_KEPT_CONTROLS
                    else 'write <option timestep="0.001"/> into the file',
                )
            actuator.delay, actuator.nsample = 0.0, 0
        return delay

    def _add_sensors(self) -> None:
        for k, (kind, of) in enumerate(SENSORS):
            if not getattr(self.names, of):  # a fixed rope has no winch; the place of its force stays unread
                self.spec.add_sensor(name=f"{SENSOR_NAME}{k}", type=mujoco.mjtSensor.mjSENS_CLOCK)
                continue
            objtype = mujoco.mjtObj.mjOBJ_ACTUATOR if of == "winch_drive" else mujoco.mjtObj.mjOBJ_SITE
            self.spec.add_sensor(
                name=f"{SENSOR_NAME}{k}", type=kind, objtype=objtype, objname=getattr(self.names, of)
            )

    @property
    def drives(self) -> NDArray[np.int64]:
        """The indices of the actuators of the drives, of axes that have one."""
        names = filter(None, self.names.drives)
        return np.array([self.model.actuator(name).id for name in names], dtype=np.int64)

    @property
    def sensors(self) -> NDArray[np.int64]:
        """The indices in sensordata of the values of SENSORS."""
        sensors = [self.model.sensor(f"{SENSOR_NAME}{k}") for k in range(len(SENSORS))]
        return np.concatenate([sensor.adr[0] + np.arange(sensor.dim[0]) for sensor in sensors])

    @property
    def filters(self) -> Array:
        """Time constants of the filters between the controls of the drives and their forces [s]."""
        are_filters = np.isin(self.model.actuator_dyntype[self.drives], (FILTER, FILTEREXACT))
        return np.where(are_filters, self.model.actuator_dynprm[self.drives, 0], 0.0)

    @property
    def servo(self) -> str:
        """What the drives take: "velocity", "position", "moving position" or "force".

        The set-points of a drive with a moving position are the integral of its control. Raises InputError
        if the drives differ, or if one has what no plant has.
        """
        kinds = {}
        for name, drive in zip(filter(None, self.names.drives), self.drives, strict=True):
            for cause, remedy in _peculiarities(self.model, name):
                raise InputError(
                    f"{self.file}: {name} has {cause}",
                    allowed="drives whose force is gain times control, filtered or not, plus an affine bias",
                    remedy=remedy,
                )
            kinds[name] = _kind(self.model, drive)
        if len(set(kinds.values())) > 1:
            raise InputError(
                f"{self.file}: {', '.join(f'{name} is of the kind {kind}' for name, kind in kinds.items())}",
                allowed="actuators of one kind: velocity, position or force (motor)",
                remedy="change the actuators in the file",
            )
        return next(iter(kinds.values()))

    def embed(self) -> None:
        """Put the meshes into the text and leave out the images, so that the model needs no other file."""
        model = self.spec.compile()
        for k, mesh in enumerate(self.spec.meshes):
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
        for material in self.spec.materials:
            material.textures = [""] * len(material.textures)
        for texture in self.spec.textures:
            self.spec.delete(texture)


def _peculiarities(model: mujoco.MjModel, name: str) -> Iterator[tuple[str, str]]:
    """Yield what keeps an actuator from being a drive, each with its remedy."""
    drive = model.actuator(name)
    k, group, plain = drive.id, int(drive.group[0]), f"write {name} as <velocity>, <position> or <motor>"
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_ACTUATION):
        yield "no force, since a flag switches all drives off", 'remove actuation="disable" from <flag>'
    if 0 <= group < GROUPS and model.opt.disableactuator & (1 << group):
        yield (
            f"no force, since actuatorgroupdisable switches its group {group} off",
            f"take {group} out of actuatorgroupdisable",
        )
    if model.actuator_dyntype[k] not in ACTIVATIONS or model.actuator_actearly[k]:
        yield f"an activation of the type {_short(mujoco.mjtDyn, model.actuator_dyntype[k])}", plain
    if model.actuator_gaintype[k] != int(mujoco.mjtGain.mjGAIN_FIXED):
        yield f"a gain of the type {_short(mujoco.mjtGain, model.actuator_gaintype[k])}", plain
    elif not model.actuator_gainprm[k, 0]:
        yield "a gain of 0", f"give {name} a kv, kp or gainprm other than 0"
    if not model.actuator_gear[k].any():
        yield "a gear of 0", f"give {name} a gear other than 0"
    if model.actuator_biastype[k] > int(mujoco.mjtBias.mjBIAS_AFFINE):
        yield f"a bias of the type {_short(mujoco.mjtBias, model.actuator_biastype[k])}", plain
    elif (model.actuator_biasprm[k, 1:3] > 0.0).any():
        bias = " ".join(f"{number:g}" for number in model.actuator_biasprm[k, :3])
        yield (
            f"the bias {bias}, which drives it away from rest",
            f"give {name} a kp and kv of at least 0, which are the negative numbers of its biasprm",
        )
    if model.actuator_dyntype[k] == INTEGRATOR and not model.actuator_biasprm[k, 1] < 0.0:
        yield "an integrated control without a stiffness", plain


def _short(kinds: Any, number: int) -> str:
    """Return the word of MJCF for one of the engine's constants."""
    return str(kinds(int(number)).name.partition("_")[2].lower())


def _kind(model: mujoco.MjModel, k: int) -> str:
    if model.actuator_dyntype[k] == INTEGRATOR:
        return "moving position"
    stiffness, damping = -model.actuator_biasprm[k, 1:3]
    return "position" if stiffness > 0.0 else "velocity" if damping > 0.0 else "force"

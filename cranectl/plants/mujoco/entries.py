"""Numbers of a model that follow from parameters, written alike into a spec and into what is compiled of it.

Each effect lists its numbers once, beside what it builds. So a model that takes other parameters in place
becomes, bit for bit, the one that would be compiled for them.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.rig import RigParameters

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

"""A motion of a model file, and by how much each of its differences from the rigid crane moves the load."""

from collections.abc import Callable, Iterable
from math import inf, isfinite, pi
from typing import NamedTuple

import mujoco
import numpy as np

from cranectl.plants.mujoco.own_causes import causes_of
from cranectl.plants.mujoco.own_model import OwnModel
from cranectl.plants.mujoco.own_plant import OwnPlant
from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.plant import Drive
from cranectl.scenario import EffectSettings, RigParameters
from cranectl.support import Array

TRAVEL = (0.2, 0.15, -0.1)  # of bridge, trolley and winch, in lengths of the rope
SWINGS = 3.0  # duration of the motion, in periods of the free swing; two of them move the drives
MOTION_SAMPLES, MIN_SUBSTEPS, MAX_SUBSTEPS = 300, 10, 100  # of the motion, and steps of the engine in each
MIN_ACTING = 1e-9  # [m] of a path; a cause of less does not act
Removal = Callable[[mujoco.MjModel], None]


class CauseSize(NamedTuple):
    """By how much something that the rigid crane has not moves the load."""

    cause: str
    size: float  # [m]


class TrialMotion:
    """A motion of all drives of a model, with what the model has or without some of it."""

    def __init__(self, own: OwnModel) -> None:
        self.own = own
        self.period = own.swing_period  # [s]
        self.duration = SWINGS * self.period  # [s]
        self.rig = RigParameters.from_table({**own.built_in, **own.names.axes}, str(own.file))
        self.drive: Drive = "force" if own.servo == "force" else "velocity"
        sample = self.duration / MOTION_SAMPLES
        steps = round(sample / own.model.opt.timestep)
        self.substeps = min(max(steps, MIN_SUBSTEPS), MAX_SUBSTEPS)
        self.step = sample / self.substeps  # [s]

    def run(self, removals: Iterable[Removal] = ()) -> Array:
        """Return the path of the load (MOTION_SAMPLES, 3) [m] on the model after `removals`."""
        plant = OwnPlant(
            self.rig, file=str(self.own.file), name="own", names=self.own.names, drive=self.drive,
            effects=EffectSettings(), step=self.step, substeps=self.substeps,
        )  # fmt: skip
        for remove in removals:
            remove(plant.model)
        return self._path(plant)

    def run_rigid(self) -> Array:
        """Return the path of the load (MOTION_SAMPLES, 3) [m] on the rigid crane with the model's numbers."""
        plant = MujocoPlant(
            self.rig, drive=self.drive, effects=EffectSettings(), step=self.step, substeps=self.substeps
        )
        return self._path(plant)

    def command(self, time: float) -> Array:
        """Return velocities [m/s] or forces [N] of the drives (3,): of a smooth pulse of two swings."""
        travel = np.where(self.rig.moves, TRAVEL, 0.0) * self.own.rest[4]
        phase = pi * time / self.period
        moving = time < 2.0 * self.period
        if self.drive == "velocity":
            return np.asarray(travel / self.period * np.sin(phase / 2.0) ** 2 * moving)
        # Forces that accelerate each axis in this way while the load hangs still, and hold its weight.
        pulse = travel * pi / (2.0 * self.period**2) * np.sin(phase) * moving
        weight = np.array([0.0, 0.0, self.rig.weight if self.own.has_winch else 0.0])
        return np.asarray(self.rig.driven_masses * pulse - weight)

    def _path(self, plant: MujocoPlant) -> Array:
        plant.reset(self.own.rest)
        load, path = np.zeros(7), np.zeros((MOTION_SAMPLES, 3))
        for k in range(MOTION_SAMPLES):
            plant.advance(self.command(k * self.duration / MOTION_SAMPLES), np.zeros(2), np.zeros(6), load)
            path[k] = load[:3]
        return path


def cause_sizes(own: OwnModel) -> list[CauseSize]:
    """Return by how much a model differs from the rigid crane in a motion of its drives, and why.

    The first is all together. Then follows each cause that can be left out alone, the largest first. The
    last is what remains without all these.

    Parameters
    ----------
    own : OwnModel
        The model, as of `open_model`.

    Returns
    -------
    list of CauseSize
        The largest distances of the load [m] in the motion.
    """
    motion = TrialMotion(own)
    causes = causes_of(own)
    removable = {cause.text: cause.remove for cause in causes if cause.remove}
    removable["limits of drives"] = _release_drives
    path, free, rigid = motion.run(), motion.run([_release]), motion.run_rigid()
    # What stops the crane hides other causes, so these are left out of a motion without stops.
    sizes = [CauseSize("contacts and end stops", _distance(path, free))]
    sizes += [
        CauseSize(text, _distance(free, motion.run([_release, remove]))) for text, remove in removable.items()
    ]
    rest = _distance(motion.run([_release, *removable.values()]), rigid)
    acting = sorted((size for size in sizes if size.size > MIN_ACTING), key=lambda size: -size.size)
    everything = CauseSize("all together, beside the rigid crane", _distance(path, rigid))
    left = ": ".join(filter(None, ("all else", ", ".join(c.text for c in causes if not c.remove))))
    return [everything, *acting, CauseSize(left, rest)]


def _distance(one: Array, other: Array) -> float:
    """Return the largest distance of two paths [m]; infinite if one of them has no end."""
    distance = float(np.linalg.norm(one - other, axis=1).max())
    return distance if isfinite(distance) else inf


def _release(model: mujoco.MjModel) -> None:
    """Switch contacts and end stops off."""
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT)


def _release_drives(model: mujoco.MjModel) -> None:
    """Lift the limits of drives."""
    for array in ("ctrl", "act", "force"):
        getattr(model, f"actuator_{array}limited")[:] = 0
    model.jnt_actfrclimited[:] = model.tendon_actfrclimited[:] = 0

"""Check how a model file differs from the rigid crane that the other plants share.

The check uses no equations of motion. A point on which only gravity and a rope act, and three masses on which
only their drives and the rope act, must explain the engine's accelerations in random states. So springs,
friction, an inertia of the load, a second pendulum and errors of the engine show, each with its size.
"""

import functools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from cranectl.plants.mujoco.own_model import AXES, OwnModel, free_model, hold, open_model, place, places
from cranectl.scenario.rig import ModelNames
from cranectl.signals import ROPE
from cranectl.support.arrays import Array

TRIED_STATES = 200  # random ones
# Half the ranges of random states: positions in lengths of the rope, angles [rad], and rates over those of a
# free swing.
POSITIONS, ANGLES, RATES = 0.2, 0.3, 0.3
EXPLAINED = 1e-6  # [m/s²] of accelerations that agree, a ten-millionth of gravity
PASSIVE = ("stiffness", "damping", "frictionloss")  # forces of joints and tendons


class ModelDifference(NamedTuple):
    """A difference between a model and the rigid crane."""

    what: str
    size: float  # [m/s²]; 0 for servos of another kind
    meaning: str

    @property
    def text(self) -> str:
        """What differs and by how much."""
        return f"{self.what} {self.size:.2g} m/s²" if self.size else self.what


def find_differences(file: Path, names: ModelNames) -> tuple[ModelDifference, ...]:
    """Return how the model of a file differs from the rigid crane; empty if it does not."""
    return _found(open_model(file, names))


@functools.lru_cache(maxsize=8)
def _found(own: OwnModel) -> tuple[ModelDifference, ...]:
    model = free_model(own.model)
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
    unrest = np.max([_acceleration_at_rest(own, model, state) for state in places(own.rest)], axis=0)
    excess = np.max([_unexplained(own, model, state) for state in _random_states(own)], axis=0)
    found = [
        ModelDifference(
            f"{axis} at rest", size, "it accelerates while its drives rest: does the winch hold the weight?"
        )
        for axis, size in zip(AXES, unrest, strict=True)
    ]
    causes = ", ".join(_causes(model)) or "inertia of the load, a second pendulum or further masses"
    meanings = [f"drive and rope do not explain how the {axis} accelerates: {causes}" for axis in AXES[:3]]
    meanings.append(f"the load does not swing as a point on a massless rope: {causes}")
    found += map(ModelDifference, (*AXES[:3], "swing"), excess, meanings)
    large = [finding for finding in found if not finding.size <= EXPLAINED]
    if own.servo == "position":
        large.append(ModelDifference("drives", 0.0, "they are position servos, not servos for velocity"))
    return tuple(large)


def _acceleration_at_rest(own: OwnModel, model: mujoco.MjModel, state: Array) -> Array:
    """Return the sizes of the accelerations (5,) that the sites show while all drives hold [m/s²]."""
    data = mujoco.MjData(model)
    gradient = place(model, data, own.sites, state)
    hold(own, model, data)
    mujoco.mj_forward(model, data)
    lengths = np.array([1.0, 1.0, 1.0, state[ROPE], state[ROPE]])
    return np.asarray(np.abs(gradient @ data.qacc) * lengths)


def _random_states(own: OwnModel) -> Iterator[Array]:
    """Yield random states (10,) about that of the file."""
    rng, length = np.random.default_rng(0), own.rest[ROPE]
    speed = RATES * np.sqrt(own.gravity * length)
    along, swing = (POSITIONS * length, speed), (ANGLES, speed / length)
    spread = np.array([*along, *along, *along, *swing, *swing])
    for _ in range(TRIED_STATES):
        yield own.rest + spread * rng.uniform(-1.0, 1.0, 10)


def _unexplained(own: OwnModel, model: mujoco.MjModel, state: Array) -> Array:
    """Return the accelerations (4,) of bridge, trolley, rope and swing that nothing explains [m/s²]."""
    data = mujoco.MjData(model)
    place(model, data, own.sites, state)
    hold(own, model, data)
    mujoco.mj_forward(model, data)
    # The engine adds gravity to accelerations: they are forces over mass.
    load, velocity, _, pivot, pivot_velocity, pivot_force, force = np.split(
        data.sensordata[own.sensors], (3, 6, 7, 10, 13, 16)
    )
    way, velocity = load - pivot, velocity - pivot_velocity
    length = np.linalg.norm(way)
    direction = way / length
    rate = direction @ velocity
    rope_acceleration = direction @ (force - pivot_force) + (velocity @ velocity - rate**2) / length
    tension = -own.load_mass * (direction @ force)
    masses = own.driven_masses - np.array([0.0, 0.0, own.load_mass])
    pulls = own.ratios * data.actuator_force[own.drives] + tension * np.array([*direction[:2], 1.0])
    accelerations = np.array([*pivot_force[:2], rope_acceleration])
    swing = np.linalg.norm(force - direction * (direction @ force))
    return np.array([*np.abs(accelerations * masses - pulls) / own.driven_masses, swing])


def _causes(model: mujoco.MjModel) -> Iterator[str]:
    """Yield what a model has and the rigid crane has not, by name."""
    for k in range(model.njnt):
        dof = model.jnt_dofadr[k]
        numbers = model.jnt_stiffness[k], model.dof_damping[dof], model.dof_frictionloss[dof]
        yield from _present(model.joint(k).name, numbers)
    for k in range(model.ntendon):
        name = model.tendon(k).name
        yield from _present(
            name, (model.tendon_stiffness[k], model.tendon_damping[k], model.tendon_frictionloss[k])
        )
        if model.tendon_armature[k] and _moves_at_both_ends(model, k):
            yield f"armature of {name}, which MuJoCo {mujoco.__version__} gets wrong where both ends move"


def _present(name: str, numbers: tuple[float, ...]) -> Iterator[str]:
    yield from (f"{what} of {name}" for what, number in zip(PASSIVE, numbers, strict=True) if number)


def _moves_at_both_ends(model: mujoco.MjModel, tendon: int) -> bool:
    """Return True if a spatial tendon begins and ends on bodies that move."""
    first = model.tendon_adr[tendon]
    ends = model.wrap_objid[[first, first + model.tendon_num[tendon] - 1]]
    is_spatial = mujoco.mjtWrap(model.wrap_type[first]) == mujoco.mjtWrap.mjWRAP_SITE
    return is_spatial and bool(model.body_weldid[model.site_bodyid[ends]].all())

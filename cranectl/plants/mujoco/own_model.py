"""A model file of a user as a crane: two sites show its state, and probing shows its drives and masses."""

import copy
import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.mujoco.own_file import drive_names, sensor_values, servo_kind, spec_of_file
from cranectl.plants.mujoco.sites import state_of_sites
from cranectl.scenario.rig import ModelNames
from cranectl.signals import ALPHA, ROPE
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

AXES = ("bridge", "trolley", "rope", "alpha", "beta")
MAX_NEWTON_STEPS = 50
PLACED = 1e-10  # [m, rad] from the state that the sites are to show; one more step then reaches rounding
MAX_COUPLING = 0.01  # of a drive with another axis or place, as a share of its own motion
MAX_RISE = 1e-6  # [m] of the pivot

# Places where drives and rest are examined: x, y and rope from those of the file, in lengths of that rope.
PLACES = ((0.0, 0.0, 0.0), (0.25, 0.0, 0.1), (-0.1, 0.25, -0.1), (0.2, -0.2, 0.2))
NAMES = (
    "check the names in [plant.names], and the gear of drives that move backwards; no crane may slew or luff"
)


@dataclass(frozen=True, eq=False)
class OwnModel:
    """A model file as compiled, and what probing shows of it."""

    file: Path
    model: mujoco.MjModel  # shared, so copy it before changing it
    sites: tuple[int, int]  # numbers of pivot and load
    drives: NDArray[np.int64]  # (3,) numbers of the actuators
    sensors: NDArray[np.int64]  # indices in sensordata of the values of `own_file.SENSORS`
    servo: str  # velocity, position or force: what the actuators take
    ratios: Array  # (3,) velocity of an actuator over that of its axis
    rest: Array  # (10,) state in which the load hangs, with place and rope of the file
    height: float  # of the pivot in the model's world [m]
    gravity: float  # [m/s²]
    load_mass: float  # of all that hangs [kg]
    driven_masses: Array  # (3,) as in `RigParameters.driven_masses` [kg]

    @property
    def scale(self) -> Array:
        """Control over the set-point of each axis, or over the force on it, shape (3,)."""
        gain = self.model.actuator_gainprm[self.drives, 0]
        if self.servo == "force":
            return np.asarray(1.0 / (self.ratios * gain))
        term = 1 if self.servo == "position" else 2
        return np.asarray(-self.model.actuator_biasprm[self.drives, term] * self.ratios / gain)

    @property
    def time_constants(self) -> Array:
        """Lags of velocity servos [s], shape (3,)."""
        damping = -(self.ratios**2) * self.model.actuator_biasprm[self.drives, 2]
        return np.asarray(self.driven_masses / damping)


@functools.lru_cache(maxsize=8)
def _opened(file: Path, names: ModelNames, _changed_ns: int) -> OwnModel:
    model = spec_of_file(file, names).compile()
    servo = servo_kind(file, model, names)
    drives = np.array([model.actuator(name).id for name in drive_names(names)], dtype=np.int64)
    sites = model.site(names.pivot).id, model.site(names.load).id
    data = mujoco.MjData(model)
    rest, _ = shown_state(model, data, sites)
    height = float(data.site_xpos[sites[0], 2])
    along_x, along_y, along_z = model.opt.gravity
    if not rest[ROPE] > 0.0 or along_x or along_y or not along_z < 0.0:
        raise InputError(
            f"{file}: a rope of {rest[ROPE]:g} m and gravity {model.opt.gravity.tolist()} m/s²",
            allowed="a load at some distance from its pivot, and gravity along -z",
            remedy="correct sites and gravity in the file",
        )
    rest[1::2] = rest[ALPHA:] = 0.0
    free = free_model(model)
    ratios = _ratios(free, sites, drives, names, rest)
    falling, driven = _accelerations(free, sites, drives, ratios, rest)
    gravity = -float(along_z)
    load_mass = driven[2] * falling[2] / gravity
    return OwnModel(
        file,
        model,
        sites,
        drives,
        sensor_values(model),
        servo,
        ratios,
        rest,
        height,
        gravity,
        load_mass,
        driven,
    )


def open_model(file: Path, names: ModelNames) -> OwnModel:
    """Open a model file; raise InputError if it cannot be read, lacks a name, or is not such a crane."""
    try:
        return _opened(file, names, file.stat().st_mtime_ns)
    except OSError as error:
        raise InputError(f"cannot read {file}: {error}", remedy="check the path") from None


def shown_state(model: mujoco.MjModel, data: mujoco.MjData, sites: tuple[int, int]) -> tuple[Array, Array]:
    """Return the state (10,) that the sites show, and the gradient (5, nv) of its positions."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    columns = np.zeros((2, 3, model.nv))
    for jacobian, site in zip(columns, sites, strict=True):
        mujoco.mj_jacSite(model, data, jacobian, None, site)
    pivot, load = (data.site_xpos[site] for site in sites)
    state, gradient = np.zeros(10), np.zeros((5, model.nv))
    if np.array_equal(pivot, load):
        return state, gradient
    for k in range(model.nv):
        velocities = np.ascontiguousarray(columns[:, :, k])
        state_of_sites(pivot, load, velocities[0], velocities[1], state)
        gradient[:, k] = state[1::2]
    velocities = columns @ data.qvel
    state_of_sites(pivot, load, velocities[0], velocities[1], state)
    return state, gradient


def place(model: mujoco.MjModel, data: mujoco.MjData, sites: tuple[int, int], state: Array) -> Array:
    """Set joints and their rates in `data` so that the sites show `state` (10,), by Newton's method.

    What the sites do not show stays as near to where it is as possible. Returns the gradient (5, nv) there.
    Raises InputError if the model cannot be there.
    """
    is_near = False
    for _ in range(MAX_NEWTON_STEPS):
        shown, gradient = shown_state(model, data, sites)
        inverse = np.linalg.pinv(gradient)
        if is_near:
            data.qvel[:] = inverse @ state[1::2]
            return gradient
        missing = state[0::2] - shown[0::2]
        mujoco.mj_integratePos(model, data.qpos, inverse @ missing, 1.0)
        is_near = bool(np.abs(missing).max() < PLACED)
    positions = ", ".join(f"{axis} {value:.4g}" for axis, value in zip(AXES, state[0::2], strict=True))
    raise InputError(
        f"no joints of the model bring its sites to {positions}",
        allowed="states that its joints can reach",
        remedy="begin the reference where the model can be",
    )


def hold(own: OwnModel, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Set the controls that keep the present velocity or position of the axes, or hold the weight."""
    if own.servo == "velocity":
        shown, _ = shown_state(model, data, own.sites)
        data.ctrl[own.drives] = own.scale * shown[1:6:2]
    elif own.servo == "position":
        mujoco.mj_fwdPosition(model, data)
        data.ctrl[own.drives] = data.actuator_length[own.drives] * own.scale / own.ratios
    else:
        data.ctrl[own.drives[2]] = -own.load_mass * own.gravity * own.scale[2]


def places(rest: Array) -> Iterator[Array]:
    """Yield the states (10,) of PLACES, at rest with the load below the pivot."""
    for x, y, longer in PLACES:
        yield rest + rest[ROPE] * np.array([x, 0.0, y, 0.0, longer, *(0.0,) * 5])


def free_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy without contacts, end stops and static friction, which would disturb probing."""
    model, bit = copy.copy(model), mujoco.mjtDisableBit
    for flag in (bit.mjDSBL_CONTACT, bit.mjDSBL_LIMIT, bit.mjDSBL_FRICTIONLOSS):
        model.opt.disableflags |= int(flag)
    return model


def moments(model: mujoco.MjModel, data: mujoco.MjData, drives: NDArray[np.int64]) -> Array:
    """Return the gradient (3, nv) of the actuators' lengths."""
    mujoco.mj_fwdPosition(model, data)
    dense = np.zeros((model.nu, model.nv))
    sparse = data.moment_rownnz, data.moment_rowadr, data.moment_colind
    mujoco.mju_sparse2dense(dense, data.actuator_moment, *sparse)
    return np.asarray(dense[drives])


def _ratios(
    model: mujoco.MjModel, sites: tuple[int, int], drives: NDArray[np.int64], names: ModelNames, rest: Array
) -> Array:
    """Return the ratios of the drives; raise InputError unless each moves its own axis only, everywhere."""
    data, ratios, height = mujoco.MjData(model), np.zeros(3), None
    for state in places(rest):
        gradient = place(model, data, sites, state)
        moment = moments(model, data, drives)
        motion = moment @ np.linalg.pinv(gradient)  # (3, 5) of actuators, by axis
        hidden = np.abs(moment - motion @ gradient).max(axis=1)
        if height is None:
            ratios, height = np.diag(motion).copy(), data.site_xpos[sites[0], 2]
        others = np.abs(motion - np.eye(3, 5) * ratios[:, np.newaxis]).max(axis=1)
        for name, axis, row, other, ratio in zip(
            drive_names(names), AXES, motion, np.maximum(others, hidden), ratios, strict=False
        ):
            if not other <= MAX_COUPLING * ratio:
                moved = ", ".join(f"{a} {r:.3g}" for a, r in zip(AXES, row, strict=True))
                raise InputError(
                    f"{name} does not move the {axis} alone and evenly: its motion per axis is {moved}",
                    allowed="drives that each move their own axis forward, in all places by the same amount",
                    remedy=NAMES,
                )
        if abs(data.site_xpos[sites[0], 2] - height) > MAX_RISE:
            raise InputError(
                f"the pivot rises by {data.site_xpos[sites[0], 2] - height:.3g} m on its way",
                allowed="a pivot that stays at one height",
                remedy=NAMES,
            )
    return ratios


def _accelerations(
    model: mujoco.MjModel, sites: tuple[int, int], drives: NDArray[np.int64], ratios: Array, rest: Array
) -> tuple[Array, Array]:
    """Return the accelerations (3,) of the axes without drives, and the mass (3,) that each drive moves."""
    data = mujoco.MjData(model)
    gradient = place(model, data, sites, rest)
    forces = moments(model, data, drives) / ratios[:, np.newaxis]
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    accelerations = []
    for force in (np.zeros(model.nv), *forces):
        data.qfrc_applied[:] = force
        mujoco.mj_forward(model, data)
        accelerations.append(gradient[:3] @ data.qacc)
    falling, *pushed = accelerations
    return falling, 1.0 / np.diag(pushed - falling)

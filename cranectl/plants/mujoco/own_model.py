"""A model file of a user as a crane: two sites show its state, and probing shows its drives and masses."""

import copy
import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from cranectl.plants.mujoco.own_file import OwnFile
from cranectl.plants.mujoco.own_refusals import (
    MAX_COUPLING,
    SI_UNITS,
    check_damping,
    check_fixed_rope,
    check_gravity,
    check_pose,
    check_response,
    check_swing,
    check_weight,
    drive_error,
    rise_error,
)
from cranectl.plants.mujoco.own_rest import find_rest
from cranectl.plants.mujoco.own_size import content_digest
from cranectl.plants.mujoco.sites import SiteModel
from cranectl.scenario import ModelNames, RigParameters
from cranectl.signals import ALPHA, BETA, ROPE
from cranectl.support import Array, InputError, Provenance

BRIDGE, TROLLEY, WINCH = range(3)
PARTS = ("bridge", "trolley", "winch")
MAX_RISE = 1e-6  # [m] of the pivot
MAX_OFFSET = 1e-5  # [m] of a hanging load from below its pivot
# Places where drives and rest are examined: x, y and rope from those of the file, in lengths of that rope.
PLACES = ((0.0, 0.0, 0.0), (0.25, 0.0, 0.1), (-0.1, 0.25, -0.1), (0.2, -0.2, 0.2))
UNDISTURBED = (mujoco.mjtDisableBit.mjDSBL_CONTACT, mujoco.mjtDisableBit.mjDSBL_LIMIT)
MIN_WINCH = 1e-5  # of the load, for a winch without inertia; accelerations of a lighter one lose digits
MIN_STATED = 1e-6  # [kg, s] that a rig can state, for a winch without inertia or a bridge without mass
SMALL_ANGLE = 1e-3  # [rad]
MIN_HEAVIER = 1e-9  # share by which more mass moves along y than along x; less is rounding


class OwnModel(SiteModel):
    """A model file as compiled, and what probing shows of it."""

    def __init__(self, file: Path, names: ModelNames) -> None:
        """Compile and probe a model file; raise InputError if it is not such a crane."""
        own = OwnFile(file, names)
        model = own.spec.compile()  # to be copied before it is changed
        super().__init__(model, (names.pivot, names.load), file)
        self.file, self.names = file, names
        self.digest = _digest(own)
        self.free = copy.copy(model)  # without contacts and end stops, which would disturb probing
        self.free.opt.disableflags |= sum(map(int, UNDISTURBED))
        self.axes = np.flatnonzero([bool(name) for name in names.drives])  # (n,) of 3 that have a drive
        self.drive_names = [name for name in names.drives if name]
        self.has_winch = bool(names.winch_drive)
        self.drives, self.sensors = own.drives, own.sensors  # indices of actuators, and in sensordata
        self.servo = own.servo  # what the drives take, such as "velocity"
        self.filters, self.delay = own.filters, own.delay  # (n,) before the forces, and one of all drives [s]
        self.gravity = -float(model.opt.gravity[2])  # along -z [m/s²]
        self.base: Array | None = None  # positions of joints at rest, if those of the file are not
        check_gravity(self)
        shown = check_pose(self)
        shown[1::2] = shown[ALPHA:] = 0.0
        self.rest = shown  # state (10,) of a hanging load, with place and rope of the file
        check_swing(self, self.rest)
        falling, pushed = self._probe_rest()
        self.ratios = self._find_ratios()  # (n,) velocity of an actuator over that of its axis
        self.driven_masses = self.ratios / pushed  # (n,) as in `RigParameters.driven_masses` [kg]
        if self.has_winch:
            # Without force the rope runs out with g m / (winch + m).
            self.load_mass = float(self.driven_masses[-1] * falling / self.gravity)  # of all that hangs [kg]
            check_weight(self)
        else:
            check_fixed_rope(self)
            self.load_mass = self._swinging_mass()
        if self.servo != "force":
            check_damping(self)
        self._check_masses()
        check_response(self)

    @property
    def scale(self) -> Array:
        """Control over the set-point of each axis with a drive, or over the force on it, shape (n,)."""
        gain = self.model.actuator_gainprm[self.drives, 0]
        if self.servo == "force":
            return np.asarray(1.0 / (self.ratios * gain))
        term = 2 if self.servo == "velocity" else 1
        return np.asarray(-self.model.actuator_biasprm[self.drives, term] * self.ratios / gain)

    def hold(self, data: mujoco.MjData) -> None:
        """Set controls and activations that keep velocity or position of the axes, or hold the weight."""
        weight = np.where(self.axes == WINCH, -self.load_mass * self.gravity, 0.0)  # on the axes
        if self.servo == "velocity":
            shown, _ = self.show(data)
            set_points = self.scale * shown[1:6:2][self.axes]
        elif self.servo == "force":
            set_points = weight * self.scale
        else:
            # Set-points beyond the present position, by what the servo of the winch sags under the weight.
            mujoco.mj_fwdPosition(self.model, data)
            bias, gain = self.model.actuator_biasprm[self.drives], self.model.actuator_gainprm[self.drives, 0]
            force = weight / self.ratios
            set_points = (force - bias[:, 0] - bias[:, 1] * data.actuator_length[self.drives]) / gain
        for drive, set_point in zip(self.drives, set_points, strict=True):
            if (address := self.model.actuator_actadr[drive]) >= 0:
                data.act[address] = set_point
            data.ctrl[drive] = 0.0 if self.servo == "moving position" else set_point

    def places(self) -> Iterator[Array]:
        """Yield the states (10,) of PLACES, at rest with the load below the pivot."""
        for place in PLACES:
            moved = np.zeros(10)
            moved[2 * self.axes] = np.array(place)[self.axes]
            yield self.rest + self.rest[ROPE] * moved

    @property
    def swing_period(self) -> float:
        """Period of a small free swing [s] on the rope of the file, while the drives hold the axes."""
        swing = BETA if BRIDGE in self.axes else ALPHA
        aside = self.rest.copy()
        aside[swing] = SMALL_ANGLE
        back = -self._swing_held(*self._pushed(aside))[swing // 2 - 3] / SMALL_ANGLE
        simple = self.gravity / self.rest[ROPE]  # as of a point, for a model whose load does not swing back
        return float(2.0 * np.pi / np.sqrt(back if back > 0.0 else simple))

    @property
    def built_in(self) -> dict[str, float]:
        """The numbers of the rig that the model has, by their names in a rig."""
        driven = dict(zip(self.axes.tolist(), self.driven_masses.tolist(), strict=True))
        numbers = {"load_mass": self.load_mass}
        # One body may slide along x and y, or a rail along y carry all; such a bridge has no mass of its own.
        if BRIDGE in driven:
            along_x, along_y = driven[BRIDGE], driven.get(TROLLEY, MIN_STATED)
            is_heavier = along_y > along_x * (1.0 + MIN_HEAVIER)
            trolley = max(along_x - MIN_STATED, MIN_STATED) if is_heavier else along_y
            numbers["bridge_mass"] = max(along_x - trolley, MIN_STATED)
            numbers |= {"trolley_mass": trolley, "trolley_motor_mass": along_y - trolley}
        elif TROLLEY in driven:
            numbers["trolley_mass"] = driven[TROLLEY]
        if WINCH in driven:
            lightest = max(MIN_WINCH * self.load_mass, MIN_STATED)
            numbers["winch_mass"] = max(driven[WINCH] - self.load_mass, lightest)
        if self.servo != "force":
            for axis, lag in zip(self.axes, self.lags + self.filters, strict=True):
                numbers[f"{PARTS[axis]}_time_constant"] = max(lag, MIN_STATED)
        return {name: float(number) for name, number in {"gravity": self.gravity, **numbers}.items()}

    @property
    def lags(self) -> Array:
        """How late axes follow their servos (n,) [s]; damping of the axis is part of a position servo."""
        _, stiffness, damping = -self.model.actuator_biasprm[self.drives, :3].T
        if self.servo == "velocity":
            return np.asarray(self.driven_masses / (self.ratios**2 * damping))
        data = self.new_data(self.free)
        motions = np.linalg.pinv(self.place(data, self.rest))[:, self.axes]  # (nv, n)
        for k, motion in enumerate(motions.T):
            data.qvel[:] = motion
            mujoco.mj_fwdPosition(self.free, data)
            mujoco.mj_fwdVelocity(self.free, data)
            damping[k] -= motion @ data.qfrc_damper / self.ratios[k] ** 2
        return np.asarray(damping / stiffness)

    def new_data(self, model: mujoco.MjModel | None = None) -> mujoco.MjData:
        """Return data of the model, or of a variant, in the pose of the file or of the rig's keyframe."""
        data = mujoco.MjData(model or self.model)
        self.pose(data)
        return data

    def pose(self, data: mujoco.MjData) -> None:
        """Set the joints of `data` to the pose from which states are reached: that of the file, at rest.

        A joint that it has outside its range is in the middle of that.
        """
        if self.base is not None:
            data.qpos[:] = self.base
            return
        if self.names.keyframe:
            data.qpos[:] = self.model.key_qpos[self.model.key(self.names.keyframe).id]
        for joint in self.moved_joints:
            data.qpos[self.model.jnt_qposadr[joint]] = self.model.jnt_range[joint].mean()

    @functools.cached_property
    def moved_joints(self) -> list[int]:
        """The joints that the pose of the file, or its keyframe, has outside their ranges."""
        model, names = self.model, self.names
        pose = model.key_qpos[model.key(names.keyframe).id] if names.keyframe else model.qpos0
        simple = np.isin(model.jnt_type, (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)))
        places, (low, high) = pose[model.jnt_qposadr], model.jnt_range.T
        outside = simple & (model.jnt_limited > 0) & ((places < low) | (places > high))
        return [int(joint) for joint in np.flatnonzero(outside)]

    def moments(self, data: mujoco.MjData) -> Array:
        """Return the gradient (nu, nv) of the lengths of all actuators."""
        mujoco.mj_fwdPosition(self.model, data)
        dense = np.zeros((self.model.nu, self.model.nv))
        sparse = data.moment_rownnz, data.moment_rowadr, data.moment_colind
        mujoco.mju_sparse2dense(dense, data.actuator_moment, *sparse)
        return dense

    def _find_ratios(self) -> Array:
        """Return the ratios; raise InputError unless each drive moves its own axis only, everywhere alike."""
        ratios, heights, own = np.zeros(len(self.axes)), [], np.eye(3, 5)[self.axes]
        for state in self.places():
            data = self.new_data()
            gradient, moments = self.place(data, state), self.moments(data)
            heights.append(float(data.site_xpos[self.sites[0], 2]))
            motions = moments @ np.linalg.pinv(gradient)  # (nu, 5) of actuators, by axis
            moment, motion = moments[self.drives], motions[self.drives]
            # The first place sets them. They are negative where a positive control moves backwards.
            ratios = ratios if ratios.any() else (motion * own).sum(axis=1)
            others = np.hstack([motion - own * ratios[:, np.newaxis], moment - motion @ gradient])
            for k in np.flatnonzero(~(np.abs(others).max(axis=1) < MAX_COUPLING * np.abs(ratios))):
                raise drive_error(self, int(k), data, motions)
        if (rise := max(heights) - min(heights)) > MAX_RISE:
            raise rise_error(self, rise)
        return ratios

    def _swinging_mass(self) -> float:
        """Return the mass [kg] that swings on a fixed rope as the load does when it is pushed aside."""
        data = self.new_data(self.free)
        gradient, inverse = self.place(data, self.rest), np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_forward(self.free, data)
        mujoco.mj_solveM(self.free, data, inverse, np.eye(self.model.nv))
        swing = BETA if BRIDGE in self.axes else ALPHA
        shown = [*self.axes, swing // 2]
        # The inverse of the mobility, of the axes and the angle that the sites show.
        inertia = np.linalg.inv((gradient @ inverse @ gradient.T)[np.ix_(shown, shown)])
        return float(inertia[-1, -1] / self.rest[ROPE] ** 2)

    def _check_masses(self) -> None:
        """Raise InputError for masses and gravity that no rig may have."""
        try:
            RigParameters.from_table(self.built_in, str(self.file))
        except InputError as error:
            raise InputError(error.found, allowed=error.allowed, remedy=SI_UNITS) from None

    def _probe_rest(self) -> tuple[float, Array]:
        """Return how the load falls without drives [m/s²], and how 1 N of each drive (n,) moves its axis.

        Raises InputError if the load swings aside while held below the pivot: it hangs elsewhere.
        """
        falling, by_force = self._pushed(self.rest)
        if not self._offset(falling, by_force) < MAX_OFFSET:
            self.base = find_rest(self)  # the load may only be turned in the file
            falling, by_force = self._pushed(self.rest)
        if not (offset := self._offset(falling, by_force)) < MAX_OFFSET:
            raise InputError(
                f"{self.file}: the load '{self.names.load}' hangs about {offset:.2g} m beside the pivot "
                f"'{self.names.pivot}'",
                allowed="a load that hangs at rest straight below the pivot",
                remedy="name other points, move one of the two in the file, or what pulls the load aside",
            )
        return float(falling[WINCH]), by_force[np.arange(len(self.axes)), self.axes]

    def _offset(self, falling: Array, by_force: Array) -> float:
        """Return how far from below its pivot a load hangs that swings so, with g offset / l² [m]."""
        aside = np.hypot(*self._swing_held(falling, by_force))
        return float(self.rest[ROPE] ** 2 * aside / self.gravity)

    def _swing_held(self, falling: Array, by_force: Array) -> Array:
        """Return how the load swings aside (2,) while the drives hold the axes [rad/s²]."""
        held = falling[self.axes] @ np.linalg.pinv(by_force[:, self.axes])
        return np.asarray(falling[3:] - held @ by_force[:, 3:])

    def _pushed(self, state: Array) -> tuple[Array, Array]:
        """Return accelerations (5,) without drives in a state, and what 1 N of each drive adds (n, 5)."""
        model = copy.copy(self.free)
        model.opt.wind[:] = 0.0
        for flag in (mujoco.mjtDisableBit.mjDSBL_ACTUATION, mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS):
            model.opt.disableflags |= int(flag)
        data = self.new_data(model)
        gradient = self.place(data, state)
        accelerations = []
        for force in (np.zeros(model.nv), *self.moments(data)[self.drives]):
            data.qfrc_applied[:] = force
            mujoco.mj_forward(model, data)
            accelerations.append(gradient @ data.qacc)
        falling, *pushed = accelerations
        return falling, np.asarray(pushed - falling)


def _digest(own: OwnFile) -> str:
    """Return the digest of a compiled model, which is the same wherever its files are; change its spec."""
    own.embed()
    model = own.spec.compile()
    compiled = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, compiled)
    delay = f"{own.delay!r}".encode() if own.delay else b""  # it is no longer in the model
    return hashlib.sha256(compiled.tobytes() + delay).hexdigest()[: Provenance.DIGITS]


def open_model(file: Path, names: ModelNames) -> OwnModel:
    """Return the model of a file, opened once for its content; raise InputError if it is not such a crane."""
    return _opened(file, names, content_digest(file))


@functools.lru_cache(maxsize=8)
def _opened(file: Path, names: ModelNames, _content: str) -> OwnModel:
    return OwnModel(file, names)

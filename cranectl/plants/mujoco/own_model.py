"""A model file of a user as a crane: two sites show its state, and probing shows its drives and masses."""

import copy
import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from cranectl.plants.mujoco.own_file import embed_files, sensor_values, servo_kind, spec_of_file
from cranectl.plants.mujoco.own_size import content_digest
from cranectl.plants.mujoco.sites import state_of_sites
from cranectl.scenario import ModelNames
from cranectl.signals import ALPHA, ROPE
from cranectl.support import Array, InputError, Provenance

AXES = ("bridge", "trolley", "rope", "alpha", "beta")
MAX_NEWTON_STEPS = 50
PLACED = 1e-10  # [m, rad] from the state that the sites are to show; one more step then reaches rounding
MAX_COUPLING = 0.01  # of a drive with another axis or place, as a share of its own motion
MAX_RISE = 1e-6  # [m] of the pivot
MAX_OFFSET = 1e-5  # [m] of a hanging load from below its pivot
# Places where drives and rest are examined: x, y and rope from those of the file, in lengths of that rope.
PLACES = ((0.0, 0.0, 0.0), (0.25, 0.0, 0.1), (-0.1, 0.25, -0.1), (0.2, -0.2, 0.2))
UNDISTURBED = (mujoco.mjtDisableBit.mjDSBL_CONTACT, mujoco.mjtDisableBit.mjDSBL_LIMIT)
NAMES = (
    "check the names in [plant.names], and the gear of drives that move backwards; no crane may slew or luff"
)
MIN_STATED = 1e-6  # [kg, s] that a rig can state, for a winch without inertia


class SiteModel:
    """A compiled model whose sites of pivot and load show the state of a crane."""

    def __init__(self, model: mujoco.MjModel, sites: tuple[str, str], source: object) -> None:
        """Take a model with these `sites`; errors name its `source`."""
        self.model, self.source = model, source
        self.sites = tuple(model.site(name).id for name in sites)

    def show(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """Return the state (10,) that the sites show, and the gradient (5, nv) of its positions."""
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        columns = np.zeros((2, 3, self.model.nv))
        for jacobian, site in zip(columns, self.sites, strict=True):
            mujoco.mj_jacSite(self.model, data, jacobian, None, site)
        pivot, load = (data.site_xpos[site] for site in self.sites)
        state, gradient = np.zeros(10), np.zeros((5, self.model.nv))
        if np.array_equal(pivot, load):
            return state, gradient
        for k in range(self.model.nv):
            velocities = np.ascontiguousarray(columns[:, :, k])
            state_of_sites(pivot, load, velocities[0], velocities[1], state)
            gradient[:, k] = state[1::2]
        velocities = columns @ data.qvel
        state_of_sites(pivot, load, velocities[0], velocities[1], state)
        return state, gradient

    def place(self, data: mujoco.MjData, state: Array) -> Array:
        """Set joints and rates in `data` so that the sites show `state` (10,), by Newton's method.

        What the sites do not show stays as near to where it is as possible. Returns the gradient (5, nv)
        there. Raises InputError if the model cannot be there.
        """
        is_near = False
        for _ in range(MAX_NEWTON_STEPS):
            shown, gradient = self.show(data)
            inverse = np.linalg.pinv(gradient)
            if is_near:
                data.qvel[:] = inverse @ state[1::2]
                return gradient
            missing = state[0::2] - shown[0::2]
            mujoco.mj_integratePos(self.model, data.qpos, inverse @ missing, 1.0)
            is_near = bool(np.abs(missing).max() < PLACED)
        positions = ", ".join(f"{axis} {value:.4g}" for axis, value in zip(AXES, state[0::2], strict=True))
        raise InputError(
            f"{self.source}: no joints bring its sites to {positions}",
            allowed="states that its joints can reach",
            remedy="begin the reference where the model can be",
        )


class OwnModel(SiteModel):
    """A model file as compiled, and what probing shows of it."""

    def __init__(self, file: Path, names: ModelNames) -> None:
        """Compile and probe a model file; raise InputError if it is not such a crane."""
        spec = spec_of_file(file, names)
        model = spec.compile()  # to be copied before it is changed
        super().__init__(model, (names.pivot, names.load), file)
        self.file, self.names = file, names
        self.digest = _digest(spec)
        self.free = copy.copy(model)  # without contacts and end stops, which would disturb probing
        self.free.opt.disableflags |= sum(map(int, UNDISTURBED))
        self.drives = np.array([model.actuator(name).id for name in names.drives], dtype=np.int64)
        self.sensors = sensor_values(model)  # indices in sensordata
        self.servo = servo_kind(file, model, names)  # what the drives take: velocity, position or force
        self.gravity = -float(model.opt.gravity[2])  # along -z [m/s²]
        shown, _ = self.show(mujoco.MjData(model))
        if not shown[ROPE] > 0.0 or model.opt.gravity[:2].any() or not self.gravity > 0.0:
            raise InputError(
                f"{file}: a rope of {shown[ROPE]:g} m and gravity {model.opt.gravity.tolist()} m/s²",
                allowed="a load at some distance from its pivot, and gravity along -z",
                remedy="correct sites and gravity in the file",
            )
        shown[1::2] = shown[ALPHA:] = 0.0
        self.rest = shown  # state (10,) of a hanging load, with place and rope of the file
        falling, pushed = self._probe_rest()
        self.ratios = self._find_ratios()  # (3,) velocity of an actuator over that of its axis
        self.driven_masses = self.ratios / pushed  # (3,) as in `RigParameters.driven_masses` [kg]
        # Without force the rope runs out with g m / (winch + m).
        self.load_mass = float(self.driven_masses[2] * falling / self.gravity)  # of all that hangs [kg]

    @property
    def scale(self) -> Array:
        """Control over the set-point of each axis, or over the force on it, shape (3,)."""
        gain = self.model.actuator_gainprm[self.drives, 0]
        if self.servo == "force":
            return np.asarray(1.0 / (self.ratios * gain))
        term = 1 if self.servo == "position" else 2
        return np.asarray(-self.model.actuator_biasprm[self.drives, term] * self.ratios / gain)

    def hold(self, data: mujoco.MjData) -> None:
        """Set the controls that keep the present velocity or position of the axes, or hold the weight."""
        if self.servo == "velocity":
            shown, _ = self.show(data)
            data.ctrl[self.drives] = self.scale * shown[1:6:2]
        elif self.servo == "position":
            mujoco.mj_fwdPosition(self.model, data)
            data.ctrl[self.drives] = data.actuator_length[self.drives] * self.scale / self.ratios
        else:
            data.ctrl[self.drives[2]] = -self.load_mass * self.gravity * self.scale[2]

    def places(self) -> Iterator[Array]:
        """Yield the states (10,) of PLACES, at rest with the load below the pivot."""
        for x, y, longer in PLACES:
            yield self.rest + self.rest[ROPE] * np.array([x, 0.0, y, 0.0, longer, *(0.0,) * 5])

    @property
    def built_in(self) -> dict[str, float]:
        """The numbers of the rig that the model has, by their names in a rig."""
        both, trolley, winch = self.driven_masses
        masses = (both - trolley, trolley, max(winch - self.load_mass, MIN_STATED), self.load_mass)
        parts = ("bridge", "trolley", "winch", "load")
        numbers = {f"{part}_mass": mass for part, mass in zip(parts, masses, strict=True)}
        if self.servo != "force":
            _, stiffness, damping = -self.model.actuator_biasprm[self.drives, :3].T
            is_velocity = self.servo == "velocity"
            lags = self.driven_masses / (self.ratios**2 * damping) if is_velocity else damping / stiffness
            for part, lag in zip(parts, lags, strict=False):
                numbers[f"{part}_time_constant"] = max(lag, MIN_STATED)
        return {name: float(number) for name, number in {"gravity": self.gravity, **numbers}.items()}

    def _moments(self, data: mujoco.MjData) -> Array:
        """Return the gradient (3, nv) of the actuators' lengths."""
        mujoco.mj_fwdPosition(self.model, data)
        dense = np.zeros((self.model.nu, self.model.nv))
        sparse = data.moment_rownnz, data.moment_rowadr, data.moment_colind
        mujoco.mju_sparse2dense(dense, data.actuator_moment, *sparse)
        return np.asarray(dense[self.drives])

    def _find_ratios(self) -> Array:
        """Return the ratios; raise InputError unless each drive moves its own axis only, everywhere alike."""
        ratios, heights = np.zeros(3), []
        for state in self.places():
            data = mujoco.MjData(self.model)
            gradient, moment = self.place(data, state), self._moments(data)
            heights.append(float(data.site_xpos[self.sites[0], 2]))
            motion = moment @ np.linalg.pinv(gradient)  # (3, 5) of actuators, by axis
            ratios = ratios if ratios.any() else np.diag(motion).copy()  # the first place sets them
            others = np.hstack([motion - np.eye(3, 5) * ratios[:, np.newaxis], moment - motion @ gradient])
            for k in np.flatnonzero(~(np.abs(others).max(axis=1) < MAX_COUPLING * ratios)):
                moved = ", ".join(f"{axis} {part:.3g}" for axis, part in zip(AXES, motion[k], strict=True))
                raise InputError(
                    f"{self.names.drives[k]} does not move the {AXES[k]} alone and evenly: "
                    f"its motion per axis is {moved}",
                    allowed="drives that each move their own axis forward, in all places by the same amount",
                    remedy=(
                        f"name the end of the rope as load, with --set rig.plant.names.load={hook}; "
                        f"'{self.names.load}' still swings below it"
                    )
                    if (hook := self._find_hook(int(k)))
                    else NAMES,
                )
        if (rise := max(heights) - min(heights)) > MAX_RISE:
            raise InputError(
                f"the pivot rises by {rise:.3g} m on its way",
                allowed="a pivot that stays at one height",
                remedy=NAMES,
            )
        return ratios

    def _find_hook(self, k: int) -> str:
        """Return the site where the tendon of drive `k` ends; empty without one, or if the load is there."""
        model, drive = self.model, self.drives[k]
        if model.actuator_trntype[drive] != int(mujoco.mjtTrn.mjTRN_TENDON):
            return ""
        rope = model.actuator_trnid[drive, 0]
        parts = slice(model.tendon_adr[rope], model.tendon_adr[rope] + model.tendon_num[rope])
        sites = model.wrap_objid[parts][model.wrap_type[parts] == int(mujoco.mjtWrap.mjWRAP_SITE)]
        trolley = model.site_bodyid[self.sites[0]]
        ends = [model.site(site).name for site in sites if model.site_bodyid[site] != trolley]
        return "" if self.names.load in ends else (ends or [""])[-1]

    def _probe_rest(self) -> tuple[float, Array]:
        """Return how the load falls without drives [m/s²], and how 1 N of each drive (3,) moves its axis.

        Raises InputError if the load swings aside while held below the pivot: it hangs elsewhere.
        """
        model = copy.copy(self.free)
        model.opt.wind[:] = 0.0
        for flag in (mujoco.mjtDisableBit.mjDSBL_ACTUATION, mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS):
            model.opt.disableflags |= int(flag)
        data = mujoco.MjData(model)
        gradient = self.place(data, self.rest)
        accelerations = []
        for force in (np.zeros(model.nv), *self._moments(data)):
            data.qfrc_applied[:] = force
            mujoco.mj_forward(model, data)
            accelerations.append(gradient @ data.qacc)
        falling, *pushed = accelerations
        by_force = pushed - falling  # (3, 5)
        # Less what the drives do to the angles while they hold the axes: only a load aside still swings.
        aside = falling[3:] - falling[:3] @ np.linalg.pinv(by_force[:, :3]) @ by_force[:, 3:]
        # A load at this offset from below its pivot swings with g offset / l².
        offset = self.rest[ROPE] ** 2 * np.hypot(*aside) / self.gravity
        if not offset < MAX_OFFSET:
            raise InputError(
                f"{self.file}: the load '{self.names.load}' hangs about {offset:.2g} m beside the pivot "
                f"'{self.names.pivot}'",
                allowed="a load that hangs at rest straight below the pivot",
                remedy="move one of the two sites in the file, or what pulls the load aside",
            )
        return float(falling[2]), np.diag(by_force)


def _digest(spec: mujoco.MjSpec) -> str:
    """Return the digest of a compiled model, which is the same wherever its files are; change `spec`."""
    embed_files(spec)
    model = spec.compile()
    compiled = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, compiled)
    return hashlib.sha256(compiled.tobytes()).hexdigest()[: Provenance.DIGITS]


def open_model(file: Path, names: ModelNames) -> OwnModel:
    """Return the model of a file, opened once for its content; raise InputError if it is not such a crane."""
    return _opened(file, names, content_digest(file))


@functools.lru_cache(maxsize=8)
def _opened(file: Path, names: ModelNames, _content: str) -> OwnModel:
    return OwnModel(file, names)

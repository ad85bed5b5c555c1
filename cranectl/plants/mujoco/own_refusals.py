"""Say why a user's model is no crane that can be run, with the element of the file that is to be changed."""

import shlex
from collections.abc import Iterator
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from cranectl.plants.mujoco.sites import AXES
from cranectl.signals import ALPHA, BETA, ROPE
from cranectl.support import Array, InputError

if TYPE_CHECKING:
    from cranectl.plants.mujoco.own_model import OwnModel

KEYS = ("bridge_drive", "trolley_drive", "winch_drive")  # of the names in a rig
MAX_COUPLING = 0.01  # of a drive with another axis or place, as a share of its own motion
MAX_SLOPE = 1e-6  # of a rail against x or y
MAX_ROPE = 500.0  # [m] in the pose of the file; longer ones are in mm
TRIED_CONTROL = 1e-4  # of the control at rest, or of its unit
MIN_LOAD = 1e-3  # [kg] that a rig can state
MIN_HANGING = 1e-6  # of the load in what the winch moves
SI_UNITS = "write the model in SI units: m, kg, s and N"


def check_gravity(own: "OwnModel") -> None:
    """Raise InputError unless gravity acts along -z."""
    gravity = own.model.opt.gravity
    is_off = bool(own.model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY))
    if is_off or gravity[:2].any() or not gravity[2] < 0.0:
        raise InputError(
            f"{own.file} has gravity {'switched off by a flag' if is_off else f'{gravity.tolist()} m/s²'}",
            allowed="gravity along -z",
            remedy='remove gravity="disable" from <flag>'
            if is_off
            else 'write <option gravity="0 0 -9.81"/> into the file, and let its z axis point upwards',
        )


def check_pose(own: "OwnModel") -> Array:
    """Return the state (10,) in the pose of the file; raise InputError unless the load hangs in it."""
    data, names = own.new_data(), own.names
    shown, _ = own.show(data)
    height = float(np.subtract(*(data.site_xpos[site, 2] for site in own.sites)))
    if shown[ROPE] > MAX_ROPE:
        raise InputError(
            f"{own.file}: a rope of {shown[ROPE]:g} m", allowed=f"at most {MAX_ROPE:g} m", remedy=SI_UNITS
        )
    if not height > 0.0:
        poses = [f"--set rig.plant.names.keyframe={shlex.quote(name)}" for name in _hanging_poses(own)]
        pose = f"keyframe '{names.keyframe}'" if names.keyframe else "pose of the file"
        above = f", and the load '{names.load}' {-height:.3g} m above the pivot '{names.pivot}'"
        raise InputError(
            f"{own.file}: in the {pose}, a rope of {shown[ROPE]:g} m{above if shown[ROPE] else ''}",
            allowed="a load that hangs below its pivot",
            remedy=f"begin at a keyframe: add {' or '.join(poses)}"
            if poses
            else "let the load hang in the file, or exchange the names of pivot and load",
        )
    return shown


def check_swing(own: "OwnModel", rest: Array) -> None:
    """Raise InputError if the load cannot swing along an axis that its pivot moves along."""
    gradient = own.place(own.new_data(), rest)
    reached = np.diag(gradient @ np.linalg.pinv(gradient))  # 1 for what moves by itself
    for axis, angle, hinge in ((0, BETA, "y"), (1, ALPHA, "x")):
        if axis in own.axes and reached[angle // 2] < 1.0 - MAX_COUPLING:
            raise InputError(
                f"{own.file}: no joint lets the load '{own.names.load}' swing along {'xy'[axis]}",
                allowed="a load that swings along each axis that its pivot moves along",
                remedy=f"add a hinge about {hinge} at the pivot to the file, between pivot and load",
            )


def drive_error(own: "OwnModel", k: int, data: mujoco.MjData, motions: Array) -> InputError:
    """Return the error for drive `k`, which moves more or less than its axis.

    `motions` (nu, 5) are those of all actuators by axis in the pose of `data`.
    """
    drive, name, axis = int(own.drives[k]), own.drive_names[k], AXES[own.axes[k]]
    moved = ", ".join(f"{one} {part:.3g}" for one, part in zip(AXES, motions[drive], strict=True))
    guides = [*_misguided(own, data)]
    if hook := _find_hook(own, drive):
        remedy = (
            f"name the end of the rope as load, with --set rig.plant.names.load={hook}; "
            f"'{own.names.load}' still swings below it"
        )
    elif settings := _other_names(own, motions):
        remedy = f"add {' '.join(settings)}"
    elif guides:
        remedy = _guide_remedy(guides)
    else:
        remedy = f"let {name} act on a joint or tendon of the file that moves the {axis} alone"
    return InputError(
        f"{own.file}: {name} does not move the {axis} alone and evenly: its motion per axis is {moved}; it "
        f"acts on {_element(own.model, drive)}"
        + "".join(f", and joint '{joint}' {what}" for joint, what in guides),
        allowed="drives that each move their own axis, in all places by the same amount; no crane may slew "
        "or luff",
        remedy=remedy,
    )


def rise_error(own: "OwnModel", rise: float) -> InputError:
    """Return the error for a pivot whose height changes by `rise` [m]."""
    data = own.new_data()
    mujoco.mj_kinematics(own.model, data)
    guides = [*_misguided(own, data)]
    ways = " and ".join(f"joint '{joint}' {what}" for joint, what in guides)
    return InputError(
        f"{own.file}: the pivot rises by {rise:.3g} m on its way" + (f": {ways}" if ways else ""),
        allowed="a pivot that stays at one height",
        remedy=_guide_remedy(guides),
    )


def _guide_remedy(guides: list[tuple[str, str]]) -> str:
    joints = " and ".join(f"joint '{joint}'" for joint, _ in guides) or "what carries the pivot"
    return f"change {joints} in the file: the pivot may only slide along x and y"


def _misguided(own: "OwnModel", data: mujoco.MjData) -> Iterator[tuple[str, str]]:
    """Yield the joints that do more to the pivot than slide it along x or y, and what each does."""
    model, body = own.model, int(own.model.site_bodyid[own.sites[0]])
    while body:
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            along, name = data.xaxis[joint] + 0.0, str(model.joint(joint).name or joint)
            if model.jnt_type[joint] != int(mujoco.mjtJoint.mjJNT_SLIDE):
                yield name, "turns the pivot"
            elif np.sort(np.abs(along))[1] > MAX_SLOPE or abs(along[2]) > MAX_SLOPE:
                yield name, f"slides the pivot along [{', '.join(f'{part:.3g}' for part in along)}]"
        body = int(model.body_parentid[body])


def _other_names(own: "OwnModel", motions: Array) -> list[str]:
    """Return the settings that name a drive for each axis; none if the model does not have them all."""
    fitting = dict[int, str]()
    for k, motion in enumerate(np.abs(motions)):
        axis, name = int(motion.argmax()), str(own.model.actuator(k).name)
        if name and motion[axis] > 0.0 and np.delete(motion, axis).max() < MAX_COUPLING * motion[axis]:
            fitting.setdefault(axis, name)
    if not {*own.axes} <= fitting.keys():
        return []
    pairs = [(KEYS[axis], fitting[int(axis)]) for axis in own.axes]
    wrong = [(key, name) for key, name in pairs if name != getattr(own.names, key)]
    return [f"--set {shlex.quote(f'rig.plant.names.{key}={name}')}" for key, name in wrong]


def _element(model: mujoco.MjModel, drive: int) -> str:
    """Return in words what an actuator acts on."""
    word = mujoco.mjtTrn(int(model.actuator_trntype[drive])).name.removeprefix("mjTRN_").lower()
    kind, of = word.removesuffix("inparent"), int(model.actuator_trnid[drive, 0])
    named = kind in ("joint", "tendon", "site", "body")
    return f"{kind} '{getattr(model, kind)(of).name or of}'" if named else kind


def _hanging_poses(own: "OwnModel") -> list[str]:
    """Return the names of the keyframes in which the load is below its pivot."""
    data, names = mujoco.MjData(own.model), []
    for k in range(own.model.nkey):
        data.qpos[:] = own.model.key_qpos[k]
        mujoco.mj_kinematics(own.model, data)
        pivot, load = (data.site_xpos[site, 2] for site in own.sites)
        if own.model.key(k).name and pivot > load:
            names.append(own.model.key(k).name)
    return names


def _find_hook(own: "OwnModel", drive: int) -> str:
    """Return the site where the tendon of a drive ends; empty without one, or if the load is there."""
    model = own.model
    if model.actuator_trntype[drive] != int(mujoco.mjtTrn.mjTRN_TENDON):
        return ""
    rope = model.actuator_trnid[drive, 0]
    parts = slice(model.tendon_adr[rope], model.tendon_adr[rope] + model.tendon_num[rope])
    sites = model.wrap_objid[parts][model.wrap_type[parts] == int(mujoco.mjtWrap.mjWRAP_SITE)]
    trolley = model.site_bodyid[own.sites[0]]
    ends = [model.site(site).name for site in sites if model.site_bodyid[site] != trolley]
    return "" if own.names.load in ends else (ends or [""])[-1]


def check_damping(own: "OwnModel") -> None:
    """Raise InputError for a position servo that nothing damps."""
    for k in np.flatnonzero(~(own.lags > 0.0)):
        raise InputError(
            f"{own.file}: the position servo {own.drive_names[k]} has no kv, and nothing else damps its axis",
            allowed="drives that come to rest",
            remedy=f"write kv=NUMBER into {own.drive_names[k]}, or damping=NUMBER into its joint",
        )


def check_fixed_rope(own: "OwnModel") -> None:
    """Raise InputError for a slide that lengthens a rope without a winch."""
    model, data = own.model, own.new_data()
    gradient = own.place(data, own.rest)
    for joint in np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_SLIDE)):
        if abs(gradient[ROPE // 2, model.jnt_dofadr[joint]]) > MAX_COUPLING:
            name = model.joint(joint).name or joint
            raise InputError(
                f"{own.file}: the joint {name} lengthens the rope, and no actuator moves it",
                allowed="a winch, or a rope of fixed length",
                remedy=f"add an actuator for {name} and name it as winch_drive, or remove the joint",
            )


def check_response(own: "OwnModel") -> None:
    """Raise InputError for a drive whose force does not change at once by its gain times its control."""
    data = own.new_data(own.free)
    own.place(data, own.rest)
    own.hold(data)
    moments = own.moments(data)
    mujoco.mj_forward(own.free, data)
    held = data.qfrc_actuator.copy()
    for k, name in zip(own.drives, own.drive_names, strict=True):
        gain, moment = own.model.actuator_gainprm[k, 0], moments[k]
        address = own.model.actuator_actadr[k]
        values, index = (data.ctrl, k) if address < 0 else (data.act, address)
        value, shares = values[index], []
        small = TRIED_CONTROL * max(1.0, abs(value))
        for change in (small, -small):  # one of the two may be beyond a limit of the drive
            values[index] = value + change
            mujoco.mj_forward(own.free, data)
            force = (data.qfrc_actuator - held) @ moment / (moment @ moment)
            shares.append(float(force) / (gain * change))
        values[index] = value
        if not min(abs(share - 1.0) for share in shares) < MAX_COUPLING:
            bias = own.model.actuator_biasprm[k]
            needed = gain * value + bias[0] + bias[1] * data.actuator_length[k] + 0.0
            raise InputError(
                f"{own.file}: at rest, a small change of the control of {name} has "
                f"{max(shares, key=abs):.3g} of the effect that its gain states",
                allowed="drives that follow their controls, or filters of these, within their limits",
                remedy=f"let ctrlrange of {name} include {value:.4g}, and its forcerange, or the "
                f"actuatorfrcrange of its joint, {needed:.4g} N: they hold the crane at rest",
            )


def check_weight(own: "OwnModel") -> None:
    """Raise InputError if no weight pulls at the winch."""
    if not own.load_mass > max(MIN_HANGING * own.driven_masses[-1], MIN_LOAD):
        lifted = [own.model.body(k).name or str(k) for k in np.flatnonzero(own.model.body_gravcomp)]
        raise InputError(
            f"{own.file}: the rope carries {max(own.load_mass, 0.0):.2g} kg to the load "
            f"'{own.names.load}'" + (f": gravcomp lifts {', '.join(lifted)}" if lifted else ""),
            allowed=f"a load of {MIN_LOAD:g} kg or more, whose weight the rope carries",
            remedy="remove gravcomp" if lifted else "give the body of the load a mass",
        )

"""Find how far the axes of a user's model travel and what limits its drives, as `info` prints them."""

from math import inf

import mujoco
import numpy as np

from cranectl.plants.mujoco.own_file import INTEGRATOR
from cranectl.plants.mujoco.own_model import WINCH, OwnModel
from cranectl.plants.mujoco.own_refusals import MAX_COUPLING
from cranectl.plants.mujoco.sites import AXES
from cranectl.signals import BRIDGE, ROPE, TROLLEY
from cranectl.support import Array, Mask

MIN_ROPE = 1e-3  # [m] of rope
ASSUMED = {BRIDGE: 3.0, TROLLEY: 3.0, ROPE: 0.5}  # travel to each side, in lengths of the rope in the file
BESIDE = 0.5  # the same for a fixed axis: room around the rail, where nothing moves
# What limits the force of all its actuators, by what they act on.
LIMITING = {
    int(mujoco.mjtTrn.mjTRN_JOINT): "jnt",
    int(mujoco.mjtTrn.mjTRN_JOINTINPARENT): "jnt",
    int(mujoco.mjtTrn.mjTRN_TENDON): "tendon",
}
Ranges = dict[str, tuple[float, float]]  # [m], by their names in a rig


def axis_ranges(own: OwnModel) -> tuple[Ranges, Ranges]:
    """Return the travel of axes that the model limits, and that of others, as assumed.

    Joints that each move one axis and no other limit it, the winch's tendon, and the set-points of position
    servos. Other ranges are about the pose of the file.
    """
    found, length = _limited(own), float(own.rest[ROPE])
    for name, ends in _set_point_ranges(own).items():
        low, high = _within(found.get(name, (-inf, inf)), ends)
        found[name] = (float(low), float(high))
    assumed = {}
    for state, share in ASSUMED.items():
        axis, place = state // 2, float(own.rest[state])
        share = share if axis in own.axes else BESIDE
        if (name := f"{AXES[axis]}_range") not in found:
            assumed[name] = (place - share * length, place + share * length)
    return found, assumed


def _limited(own: OwnModel) -> Ranges:
    model, data = own.model, own.new_data()
    shown, gradient = own.show(data)
    found = {}
    for joint in np.flatnonzero(model.jnt_limited):
        is_slide = model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_SLIDE)
        moved = gradient[:3, model.jnt_dofadr[joint]].copy()
        if np.abs(moved[:2]).max() > MAX_COUPLING:
            moved[2] = 0.0  # a free load stays behind while its pivot moves
        axis = int(np.abs(moved).argmax())
        if is_slide and abs(np.abs(moved[axis]) - 1.0) + np.abs(moved).sum() - 1.0 < MAX_COUPLING:
            way = model.jnt_range[joint] - data.qpos[model.jnt_qposadr[joint]]
            ends = sorted(float(end) for end in shown[2 * axis] + moved[axis] * way)
            found[f"{AXES[axis]}_range"] = (ends[0], ends[1])
    winch = own.drives[-1]
    is_tendon = model.actuator_trntype[winch] == int(mujoco.mjtTrn.mjTRN_TENDON)
    if own.has_winch and is_tendon and model.tendon_limited[tendon := model.actuator_trnid[winch, 0]]:
        mujoco.mj_tendon(model, data)
        falls = own.ratios[-1] / model.actuator_gear[winch, 0]
        ends = sorted(shown[ROPE] + (model.tendon_range[tendon] - data.ten_length[tendon]) / falls)
        found["rope_range"] = (max(float(ends[0]), MIN_ROPE), float(ends[1]))
    return found


def _set_point_ranges(own: OwnModel) -> Ranges:
    """Return between which places position servos hold their axes."""
    model, data, found = own.model, own.new_data(), Ranges()
    shown, _ = own.show(data)
    own.hold(data)
    for drive, axis, scale in zip(own.drives, own.axes.tolist(), own.scale, strict=True):
        if own.servo == "position" and model.actuator_ctrllimited[drive]:
            way = model.actuator_ctrlrange[drive] - data.ctrl[drive]
        elif model.actuator_dyntype[drive] == INTEGRATOR and model.actuator_actlimited[drive]:
            way = model.actuator_actrange[drive] - data.act[model.actuator_actadr[drive]]
        else:
            continue
        low, high = np.sort(shown[2 * axis] + way / scale).tolist()
        found[f"{AXES[axis]}_range"] = (max(low, MIN_ROPE) if axis == WINCH else low, high)
    return found


def drive_limits(own: OwnModel) -> dict[str, dict[int, float]]:
    """Return what the model lets its drives do: velocities [m/s] and forces [N] of axes, by their numbers.

    Of two ends the nearer one counts; of the winch's force that with which it lifts. An axis is left out
    where nothing limits it.
    """
    kind = "force" if own.servo == "force" else "velocity"
    limits: dict[str, dict[int, float]] = {"velocity": {}, "force": {}}
    for k, axis in enumerate(own.axes.tolist()):
        ends = {"force": _force_ends(own, k)}
        if own.servo != "position":  # its controls are positions
            of_control = np.sort(_control_ends(own, k) / own.scale[k])
            ends[kind] = _within(of_control, ends.get(kind, (-inf, inf)))
        for name, (low, high) in ends.items():
            limit = -low if (name, axis) == ("force", WINCH) else min(-low, high)
            if limit < inf:
                limits[name][axis] = max(float(limit), 0.0)
    return limits


def are_limited(own: OwnModel) -> Mask:
    """Return which drives (n,) have a limit of control, activation or force."""
    ends = [[*_control_ends(own, k), *_force_ends(own, k)] for k in range(len(own.drives))]
    return np.asarray(np.isfinite(ends).any(axis=1))


def _control_ends(own: OwnModel, k: int) -> Array:
    """Return between which controls (2,) drive `k` follows them."""
    model, drive = own.model, own.drives[k]
    ends = model.actuator_ctrlrange[drive] if model.actuator_ctrllimited[drive] else (-inf, inf)
    if model.actuator_actlimited[drive] and model.actuator_dyntype[drive] != INTEGRATOR:
        return _within(ends, model.actuator_actrange[drive])
    return np.asarray(ends, dtype=float)


def _force_ends(own: OwnModel, k: int) -> Array:
    """Return between which forces (2,) drive `k` acts on its axis [N]."""
    model, drive = own.model, own.drives[k]
    ends = model.actuator_forcerange[drive] if model.actuator_forcelimited[drive] else (-inf, inf)
    element, gear = model.actuator_trnid[drive, 0], model.actuator_gear[drive, 0]
    word = LIMITING.get(int(model.actuator_trntype[drive]))
    if word and getattr(model, f"{word}_actfrclimited")[element]:
        ends = _within(ends, np.sort(getattr(model, f"{word}_actfrcrange")[element] / gear))
    return np.sort(np.multiply(ends, own.ratios[k]))


def _within(one: Array | tuple[float, float], other: Array | tuple[float, float]) -> Array:
    """Return the overlap (2,) of two ranges."""
    return np.array([max(one[0], other[0]), min(one[1], other[1])])

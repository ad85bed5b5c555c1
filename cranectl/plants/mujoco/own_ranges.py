"""Find how far the axes of a user's model travel, for the rig that `info` prints."""

import mujoco
import numpy as np

from cranectl.plants.mujoco.own_model import OwnModel
from cranectl.plants.mujoco.own_refusals import MAX_COUPLING
from cranectl.plants.mujoco.sites import AXES
from cranectl.signals import BRIDGE, ROPE, TROLLEY

MIN_ROPE = 1e-3  # [m] of rope
ASSUMED = {BRIDGE: 3.0, TROLLEY: 3.0, ROPE: 0.5}  # travel to each side, in lengths of the rope in the file
BESIDE = 0.5  # the same for a fixed axis: room around the rail, where nothing moves
Ranges = dict[str, tuple[float, float]]  # [m], by their names in a rig


def axis_ranges(own: OwnModel) -> tuple[Ranges, Ranges]:
    """Return the travel of axes that joints and the winch's tendon limit, and that of others, as assumed.

    Only joints that each move one axis and no other have such a range. Others are about the pose of the file.
    """
    found, length = _limited(own), float(own.rest[ROPE])
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

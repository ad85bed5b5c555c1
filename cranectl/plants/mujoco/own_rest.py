"""Find where a user's model rests whose file has turned the load."""

import copy
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from cranectl.support import Array

if TYPE_CHECKING:
    from cranectl.plants.mujoco.own_model import OwnModel

STEPS, RESTING, SLIGHT = 60, 1e-9, 1e-6  # of Newton's method; accelerations [m/s²]; steps of slopes
MAX_MOVE = 0.1  # [m, rad] in a step
UNMOVED = 1e-7  # [m, rad] of the way to rest, below which the pose was at rest
INDIFFERENT = 1e-6  # share of the largest slope, of what may be anywhere, such as a turn about the rope


def find_rest(own: "OwnModel") -> Array | None:
    """Return positions of joints (nq,) in which all parts rest, also those that the sites do not show.

    They are found by Newton's method; axes stay where they are. None if the pose is at rest, or if no rest
    is found nearby.
    """
    model, n = copy.copy(own.free), len(own.axes)
    for flag in (mujoco.mjtDisableBit.mjDSBL_ACTUATION, mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS):
        model.opt.disableflags |= int(flag)
    model.opt.wind[:] = 0.0
    data, trial = own.new_data(model), mujoco.MjData(model)
    own.place(data, own.rest)
    position, forces = data.qpos.copy(), np.zeros(n)

    def missing(moved: Array, added: Array) -> Array:
        """Return accelerations, and distances of the axes from where they should be."""
        trial.qpos[:], trial.qvel[:] = position, 0.0
        mujoco.mj_integratePos(model, trial.qpos, moved, 1.0)
        trial.qfrc_applied[:] = (forces + added) @ own.moments(trial)[own.drives]
        mujoco.mj_forward(model, trial)
        shown, _ = own.show(trial)
        return np.append(trial.qacc, (shown - own.rest)[:6:2][own.axes])

    nothing = np.zeros(model.nv), np.zeros(n)
    begin = position.copy()
    for _ in range(STEPS):
        value = missing(*nothing)
        if np.abs(value).max() < RESTING:
            return position if np.abs(position - begin).max() > UNMOVED else None
        slopes = [
            (missing(*np.split(SLIGHT * unit, [model.nv])) - value) / SLIGHT for unit in np.eye(model.nv + n)
        ]
        if not (np.isfinite(value).all() and np.isfinite(slopes).all()):
            return None
        step = np.linalg.lstsq(np.array(slopes).T, -value, rcond=INDIFFERENT)[0]
        # Short steps find the rest nearby, which is stable: a load can also rest upside down.
        step *= MAX_MOVE / max(MAX_MOVE, np.abs(step[: model.nv]).max())
        mujoco.mj_integratePos(model, position, step[: model.nv], 1.0)
        forces += step[model.nv :]
    return None

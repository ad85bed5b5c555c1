"""How fast the fastest motion of a model is."""

import copy

import mujoco
import numpy as np
from numpy.typing import NDArray

FINE_DIFFERENCE = 1e-9  # [m, rad, m/s, rad/s], below the stretch of a stiff rope


def fastest_rate(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Largest modulus of the poles about the state in `data` [1/s], which is left as it is.

    From finite differences of the engine's own accelerations, with axes that slide: Coulomb's friction, which
    the engine keeps slow enough by itself, would hide what they do.
    """
    model = copy.copy(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
    trial = mujoco.MjData(model)
    qpos, qvel = data.qpos.copy(), data.qvel.copy()
    n = model.nv

    def acceleration() -> NDArray[np.float64]:
        mujoco.mj_forward(model, trial)
        qacc: NDArray[np.float64] = trial.qacc.copy()
        return qacc

    trial.qpos[:], trial.qvel[:], trial.ctrl[:] = qpos, qvel, data.ctrl
    rest = acceleration()
    system = np.zeros((2 * n, 2 * n))
    system[:n, n:] = np.eye(n)
    for k in range(n):
        direction = np.zeros(n)
        direction[k] = 1.0
        trial.qpos[:] = qpos
        mujoco.mj_integratePos(model, trial.qpos, direction, FINE_DIFFERENCE)
        system[n:, k] = (acceleration() - rest) / FINE_DIFFERENCE
        trial.qpos[:] = qpos
        trial.qvel[:] = qvel + FINE_DIFFERENCE * direction
        system[n:, n + k] = (acceleration() - rest) / FINE_DIFFERENCE
        trial.qvel[:] = qvel
    return float(np.abs(np.linalg.eigvals(system)).max())

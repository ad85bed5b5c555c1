"""Whether the physics step is short enough for the fastest motion of a model."""

import copy

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.plant import StepError
from cranectl.scenario.scenario import longest_step

# RK4 is stable for |rate · step| below 2.6 in all directions of decay (Hairer, Wanner: Solving Ordinary
# Differential Equations II, figure IV.2.1); at 2 it still damps a vibration within a few periods.
LARGEST = 2.0
SMALL = 1e-9  # [m, rad, m/s, rad/s], below the stretch of a stiff rope


def check_step(model: mujoco.MjModel, data: mujoco.MjData, what: str, *, period: float) -> None:
    """Raise StepError where the integrator would be unstable at the state in `data`.

    With the longest step that would do and divides the control period `period` [s].
    """
    rate, step = fastest_rate(model, data), float(model.opt.timestep)
    if rate * step > LARGEST:
        enough = longest_step(period, LARGEST / rate)
        raise StepError(
            f"{what}: something vibrates or decays with {rate:.3g} 1/s, too fast for steps of {step:g} s",
            allowed=f"rates up to {LARGEST / step:.3g} 1/s at this step",
            remedy=f"set control.physics_step to {enough:g} or less; or choose a softer "
            "rope or frame, a heavier winch, or a body with more inertia",
            step=enough,
        )


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
        mujoco.mj_integratePos(model, trial.qpos, direction, SMALL)
        system[n:, k] = (acceleration() - rest) / SMALL
        trial.qpos[:] = qpos
        trial.qvel[:] = qvel + SMALL * direction
        system[n:, n + k] = (acceleration() - rest) / SMALL
        trial.qvel[:] = qvel
    return float(np.abs(np.linalg.eigvals(system)).max())

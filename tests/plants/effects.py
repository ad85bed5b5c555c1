"""Short runs of the MuJoCo plant with effects, and its mechanical energy."""

import mujoco
import numpy as np

from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.plant import Drive
from cranectl.scenario.effects import EffectSettings
from cranectl.scenario.rig import RigParameters
from tests.conftest import STILL

RIG = RigParameters()
HANGING = np.array([1.0, 0, 0.7, 0, 0.8, 0, 0, 0, 0, 0])
SWINGING = np.array([1.0, 0, 0.7, 0, 0.8, 0, 0.4, 0.3, -0.3, 0.5])


def make(
    effects: EffectSettings,
    *,
    drive: Drive = "ideal",
    rig: RigParameters = RIG,
    step: float = 1e-3,
    substeps: int = 1,
    start: np.ndarray = HANGING,
) -> MujocoPlant:
    plant = MujocoPlant(rig, drive=drive, step=step, substeps=substeps, effects=effects)
    plant.reset(start)
    return plant


def simulate(
    plant: MujocoPlant, periods: int, command=(0.0, 0.0, 0.0), disturbance=(0.0, 0.0), wind=STILL
) -> tuple[np.ndarray, np.ndarray]:
    """States (periods, 10) and loads (periods, 7) at the start of each period; goes on from where it is.

    `command` is three numbers or a function of the period.
    """
    states, loads = np.zeros((periods, 10)), np.zeros((periods, 7))
    for k in range(periods):
        plant.measure(states[k])
        now = np.array(command(k) if callable(command) else command)
        plant.advance(now, np.array(disturbance), wind, loads[k])
    return states, loads


def energy(plant: MujocoPlant) -> float:
    """Kinetic and potential energy [J], that of a stretched rope included."""
    model, data = plant.model, copied(plant)
    mujoco.mj_forward(model, data)
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    stretch = max(data.qpos[plant.rig.distance[0]] - data.qpos[plant.rig.joints[2]], 0.0)
    stiffness = -plant.rig.rope.bias[1] if plant.rig.rope.active else 0.0
    return float(data.energy.sum() + 0.5 * stiffness * stretch**2)


def copied(plant: MujocoPlant) -> mujoco.MjData:
    """The plant's state in data of its own."""
    data = mujoco.MjData(plant.model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = plant.data.qpos, plant.data.qvel, plant.data.ctrl
    return data


def energies(plant: MujocoPlant, samples: int, periods: int) -> np.ndarray:
    """Energy now and after every `periods`, left to itself: shape (samples + 1,)."""
    values = [energy(plant)]
    for _ in range(samples):
        simulate(plant, periods)
        values.append(energy(plant))
    return np.array(values)

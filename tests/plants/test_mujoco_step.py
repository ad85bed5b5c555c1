"""The engine's own step, as compiled code calls it."""

import mujoco
import numpy as np

from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.scenario.effects import NO_EFFECTS
from cranectl.scenario.rig import RigParameters


def test_the_engine_does_not_look_at_a_clock() -> None:
    """Its timers, which cost a quarter of a step, stay at zero."""
    plant = MujocoPlant(RigParameters(), drive="ideal", step=1e-3, substeps=1, effects=NO_EFFECTS)
    plant.reset(np.array([1.0, 0.0, 0.7, 0.0, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0]))
    mujoco.mj_step(plant.model, plant.data, 100)
    timer = plant.data.timer[mujoco.mjtTimer.mjTIMER_STEP]
    assert timer.number >= 100
    assert timer.duration == 0.0

"""Short runs of plants that are made by name."""

from typing import Any

import numpy as np

from cranectl.compare.runs import compare_runs
from cranectl.plants.plant import Drive
from cranectl.plants.registry import PLANTS
from cranectl.scenario.effects import NO_EFFECTS, EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run
from tests.conftest import STILL

RIG = RigParameters()
HANGING = np.array([1.0, 0, 0.7, 0, 0.8, 0, 0, 0, 0, 0])
SWINGING = np.array([1.0, 0, 0.7, 0, 0.8, 0, 0.4, 0.3, -0.3, 0.5])


def make(
    name: str,
    effects: EffectSettings = NO_EFFECTS,
    *,
    drive: Drive = "ideal",
    rig: RigParameters = RIG,
    step: float = 1e-3,
    substeps: int = 1,
    start: np.ndarray = HANGING,
) -> Any:
    plant = PLANTS.entry(name).load()(rig, drive=drive, step=step, substeps=substeps, effects=effects)
    plant.reset(start)
    return plant


def simulate(
    plant: Any, periods: int, command=(0.0, 0.0, 0.0), disturbance=(0.0, 0.0), wind=STILL
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


def state_of(plant: Any) -> np.ndarray:
    """Return the joints (10,) that the plant measures now."""
    state = np.zeros(10)
    plant.measure(state)
    return state


def assert_runs_agree(first: Run, second: Run) -> None:
    """Check that two runs end alike and agree to 1e-7 m and rad."""
    assert (first.status, first.end_ns) == (second.status, second.end_ns)
    comparison = compare_runs(first, second)
    assert comparison.max_load_error_m < 1e-7
    assert comparison.max_angle_error_rad < 1e-7

"""A rope that goes slack and tight again: elastic and engine agree when, on flight and impacts."""

import numpy as np
import pytest

from cranectl.plants.plant import Drive
from cranectl.plants.registry import plant_entry
from cranectl.scenario.effects import Body, EffectSettings, Rope
from cranectl.scenario.rig import RigParameters
from tests.conftest import STILL

RIG = RigParameters()
START = np.array([1.0, 0.1, 0.7, -0.1, 0.5, 0.0, 0.2, 0.3, -0.15, 0.2])
PERIOD = 1e-3
EFFECTS = {
    "stiff": EffectSettings(rope=Rope(stiffness=5e4, mass=0.0)),
    "soft, heavy, with a body": EffectSettings(rope=Rope(stiffness=5e3, mass=0.05), body=Body()),
}


def thrown(name: str, effects: EffectSettings, drive: Drive, substeps: int) -> np.ndarray:
    """Return the load (N, 7) over 1.2 s while the winch pays out faster than it falls, and then stops."""
    plant = plant_entry(name).load()(
        RIG, drive=drive, step=PERIOD / substeps, substeps=substeps, effects=effects
    )
    plant.reset(START)
    loads = np.zeros((1200, 7))
    for k, load in enumerate(loads):
        if drive == "ideal":
            winch = 14.0 if k < 100 else -14.0 if k < 200 else 0.0
        else:
            winch = 1.2 if k < 150 else 0.0
        plant.advance(np.array([0.1, -0.1, winch]), np.zeros(2), STILL, load)
    return loads


@pytest.mark.parametrize("drive", ["ideal", "velocity"])
@pytest.mark.parametrize("rope", EFFECTS)
def test_slack_flight_and_impacts(rope: str, drive: Drive) -> None:
    """The difference decreases with the step; an impact multiplies it."""
    for substeps, room, flights in ((1, 8e-4, 2), (4, 2e-5, None)):
        elastic, engine = (thrown(name, EFFECTS[rope], drive, substeps) for name in ("elastic", "mujoco"))
        turns = [np.flatnonzero(np.diff((loads[:, 6] <= 0.0).astype(int))) for loads in (elastic, engine)]
        assert len(turns[0]) == len(turns[1]) >= 2
        until = flights and 2 * flights
        assert np.abs(turns[0] - turns[1])[:until].max() <= 1  # samples
        distance = np.linalg.norm(elastic[:, :3] - engine[:, :3], axis=1)
        assert distance[: turns[0][1]].max() < 0.3 * room
        assert distance.max() < room
        for loads, (slack, tight) in zip((elastic, engine), (turns[0][:2], turns[1][:2]), strict=True):
            fall = np.diff(loads[slack + 3 : tight - 1, 3:6], axis=0) / PERIOD
            assert len(fall) > 100
            if rope == "stiff":  # else the rope, or the body's turn, pulls on
                assert np.abs(fall - [0.0, 0.0, -RIG.gravity]).max() < 1e-6 * RIG.gravity

"""A rope that goes slack and tight again: elastic and engine agree when, on flight and impacts."""

import numpy as np
import pytest

from cranectl.plants.plant import Drive
from cranectl.scenario.effects import Body, EffectSettings, Rope
from tests.plants.cranes import RIG, make, simulate

START = np.array([1.0, 0.1, 0.7, -0.1, 0.5, 0.0, 0.2, 0.3, -0.15, 0.2])
PERIOD = 1e-3
EFFECTS = {
    "stiff": EffectSettings(rope=Rope(stiffness=5e4, mass=0.0)),
    "soft, heavy, with a body": EffectSettings(rope=Rope(stiffness=5e3, mass=0.05), body=Body()),
}


def thrown(name: str, effects: EffectSettings, drive: Drive, substeps: int) -> np.ndarray:
    """Return the load (N, 7) over 1.2 s while the winch pays out faster than it falls, and then stops."""

    def command(k: int) -> tuple[float, float, float]:
        if drive == "ideal":
            return 0.1, -0.1, 14.0 if k < 100 else -14.0 if k < 200 else 0.0
        return 0.1, -0.1, 1.2 if k < 150 else 0.0

    plant = make(name, effects, drive=drive, step=PERIOD / substeps, substeps=substeps, start=START)
    return simulate(plant, 1200, command)[1]


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

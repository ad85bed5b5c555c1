"""The mass of the hook in Drake, with the checks of `tests/plants/test_hook.py`."""

import pytest

from cranectl.plants.plant import Drive
from tests.plants.test_hook import CASES, assert_agree

EARLY = (
    '{joint="alpha", start=1.0, end=2.0, magnitude=0.01}'  # those of the scenario begin after three seconds
)
SHORT = {"fixed-position": ("duration=3", f"disturbances=[{EARLY}]"), "settled-trajectory": ()}


@pytest.mark.parametrize(("share", "drive", "scenario", "controller"), CASES)
def test_plants_agree_in_closed_loop(share: float, drive: Drive, scenario: str, controller: str) -> None:
    assert_agree("drake", "mujoco", share, drive, scenario, controller, *SHORT.get(scenario, ("duration=5",)))

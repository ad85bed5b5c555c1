"""A rig with errors of installation: slope of rails, offset of the rope's encoder, gains of drives."""

import numpy as np
import pytest

from cranectl.model.dynamics import axis_masses, drive_forces
from cranectl.plants.plant import DRIVES
from cranectl.plants.surroundings import gravity_in_rig
from cranectl.scenario.effects import EffectSettings, Installation
from tests.conftest import PLANTS, closed_loop

PATH = "fast-diagonal", "lqr"


def test_gravity_of_sloping_rails_keeps_its_size() -> None:
    sloping = EffectSettings(installation=Installation(tilt=(0.1, -0.2)))
    pull = np.array(gravity_in_rig(9.81, sloping))
    assert np.linalg.norm(pull) == pytest.approx(9.81, rel=1e-15)
    assert pull[:2] == pytest.approx(9.81 * np.array([-np.sin(0.1), np.sin(0.2)]), rel=1e-15)
    assert gravity_in_rig(9.81, EffectSettings()) == (0.0, 0.0, -9.81)


@pytest.mark.parametrize("plant", PLANTS)
def test_a_wrong_zero_of_the_rope_leaves_the_load_that_much_off(plant: str) -> None:
    """The tracker controls the length that the encoder reads, so the load hangs 1 cm too high."""
    held = ["duration=12.0", "disturbances=[]", "reference.segments=[]"]
    wrong = (*PATH, plant, "ideal", *held, "effects.installation={rope_offset=0.01}")
    run, sensed = closed_loop(*wrong), closed_loop(*wrong, "effects.sensing={}")
    apart = run.load_position[-1] - run.reference[-1, :3]
    assert apart == pytest.approx([0.0, 0.0, 0.01], abs=1e-4)
    assert sensed.block("load")[-1, 2] - sensed.reference[-1, 2] == pytest.approx(0.01, abs=3e-4)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("drive", DRIVES)
def test_a_drive_executes_its_gain_times_the_command(plant: str, drive: str) -> None:
    gains = "effects.installation={drive_gain=[1.1, 0.9, 1.05]}"
    run = closed_loop(*PATH, plant, drive, "duration=5.0", gains)
    first = 0 if drive == "ideal" else 3
    commanded = run.block("input")[:, first : first + 3]
    if drive == "force":
        masses = axis_masses(run.scenario.rig)
        rows = zip(run.block("measurement"), run.block("input"), strict=True)
        commanded = np.array([drive_forces(masses, state, *command[:3]) for state, command in rows])
    assert np.abs(commanded).max() > 0.1
    assert run.block("command")[:, :3] == pytest.approx(commanded * [1.1, 0.9, 1.05], rel=1e-12)
    if drive == "ideal":
        rates = run.block("state")[:, 1:6:2]
        assert np.diff(rates, axis=0) == pytest.approx(1e-3 * run.block("command")[:-1, :3], abs=1e-9)

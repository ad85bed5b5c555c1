"""Periods, steps that are too long, what has no numbers."""

import numpy as np
import pytest

from cranectl.plants.drake.plant import DrakePlant
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import NO_EFFECTS, Body, EffectSettings, Frame
from cranectl.scenario.rig import RigParameters
from cranectl.support.errors import InputError
from tests.conftest import STILL
from tests.plants.test_books import HOOK, NUMBERS, Manner, misses


def test_a_load_at_the_pivot_has_no_numbers_and_ends_no_process() -> None:
    plant = DrakePlant(RigParameters(), drive="ideal", step=1e-3, substeps=1, effects=NO_EFFECTS)
    load = np.zeros(7)
    plant.reset(np.zeros(10))
    for _ in range(2):
        plant.advance(np.zeros(3), np.zeros(2), STILL, load)
        assert np.isnan(load).all()


def test_a_frame_too_stiff_for_the_steps_is_refused_with_the_step_that_would_do() -> None:
    """By its own frequency: the rails alone against the spring, since drives yield."""
    frame = Frame(frequency=(9.0, 400.0), damping_ratio=0.0)
    rig, effects = RigParameters(), EffectSettings(frame=frame)
    plant = DrakePlant(rig, drive="force", step=1e-3, substeps=1, effects=effects)
    standing = rig.bridge_mass + rig.trolley_mass
    fastest = 2.0 * np.pi * 400.0 * np.sqrt((frame.mass + standing) / (frame.mass + rig.bridge_mass))
    assert plant.fastest_rate(0.7) == pytest.approx(fastest, rel=1e-3)
    with pytest.raises(InputError, match="too fast for steps"):
        plant.check_length(0.7)
    DrakePlant(rig, drive="force", step=5e-4, substeps=2, effects=effects).check_length(0.7)


@pytest.mark.parametrize("substeps", [1, 4])
def test_periods_are_as_long_as_said(substeps: int) -> None:
    """The load falls on with the winch's free rotor: v t + g t² / 2, rotor and load."""
    rig = RigParameters()
    plant = DrakePlant(rig, drive="force", step=1e-2 / substeps, substeps=substeps, effects=NO_EFFECTS)
    plant.reset(np.array([1.0, 0.0, 0.7, 0.0, 0.5, 0.2, 0.0, 0.0, 0.0, 0.0]))
    for _ in range(10):
        plant.advance(np.zeros(3), np.zeros(2), STILL, load := np.zeros(7))
    state = np.zeros(10)
    plant.measure(state)
    falls = rig.weight / (rig.load_mass + rig.winch_mass)
    assert state[4] == pytest.approx(0.5 + 0.2 * 0.1 + 0.5 * falls * 0.1**2, rel=1e-12)
    assert load[6] == pytest.approx(rig.winch_mass * falls, rel=1e-12)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("body", [None, NUMBERS.body, HOOK.body], ids=["point", "body", "hook"])
def test_nothing_is_missing_in_the_books(body: Body | None, drive: Drive) -> None:
    """Of energy and momentum, with all that this crane can show."""
    shown = NUMBERS.only("frame", "wind", "friction", "installation").model_copy(update={"body": body})
    assert misses("drake", shown, drive, Manner(seconds=0.2)).max() < 1e-10

"""The Drake plant: length of periods, limits of the step, singular states, balances of energy."""

import numpy as np
import pytest

from cranectl.plants.drake.plant import DrakePlant
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import NO_EFFECTS, Body, EffectSettings, Frame
from cranectl.scenario.rig import RigParameters
from cranectl.support.errors import InputError
from tests.conftest import STILL
from tests.plants.test_books import HOOK, NUMBERS, Manner, misses


def test_a_load_at_the_pivot_gives_nan_and_does_not_crash() -> None:
    plant = DrakePlant(RigParameters(), drive="ideal", step=1e-3, substeps=1, effects=NO_EFFECTS)
    load = np.zeros(7)
    plant.reset(np.zeros(10))
    for _ in range(2):
        plant.advance(np.zeros(3), np.zeros(2), STILL, load)
        assert np.isnan(load).all()


def test_a_frame_too_stiff_for_the_steps_is_refused() -> None:
    """Its frequency is that of the rails alone against the spring, because force drives do not hold them.

    The message names a step that is short enough.
    """
    frame = Frame(frequency=(9.0, 400.0), damping_ratio=0.0)
    rig, effects = RigParameters(), EffectSettings(frame=frame)
    plant = DrakePlant(rig, drive="force", step=1e-3, substeps=1, effects=effects)
    total = rig.bridge_mass + rig.trolley_mass
    fastest = 2.0 * np.pi * 400.0 * np.sqrt((frame.mass + total) / (frame.mass + rig.bridge_mass))
    assert plant.fastest_rate(0.7) == pytest.approx(fastest, rel=1e-3)
    with pytest.raises(InputError, match="too fast for steps"):
        plant.check_length(0.7)
    DrakePlant(rig, drive="force", step=5e-4, substeps=2, effects=effects).check_length(0.7)


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_period_has_the_declared_length(substeps: int) -> None:
    """The load falls by v t + a t² / 2; `a` follows from gravity and the free rotor of the winch."""
    rig = RigParameters()
    plant = DrakePlant(rig, drive="force", step=1e-2 / substeps, substeps=substeps, effects=NO_EFFECTS)
    plant.reset(np.array([1.0, 0.0, 0.7, 0.0, 0.5, 0.2, 0.0, 0.0, 0.0, 0.0]))
    for _ in range(10):
        plant.advance(np.zeros(3), np.zeros(2), STILL, load := np.zeros(7))
    state = np.zeros(10)
    plant.measure(state)
    acceleration = rig.weight / (rig.load_mass + rig.winch_mass)
    assert state[4] == pytest.approx(0.5 + 0.2 * 0.1 + 0.5 * acceleration * 0.1**2, rel=1e-12)
    assert load[6] == pytest.approx(rig.winch_mass * acceleration, rel=1e-12)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("body", [None, NUMBERS.body, HOOK.body], ids=["point", "body", "hook"])
def test_energy_and_momentum_balance(body: Body | None, drive: Drive) -> None:
    """The balances close with all effects that this plant has."""
    effects = NUMBERS.only("frame", "wind", "friction", "installation").model_copy(update={"body": body})
    assert misses("drake", effects, drive, Manner(seconds=0.2)).max() < 1e-10

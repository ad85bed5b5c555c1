"""Energy and momentum of every plant are balanced, effect by effect."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cranectl.plants import registry
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import (
    Body,
    EffectNumbers,
    EffectSettings,
    Frame,
    Friction,
    Installation,
    Rope,
    Wind,
)
from tests.conftest import PLANTS
from tests.plants.books import Books, books, whole_state
from tests.plants.cranes import RIG, make

NUMBERS = EffectNumbers(
    rope=Rope(stiffness=500.0, mass=0.0, damping_ratio=0.02),
    body=Body(hook_offset=0.2, inertia=0.03, swing_damping=0.02),
    frame=Frame(frequency=(1.0, 1.5), damping_ratio=0.05),
    friction=Friction(coulomb=(0.0, 0.0, 0.0), pivot_coulomb=0.0, pivot_viscous=0.01),
    wind=Wind(drag_area=0.2),
    installation=Installation(tilt=(0.02, -0.03)),
)
START = np.array([0.0, 0.1, 0.0, -0.2, 0.8, 0.05, 0.3, 0.4, -0.25, -0.3])
WIND = np.array([1.5, -0.9, 0.3, 0.2, -0.1, 0.3])
PARTS = 6  # samples of a period, over which the command is constant
WEIGHTS = np.linalg.solve(
    np.vander(np.arange(PARTS) / PARTS, increasing=True).T, 1.0 / np.arange(1, PARTS + 1)
)


class Manner(NamedTuple):
    """How a crane is moved: for how long, and with which periods [s]."""

    seconds: float = 0.5
    period: float = 1e-3


DEFAULT = Manner()


def kept_books(name: str, effects: EffectSettings, drive: Drive, manner: Manner) -> Books:
    """Of a crane that moves about."""
    plant = make(name, effects, drive=drive, step=manner.period / PARTS, start=START)
    air, n = WIND if effects.wind else np.zeros(6), round(manner.seconds / manner.period) * PARTS
    states, loads, commands = np.zeros((n, 22)), np.zeros((n, 7)), np.zeros((n, 3))
    for k in range(n):
        states[k] = whole_state(plant)
        now = k // PARTS * manner.period
        commands[k] = commands[k - 1] if k % PARTS else command_at(now, states[k], drive)
        plant.advance(commands[k], np.zeros(2), air, loads[k])
    kept = books(RIG, effects, drive, states, loads, commands, air)
    assert_allclose(loads[:, :3], kept.load, rtol=0.0, atol=1e-12)
    assert_allclose(loads[:, 3:6], kept.speed, rtol=0.0, atol=1e-12)
    return kept


def command_at(time: float, state: np.ndarray, drive: Drive) -> np.ndarray:
    command = np.array([0.2, 0.15, 0.1]) * np.cos(np.array([1.0, 1.3, 0.7]) * time)
    if drive != "force":
        return command
    holding = np.array([0.0, 0.0, RIG.weight + 50.0 * (state[4] - START[4])])
    return command * RIG.driven_masses - holding - 10.0 * state[1:6:2]


def misses(name: str, effects: EffectSettings, drive: Drive, manner: Manner = DEFAULT) -> np.ndarray:
    """Return the largest error of each balance: energy over m g l, momenta over m sqrt(g l).

    Some balances cannot be checked. The forces of ideal drives, and of drives that do not feel the load, are
    not known, nor is the force that holds a heavy rope aside. Friction that sticks loses no energy.
    """
    kept = kept_books(name, effects, drive, manner)
    driven = drive == "force" or (drive == "velocity" and registry.PLANTS.entry(name).servos)
    hanging = not (effects.rope and effects.rope.mass)
    has_friction = effects.friction and any(effects.friction.coulomb)
    pulled = [hanging] * 3 + [bool(driven or effects.frame)] * 2
    stored = np.column_stack([kept.energy, kept.momentum])[:, [driven, *pulled]]
    inputs = np.column_stack([kept.power, kept.force])[:, [driven, *pulled]]
    within = inputs.reshape(-1, PARTS, inputs.shape[1])
    work = np.cumsum(manner.period * np.tensordot(WEIGHTS, within, (0, 1)), axis=0)[:-1]
    unit = RIG.load_mass * np.sqrt(RIG.gravity * START[4])
    units = np.array([RIG.weight * START[4] if driven else unit, *[unit] * (inputs.shape[1] - 1)])
    assert (np.abs(work).max(axis=0) > 1e-3 * units).all(), "something must have been done"
    missing = np.abs(stored[PARTS::PARTS] - stored[0] - work).max(axis=0) / units
    return missing[:1] if has_friction else missing


AXES_RUB = NUMBERS.friction
COULOMB = (0.6, 0.5, 0.4)
EFFECTS = {
    "none": NUMBERS.only(),
    **{name: NUMBERS.only(name) for name in ("installation", "friction", "wind", "frame", "body", "rope")},
    "joint rubs": EffectSettings(friction=AXES_RUB.model_copy(update={"viscous": (0.0, 0.0, 0.0)})),
    "all rubs": EffectSettings(
        friction=AXES_RUB.model_copy(update={"coulomb": COULOMB, "pivot_coulomb": 0.02})
    ),
    "heavy rope": EffectSettings(
        rope=NUMBERS.rope.model_copy(update={"mass": 0.2}), frame=NUMBERS.frame, wind=NUMBERS.wind
    ),
    "all": NUMBERS.only("rope", "body", "frame", "wind", "friction", "installation"),
}
HOOK = EffectSettings(body=NUMBERS.body.model_copy(update={"hook_mass": 0.5}))
EFFECTS["hook"] = HOOK
EFFECTS["all with hook"] = EFFECTS["all"].model_copy(update={"body": HOOK.body})
EXACT = {  # effects with which the error is at most that of an integrator of order 4
    "analytic": ("none", "installation", "joint rubs", "wind"),
    "elastic": ("none", "body", "rope", "heavy rope", "all", "hook", "all with hook"),
    "mujoco": ("none", "installation", "friction", "frame", "wind", "rope", "heavy rope", "hook"),
}


@pytest.mark.parametrize(("name", "shown"), [(name, shown) for name in EXACT for shown in EXACT[name]])
@pytest.mark.parametrize("drive", DRIVES)
def test_energy_and_momentum_are_balanced(name: str, shown: str, drive: Drive) -> None:
    assert misses(name, EFFECTS[shown], drive).max() < (1e-9 if name == "mujoco" else 1e-10)


@pytest.mark.parametrize("drive", ["velocity", "force"])
@pytest.mark.parametrize("name", PLANTS)
def test_energy_and_momentum_are_balanced_after_20_seconds(name: str, drive: Drive) -> None:
    period = 2e-3 if drive == "velocity" else 4e-3
    assert misses(name, EFFECTS["none"], drive, Manner(seconds=20.0, period=period)).max() < 1e-9


def test_the_engines_hook_weighs_next_to_nothing() -> None:
    assert misses("mujoco", EFFECTS["body"], "velocity").max() < 2e-8


@pytest.mark.parametrize("drive", ["velocity", "force"])
@pytest.mark.parametrize("name", ["elastic", "mujoco"])
def test_energy_is_balanced_with_friction(name: str, drive: Drive) -> None:
    """Joints stick and slip between the samples of a period."""
    assert misses(name, EFFECTS["all rubs"], drive, Manner(seconds=2.0)).max() < 1e-7

"""The budget's own equations of the crane as it is built, against the engine, effect by effect."""

import numpy as np
import pytest

from cranectl.analysis.budget.real_crane import (
    STRETCH,
    advance,
    load_positions,
    make_crane,
    make_work,
    nominal_states,
)
from cranectl.analysis.levels import assumed_effects
from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.scenario import load_scenario
from cranectl.scenario.effects import EffectSettings

START = np.array([1.0, 0.0, 0.7, 0.0, 0.8, 0.0, 0.1, 0.0, -0.15, 0.0])
WIND = np.array([1.5, -0.9, 0.3, 0.0, 0.0, 0.0])
SCENARIO = load_scenario("fast-diagonal")

# Largest differences of angles [rad] and load [m] over 0.8 s of motion in all axes. The engine holds a
# disturbance over a step, and drag by up to a step late; the damper of its hook resists a turn about the rope
# too, which a direction does not have.
EXACT, HELD, LATE, TURN = 1e-9, 2e-8, 1e-5, 2e-5
CASES = [
    ((), (0.0, 0.0), 1e-14), ((), (0.5, -0.4), HELD), (("frame",), (0.0, 0.0), 1e-14),
    (("rope",), (0.0, 0.0), EXACT), (("rope", "frame"), (0.5, -0.4), HELD), (("wind",), (0.0, 0.0), LATE),
    (("body",), (0.5, -0.4), TURN), (("rope", "body", "wind", "frame"), (0.5, -0.4), TURN),
]  # fmt: skip


def drive(
    effects: EffectSettings, disturbance: tuple[float, float], believed: EffectSettings | None = None
) -> tuple[float, float]:
    """Largest difference of joints and of load over a motion, and how far the motion went."""
    plant = MujocoPlant(SCENARIO.rig, drive="velocity", step=1e-3, substeps=1, effects=effects)
    plant.reset(START)
    crane = make_crane(SCENARIO, believed or effects, START[4])
    state = nominal_states(crane, START[None], np.array([SCENARIO.rig.weight]))[0]
    if effects.rope:
        state[2 * STRETCH] = plant.data.qpos[plant.rig.distance[0]] - START[4]
    work, load, joints = make_work(), np.zeros(7), np.zeros(10)
    difference, way = 0.0, 0.0
    for k in range(800):
        setpoint = np.array([0.4, 0.3, 0.2]) * np.sin(np.array([3.0, 4.0, 2.0]) * 1e-3 * k + [0.0, 0.3, 0.0])
        here = load_positions(crane, state[None])[0]
        plant.advance(setpoint, np.array(disturbance), WIND, load)
        advance(crane, state, setpoint, np.array(disturbance), WIND, work)
        plant.measure(joints)
        difference = max(difference, np.abs(joints - state[:10])[::2].max(), np.abs(here - load[:3]).max())
        way = max(way, np.abs(joints - START)[::2].min())
    return difference, way


@pytest.mark.parametrize(("names", "disturbance", "limit"), CASES)
def test_it_moves_as_the_engine_does(
    names: tuple[str, ...], disturbance: tuple[float, float], limit: float
) -> None:
    difference, way = drive(assumed_effects(SCENARIO).only(*names), disturbance)
    assert difference < limit
    assert way > 0.03


@pytest.mark.parametrize(
    ("effect", "changed"),
    [
        ("rope", {"stiffness": 4.9e4}), ("rope", {"mass": 0.0031}), ("rope", {"damping_ratio": 0.11}),
        ("body", {"inertia": 1.1e-3}), ("body", {"hook_offset": 0.061}), ("body", {"swing_damping": 2e-3}),
        ("wind", {"drag_area": 0.004}), ("frame", {"mass": 21.0}), ("frame", {"frequency": (9.1, 12.0)}),
        ("frame", {"damping_ratio": 0.022}),
    ],
)  # fmt: skip
def test_another_crane_moves_otherwise(effect: str, changed: dict[str, float]) -> None:
    """The limits above would notice a change of any constant by a few per cent."""
    effects = assumed_effects(SCENARIO).only(effect)
    other = effects.model_copy(update={effect: getattr(effects, effect).model_copy(update=changed)})
    limit = {"wind": LATE, "body": TURN}.get(effect, EXACT)
    assert drive(effects, (0.0, 0.0), other)[0] > 1.5 * limit

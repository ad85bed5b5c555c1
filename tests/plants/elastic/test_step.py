"""The elastic plant's integrator: its order, joints that stick, and where they let go."""

from contextlib import nullcontext

import numpy as np
import pytest

from cranectl.plants.elastic.crane import RAILS, STRETCH
from cranectl.plants.elastic.plant import ElasticPlant
from cranectl.plants.elastic.step import stick_or_slip
from cranectl.plants.mujoco.model import fastest_rate
from cranectl.plants.plant import DRIVES, MAX_RATE_STEP, Drive, StepError
from cranectl.scenario.effects import EffectNumbers, EffectSettings, Rope
from cranectl.support.arrays import Array
from tests.plants.cranes import HANGING, RIG, make, simulate

NUMBERS = EffectNumbers()
START = np.array([1.0, 0.1, 0.7, -0.2, 0.8, 0.05, 0.1, 0.4, -0.15, -0.3])
QUIET, AIR = np.zeros(2), np.zeros(6)


def ended(substeps: int, names: tuple[str, ...]) -> Array:
    """Return the state (22,) after 25 periods of one command each."""
    effects, step = NUMBERS.only(*names), 0.016 / substeps
    plant = make("elastic", effects, drive="velocity", step=step, substeps=substeps, start=START)
    simulate(plant, 25, lambda k: np.array([0.3, -0.2, 0.1]) * np.cos(0.2 * k), (0.4, -0.3))
    return plant.state


@pytest.mark.parametrize("names", [(), ("frame",), ("body", "frame"), ("friction",)])
def test_half_the_step_leaves_a_thirty_second_of_the_error(names: tuple[str, ...]) -> None:
    """Friction too: a step is parted where joints stick and let go."""
    best = ended(64, names)
    errors = [np.abs(ended(substeps, names) - best).max() for substeps in (2, 4, 8)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert errors[0] > 1e-9
    assert orders.min() > 4.5


def test_a_joint_sticks_and_lets_go() -> None:
    """The trolley stands to the last bit until more than Coulomb's friction pushes, then it accelerates."""
    friction = NUMBERS.friction.model_copy(update={"viscous": (0.0, 0.0, 0.0)})
    plant = make("elastic", EffectSettings(friction=friction), drive="force")
    state, load = np.zeros(10), np.zeros(7)
    weight = -RIG.weight
    for push in (0.5, -0.999):
        for _ in range(50):
            plant.advance(np.array([0.0, push, weight + 0.9]), QUIET, AIR, load)
        plant.measure(state)
        assert state.tolist() == HANGING.tolist()
    plant.advance(np.array([0.0, 1.5, weight - 2.0]), QUIET, AIR, load)
    plant.measure(state)
    assert state[3] == pytest.approx(1e-3 * (1.5 - 1.0) / RIG.trolley_mass, rel=2e-3)  # the joint holds too
    assert state[5] == pytest.approx(-1e-3 * (2.0 - 1.0) / (RIG.winch_mass + RIG.load_mass), rel=1e-3)
    raised = 1.0 / (RIG.winch_mass + RIG.load_mass)
    assert load[6] == pytest.approx(RIG.load_mass * (RIG.gravity + raised))  # with the new command acting


@pytest.mark.parametrize("names", [("rope",), ("frame",), ("body", "frame"), ("friction", "rope")])
@pytest.mark.parametrize("drive", DRIVES)
def test_it_vibrates_as_fast_as_the_engine_does(names: tuple[str, ...], drive: Drive) -> None:
    """The poles by which steps are judged; so both plants refuse the same ones."""
    effects = NUMBERS.only(*names)
    engine, elastic = (make(name, effects, drive=drive) for name in ("mujoco", "elastic"))
    assert elastic.fastest_rate(HANGING[4]) == pytest.approx(
        fastest_rate(engine.model, engine.data), rel=1e-3
    )
    with pytest.raises(StepError, match="too fast for steps"):
        ElasticPlant(RIG, drive=drive, step=0.05, substeps=1, effects=effects).check_length(0.8)


@pytest.mark.parametrize("name", ["mujoco", "elastic"])
def test_a_damped_rope_that_becomes_short_needs_shorter_steps(name: str) -> None:
    """The viscosity of the start stays, so a shorter rope decays faster.

    A load m on a rope of length l has the poles of m s^2 + (v / l) s + E A / l, with v = 2 D sqrt(E A m l0).
    """
    rope, starts, short = Rope(stiffness=4e3, damping_ratio=3.0, mass=0.0), 0.7, 0.2
    viscosity = 2.0 * rope.damping_ratio * np.sqrt(rope.stiffness * RIG.load_mass * starts)
    rate = np.abs(np.roots([RIG.load_mass, viscosity / short, rope.stiffness / short])).max()
    start = np.zeros(10)
    start[4] = starts
    for step, is_stable in ((0.99 * MAX_RATE_STEP / rate, True), (1.01 * MAX_RATE_STEP / rate, False)):
        plant = make(name, EffectSettings(rope=rope), step=step, start=start)
        with nullcontext() if is_stable else pytest.raises(StepError, match=r"0\.2 m of rope"):
            plant.check_length(short)


@pytest.mark.parametrize("names", [(), ("frame",), ("rope",), ("frame", "rope")])
def test_what_holds_a_joint_is_what_would_have_to_push_it(names: tuple[str, ...]) -> None:
    """Drives and torques that add the holding forces leave joints without friction at rest, on slopes too."""
    slopes = NUMBERS.installation.model_copy(update={"tilt": (0.05, -0.08)})
    with_friction = NUMBERS.only(*names).model_copy(
        update={
            "friction": NUMBERS.friction.model_copy(update={"coulomb": (1e3,) * 3, "pivot_coulomb": 1e3}),
            "installation": slopes,
        }
    )
    loose = with_friction.model_copy(update={"friction": None})
    still = np.array([1.0, 0.0, 0.7, 0.0, 0.8, 0.0, 0.4, 0.0, -0.5, 0.0])
    rates, command, disturbance = [], np.array([2.0, -3.0, -7.0]), np.array([0.5, -0.4])
    for effects in (with_friction, loose):
        plant = make("elastic", effects, drive="force", start=still)
        if effects.frame:
            plant.state[RAILS:] = 0.01, 0.2, -0.02, -0.1
        if effects.rope:
            plant.state[STRETCH] = 3e-4
        stick_or_slip(plant.crane, plant.state, command, disturbance, AIR, plant.work)
        rates.append(plant.work.rates[0].copy())
        if effects is with_friction:
            assert plant.work.stuck.all()
            assert np.abs(plant.work.holding).min() > 1e-3
            reach = plant.state[4] - plant.crane.offset + plant.state[STRETCH]
            inertia = RIG.load_mass * reach**2 * np.array([np.cos(still[8]) ** 2, 1.0])
            command = command + plant.work.holding[:3]
            disturbance = disturbance + plant.work.holding[3:] / inertia
    assert rates[0][:10] == pytest.approx(np.zeros(10), abs=0.0)
    assert rates[1] == pytest.approx(rates[0], abs=1e-9)

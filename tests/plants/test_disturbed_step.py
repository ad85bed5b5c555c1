"""Steps under a disturbance: the engine's own scheme with forces of each stage, for one model only."""

import itertools

import mujoco
import numpy as np
import pytest

from cranectl.plants.mujoco.disturbed_step import step_in_stages, turn_rate
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import NO_EFFECTS, Body, EffectSettings, Frame, Friction, Rope, Wind
from tests.conftest import STILL
from tests.plants.cranes import make, simulate, state_of

START = np.array([1.0, 0.3, 0.7, -0.2, 0.7, 0.4, 0.2, 0.3, -0.3, 0.1])
PHYSICAL = {"friction": Friction(), "rope": Rope(), "body": Body(), "frame": Frame()}
SETS = [names for count in (0, 1, 4) for names in itertools.combinations(PHYSICAL, count)]
PUSH = np.array([3.0, -3.0])


def course(drive: Drive, effects: EffectSettings, *, in_stages: bool) -> np.ndarray:
    """Return all that 50 steps leave in the data, with drive forces that are constant over each step."""
    step = 1e-4 if effects.rope else 1e-3
    plant = make("mujoco", effects, drive=drive, step=step, start=START)
    if in_stages:  # or it would be paid out
        plant.rig = plant.rig._replace(rope=plant.rig.rope._replace(active=False))
    data, rows = plant.data, []
    for k in range(50):
        data.ctrl[plant.rig.drives] = np.array([0.2, -0.15, 0.1]) * np.sin(0.1 * k)
        data.qfrc_applied[plant.rig.rates[:3]] = [3.0, -2.0, 1.0]
        if in_stages:
            step_in_stages(plant.rig, np.zeros(2), STILL)
        else:
            mujoco.mj_step(plant.model, data)
        rows.append(np.concatenate([data.qpos, data.qvel, data.sensordata, data.qacc_warmstart]))
    return np.array(rows)


@pytest.mark.parametrize("names", SETS, ids="+".join)
@pytest.mark.parametrize("drive", DRIVES)
def test_without_a_disturbance_it_is_the_engines_step(drive: Drive, names: tuple[str, ...]) -> None:
    """Bit for bit; where the load turns on a ball joint, to the order of the scheme."""
    effects = EffectSettings(**{name: PHYSICAL[name] for name in names})
    engines, ours = (course(drive, effects, in_stages=stages) for stages in (False, True))
    assert np.isfinite(engines).all()
    assert np.ptp(engines[:, 3]) > 1e-4
    if "body" in names:
        moved = len(engines[0]) // 2
        assert np.abs(engines - ours)[:, :moved].max() < 1e-9
    else:
        assert (engines == ours).all()


def pushed(effects: EffectSettings, step: float) -> np.ndarray:
    """State after 0.2 s of hoisting under a disturbance of 3 rad/s² about both axes."""
    plant = make("mujoco", effects, step=step, substeps=round(0.2 / step), start=START)
    simulate(plant, 1, (0.5, -0.4, 1.0), PUSH)
    return state_of(plant)


@pytest.mark.parametrize("effects", [NO_EFFECTS, EffectSettings(body=Body())], ids=["point", "body"])
def test_a_disturbance_leaves_the_order_of_the_step_at_four(effects: EffectSettings) -> None:
    exact = pushed(effects, 0.0005)
    coarse, fine = (np.abs(pushed(effects, step) - exact).max() for step in (0.008, 0.004))
    assert coarse > 1e-10
    assert coarse / fine > 11.0


def test_a_pushed_crane_moves_as_the_equations_say() -> None:
    plant = make("analytic", substeps=200, start=START)
    simulate(plant, 1, (0.5, -0.4, 1.0), PUSH)
    assert pushed(NO_EFFECTS, 1e-3) == pytest.approx(plant.state, abs=1e-10)


@pytest.mark.parametrize("effects", [NO_EFFECTS, EffectSettings(body=Body(), wind=Wind())], ids=str)
def test_nothing_of_a_disturbance_is_left_when_it_ends(effects: EffectSettings) -> None:
    plant = make("mujoco", effects, start=START)
    simulate(plant, 1, disturbance=PUSH, wind=np.array([3.0, 1.0, 0.0, 0.0, 2.0, 0.0]))
    assert not plant.rig.applied.any()
    assert not plant.rig.reaction.any()
    assert not plant.rig.wrench.any()


def test_other_models_of_the_process_are_untouched() -> None:
    """No callback of the engine is set, and another model in the process moves as before."""
    xml = "<mujoco><worldbody><body><joint/><geom size='0.1' pos='0 1 0'/></body></worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(xml)

    def other() -> list[float]:
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 100)
        return [*data.qpos.tolist(), *data.qvel.tolist()]

    before = other()
    pushed(NO_EFFECTS, 1e-3)
    assert other() == before
    assert mujoco.get_mjcb_passive() is mujoco.get_mjcb_control() is None


def test_turn_rate_is_that_of_rotations() -> None:
    """exp(turn) carried on by a spin about the body's axes for a short while is exp(turn + rate · while)."""

    def quaternion(turn: np.ndarray) -> np.ndarray:
        result = np.zeros(4)
        angle = float(np.linalg.norm(turn))
        mujoco.mju_axisAngle2Quat(result, turn / angle, angle)
        return result

    turn, spin, short = np.array([0.02, -0.01, 0.03]), np.array([0.7, -1.1, 0.4]), 1e-6
    carried = quaternion(turn)
    mujoco.mju_quatIntegrate(carried, spin, short)
    assert quaternion(turn + short * np.array(turn_rate(turn, spin))) == pytest.approx(carried, abs=1e-14)

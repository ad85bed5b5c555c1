"""The environment keeps Gymnasium's rules, training is repeatable, and the policy keeps its limits."""

import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import train
from crane_env import SCENARIO, STEPS, GantryCrane, GantryCranes, act
from gymnasium.utils.env_checker import check_env

from cranectl import assert_agree, assert_limits

GAINS = np.array([[3.0, -0.5, 8.0, -0.3, -10.0, 1.5]])
REAL = [
    "effects.sensing={}",
    "effects.delay.seconds=0.01",
    "effects.friction={}",
    "effects.wind.mean=[2,1,0]",
]


def test_gymnasium_finds_nothing_wrong():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make("GantryCrane-v0", plant="mujoco").unwrapped)


def play(crane, seed, policy=lambda seen: act(GAINS, seen[np.newaxis])[0]):
    """Return observations and rewards of an episode."""
    seen, _ = crane.reset(seed=seed)
    observations, earned, over = [seen], [], False
    while not over:
        seen, reward, stopped, late, _ = crane.step(policy(seen))
        observations.append(seen)
        earned.append(reward)
        over = stopped or late
    return np.array(observations), np.array(earned)


def test_an_episode_can_be_repeated_and_reaches_its_target():
    crane = GantryCrane()
    first, again, other = play(crane, 1), play(crane, 1), play(crane, 2)
    assert np.array_equal(first[0], again[0])
    assert np.array_equal(first[1], again[1])
    assert not np.array_equal(first[0], other[0])
    for observations, earned in (first, other):
        assert len(earned) == STEPS
        assert np.linalg.norm(observations[0, :3]) > 0.1
        assert np.linalg.norm(observations[-1, :3]) < 0.01


@pytest.mark.parametrize("action", [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
def test_a_crash_does_not_pay(action):
    crane = GantryCrane()
    _, moved = play(crane, 5)
    _, crashed = play(crane, 5, lambda _: np.array(action, dtype=float))
    assert len(crashed) < STEPS
    assert crashed.sum() < moved.sum()


def test_many_cranes_earn_what_one_does():
    """Also those that crash: the second has a policy that drives out of the rig."""
    gains = np.concatenate([GAINS, -GAINS])
    cranes, total, running = GantryCranes(2), np.zeros(2), np.full(2, True)
    seen, _ = cranes.reset(seed=[7, 7])
    for _ in range(STEPS):
        seen, reward, stopped, over, information = cranes.step(act(gains, seen))
        total += running * reward
        running &= ~(stopped | over)
    assert information["_final_obs"].tolist() == [True, False]
    assert np.linalg.norm(information["final_obs"][0, :3]) < 0.01

    crane = GantryCrane()
    for i in range(2):
        crane._np_random = np.random.default_rng(7)
        _, earned = play(crane, None, lambda seen, own=gains[i : i + 1]: act(own, seen[np.newaxis])[0])
        assert earned.sum() == pytest.approx(total[i], abs=1e-9)


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    """Return a policy that was trained just now, as a controller."""
    folder = tmp_path_factory.mktemp("policy")
    code = Path(train.__file__).with_name("learned.py").read_text(encoding="utf-8")
    code = code.replace('name="learned"', 'name="trained"')  # the installed one has the first name
    (folder / "learned.py").write_text(code, encoding="utf-8")
    np.savetxt(folder / "policy.txt", train.train())
    return f"{folder / 'learned.py'}:LEARNED"


@pytest.mark.parametrize("effects", [[], REAL], ids=["nominal", "real"])
def test_a_trained_policy_keeps_the_limits(closed_loop, controller, effects):
    """Training used `elastic` only."""
    plants = ["elastic", "mujoco"]
    runs = closed_loop(SCENARIO, controller, plants=plants, drive="velocity", overrides=effects)
    assert_limits(runs)


def test_another_plant_agrees(closed_loop, controller):
    assert_agree(closed_loop(SCENARIO, controller, drive="velocity"))

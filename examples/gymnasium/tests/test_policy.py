"""The environment keeps Gymnasium's rules, training is repeatable, and the policy keeps its limits."""

import shutil
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import train
from crane_env import EPISODE, FASTEST, SAMPLES, SCENARIO, GantryCrane, act, observe, rewards
from gymnasium.utils.env_checker import check_env

import cranectl

GAINS = np.array([[3.0, -0.5, 8.0, -0.3, -10.0, 1.5]])
REAL = ("sensing", "delay", "friction", "wind")  # effects of a real crane, with their assumed values


def test_gymnasium_finds_nothing_wrong():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make("GantryCrane-v0", plant="mujoco").unwrapped)


def play(crane, seed):
    """Return observations and rewards of an episode with GAINS."""
    seen, _ = crane.reset(seed=seed)
    observations, earned, over = [seen], [], False
    while not over:
        seen, reward, stopped, late, _ = crane.step(act(GAINS, seen[np.newaxis])[0])
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
    assert len(first[1]) == EPISODE / (SAMPLES * 1e-3)
    for observations, _ in (first, other):
        assert np.linalg.norm(observations[0, :3]) > 0.2
        assert np.linalg.norm(observations[-1, :3]) < 0.01


def test_many_cranes_earn_what_one_does():
    crane = GantryCrane()
    observations, earned = play(crane, 1)
    cranes = cranectl.open_runs([crane.scenario] * 2, plant="elastic", drive="velocity")
    target = np.tile(crane.target, (2, 1))
    start = crane.crane.recorded().block("state")[0]
    states = cranes.reset(np.tile(start, (2, 1)))
    for expected, reward in zip(observations, earned, strict=False):
        assert np.array_equal(observe(states, target), [expected] * 2)
        states = cranes.step(FASTEST * act(GAINS, observe(states, target)), SAMPLES)
        assert np.array_equal(rewards(states, target), [reward] * 2)


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    """Return a policy that was trained just now, as a controller."""
    folder = tmp_path_factory.mktemp("policy")
    shutil.copy(Path(train.__file__).with_name("learned.py"), folder)
    np.savetxt(folder / "policy.txt", train.train())
    return cranectl.open_controller(f"{folder / 'learned.py'}:LEARNED")


@pytest.mark.parametrize("plant", ["elastic", "mujoco"])
@pytest.mark.parametrize("effects", [(), REAL], ids=["nominal", "real"])
def test_a_trained_policy_keeps_the_limits(controller, plant, effects):
    """It was trained on `elastic`; MuJoCo and the effects of a real crane are new to it."""
    scenario = cranectl.load_scenario(SCENARIO, overrides=[f"effects.{name}={{}}" for name in effects])
    run = cranectl.simulate_run(scenario, plant=plant, drive="velocity", controller=controller)
    assert run.status == cranectl.RunStatus.COMPLETED
    metrics = cranectl.run_metrics(run)
    assert metrics.max_rest_error_m < 0.02
    assert metrics.residual_sway_rad < 0.02

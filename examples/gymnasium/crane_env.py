"""A gantry crane as a Gymnasium environment: bring the load to a point, and let it hang still."""

import functools
from pathlib import Path

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

import cranectl

SCENARIO = Path(__file__).parent / "scenarios" / "move.toml"
SAMPLES = 20  # control samples of 1 ms that an action lasts
FASTEST = np.array([0.5, 0.5, 0.3])  # set-points of bridge, trolley and rope [m/s] at an action of 1
AXES = ("bridge", "trolley", "winch")
SPREAD = np.log(2.0)  # load and lags are half to twice those of the scenario
STEPS = 400  # of an episode: 8 s
WIDEST = 100.0  # bound of all observations [m, m/s, rad, rad/s]
SWING_WEIGHT = 0.3  # [s] of the swing in the reward
OBSERVATIONS = gymnasium.spaces.Box(-WIDEST, WIDEST, (10,), np.float64)
ACTIONS = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float64)


@functools.lru_cache(maxsize=64)
def crane_with(scenario, load, lag):
    """Return the scenario with a load [kg], and drives that lag `lag` times as much."""
    rig = cranectl.load_scenario(scenario).rig
    lags = [f"rig.{axis}_time_constant={lag * rig.time_constants[k]:.6f}" for k, axis in enumerate(AXES)]
    return cranectl.load_scenario(scenario, overrides=[f"rig.load_mass={load}", *lags])


def draw_crane(random, scenario):
    """Draw a crane: nobody knows its load and its drives exactly."""
    return crane_with(scenario, *np.exp(random.uniform(-SPREAD, SPREAD, 2)).round(4).tolist())


def draw_target(random, scenario):
    """Draw a point (3,) [m] well inside the workspace, where the load shall come to rest."""
    low, high = scenario.rig.workspace.T
    bridge, trolley, rope = random.uniform(low + 0.2 * (high - low), high - 0.2 * (high - low))
    return np.array([bridge, trolley, -rope])


def observe(states, targets):
    """Return what the policy sees (n, 10), from states (n, 10) and targets (n, 3).

    It is the way from the load to its target [m], then velocities of the drives [m/s], angles [rad] and
    angular velocities [rad/s].
    """
    bridge, trolley, rope = states[:, 0], states[:, 2], states[:, 4]
    alpha, beta = states[:, 6], states[:, 8]
    load = np.stack(
        [
            bridge + rope * np.sin(beta),
            trolley + rope * np.cos(beta) * np.sin(alpha),
            -rope * np.cos(beta) * np.cos(alpha),
        ],
        axis=1,
    )
    return np.clip(np.hstack([targets - load, states[:, [1, 3, 5, 6, 8, 7, 9]]]), -WIDEST, WIDEST)


def act(gains, seen):
    """Return the actions (n, 3) of linear policies with gains (n, 6) for what they see (n, 10).

    Both horizontal axes have the same gains: for error, velocity, angle and angular velocity. The rope has
    two: for error and velocity.
    """
    actions = np.empty((len(seen), 3))
    for axis, columns in enumerate(([0, 3, 7, 9], [1, 4, 6, 8])):  # beta is the angle along x
        actions[:, axis] = np.sum(gains[:, :4] * seen[:, columns], axis=1)
    actions[:, 2] = np.sum(gains[:, 4:] * seen[:, [2, 5]], axis=1)
    return np.clip(actions, -1.0, 1.0)


def rewards(states, targets):
    """Return the rewards (n,): less for each metre to the target and for each metre a second of swing."""
    seen, rope = observe(states, targets), states[:, 4]
    distance, swing = np.linalg.norm(seen[:, :3], axis=1), rope * np.linalg.norm(seen[:, 8:], axis=1)
    return np.maximum(-distance - SWING_WEIGHT * swing, -WIDEST)


def costs_until_the_end(reward, steps):
    """Return what a crane earns that stops after `steps` with `reward`: it stands there until the end.

    A crane stops when it leaves its rig or its rope goes slack. Without this, a crash would pay.
    """
    return reward * (STEPS + 1 - steps)


class GantryCrane(gymnasium.Env):
    """One crane with velocity drives; an action (3,) from -1 to 1 is a share of the fastest set-points."""

    def __init__(self, scenario=SCENARIO, plant="elastic"):
        self.scenario, self.plant = scenario, plant
        self.observation_space, self.action_space = OBSERVATIONS, ACTIONS

    def reset(self, *, seed=None, options=None):  # noqa: ARG002
        super().reset(seed=seed)
        crane = draw_crane(self.np_random, self.scenario)
        self.crane = cranectl.open_run(crane, plant=self.plant, drive="velocity")
        target = draw_target(self.np_random, crane)
        self.crane.reset(seed=int(self.np_random.integers(2**31)), target=target)
        self.steps = 0
        return self._observe(), {}

    def step(self, action):
        self.crane.step(FASTEST * np.clip(action, -1.0, 1.0), SAMPLES)
        self.steps += 1
        reward = float(rewards(self.crane.state[np.newaxis], self.crane.reference[np.newaxis, :3])[0])
        if stopped := self.crane.status.stopped:
            reward = costs_until_the_end(reward, self.steps)
        information = {"status": self.crane.status.label}
        return self._observe(), reward, stopped, self.steps >= STEPS and not stopped, information

    def _observe(self):
        return observe(self.crane.state[np.newaxis], self.crane.reference[np.newaxis, :3])[0]


class GantryCranes(VectorEnv):
    """Many cranes in one compiled call, each as in GantryCrane."""

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(self, num_envs=1, scenario=SCENARIO, plant="elastic"):
        self.scenario, self.num_envs = scenario, num_envs
        cranes = [cranectl.load_scenario(scenario)] * num_envs
        self.cranes = cranectl.open_runs(cranes, plant=plant, drive="velocity")
        self.single_observation_space, self.single_action_space = OBSERVATIONS, ACTIONS
        self.observation_space = batch_space(OBSERVATIONS, num_envs)
        self.action_space = batch_space(ACTIONS, num_envs)
        self.steps = np.zeros(num_envs, dtype=int)

    def reset(self, *, seed=None, options=None):  # noqa: ARG002
        """Begin with all cranes; `seed` is one number, or one for each crane."""
        seeds = seed if isinstance(seed, list) else np.random.SeedSequence(seed).spawn(self.num_envs)
        self.random = [np.random.default_rng(own) for own in seeds]
        return self._begin(range(self.num_envs)), {}

    def step(self, actions):
        states = self.cranes.step(FASTEST * np.clip(actions, -1.0, 1.0), SAMPLES)
        targets = self.cranes.references[:, :3]
        self.steps += 1
        reward, seen = rewards(states, targets), observe(states, targets)
        stopped = np.array([status.stopped for status in self.cranes.statuses])
        reward = np.where(stopped, costs_until_the_end(reward, self.steps), reward)
        over = ~stopped & (self.steps >= STEPS)
        information, ended = {}, stopped | over
        if ended.any():
            information = {"final_obs": seen, "_final_obs": ended}
            seen = self._begin(np.flatnonzero(ended))
        return seen, reward, stopped, over, information

    def _begin(self, chosen):
        """Begin again with the `chosen` cranes, each with its own load and drives; return what all see."""
        cranes = [draw_crane(self.random[i], self.scenario) for i in chosen]
        targets = [draw_target(self.random[i], crane) for i, crane in zip(chosen, cranes, strict=True)]
        seeds = [int(self.random[i].integers(2**31)) for i in chosen]
        states = self.cranes.reset(seeds=seeds, targets=targets, cranes=chosen, scenarios=cranes)
        self.steps[chosen] = 0
        return observe(states, self.cranes.references[:, :3])


gymnasium.register("GantryCrane-v0", entry_point=GantryCrane, vector_entry_point=GantryCranes)

"""A gantry crane as a Gymnasium environment: bring the load to a point, and let it hang still."""

from pathlib import Path

import gymnasium
import numpy as np

import cranectl

SCENARIO = Path(__file__).parent / "scenarios" / "move.toml"
SAMPLES = 20  # control samples of 1 ms that an action lasts
FASTEST = np.array([0.5, 0.5, 0.3])  # set-points of bridge, trolley and rope [m/s] at an action of 1
EPISODE = 8.0  # [s]
WIDEST = 100.0  # bound of all observations [m, m/s, rad, rad/s]
SWING_WEIGHT = 0.3  # [s] of the swing in the reward


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
    return np.hstack([targets - load, states[:, [1, 3, 5, 6, 8, 7, 9]]])


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
    return -distance - SWING_WEIGHT * swing


class GantryCrane(gymnasium.Env):
    """One crane with velocity drives; an action (3,) from -1 to 1 is a share of the fastest set-points."""

    def __init__(self, scenario=SCENARIO, plant="elastic"):
        self.scenario = cranectl.load_scenario(scenario)
        self.crane = cranectl.open_run(self.scenario, plant=plant, drive="velocity")
        self.observation_space = gymnasium.spaces.Box(-WIDEST, WIDEST, (10,), np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float64)

    def reset(self, *, seed=None, options=None):  # noqa: ARG002
        super().reset(seed=seed)
        self.target = draw_target(self.np_random, self.scenario)
        self.crane.reset(seed=int(self.np_random.integers(2**31)))
        return self._observe(), {}

    def step(self, action):
        self.crane.step(FASTEST * np.clip(action, -1.0, 1.0), SAMPLES)
        reward = rewards(self.crane.state[np.newaxis], self.target[np.newaxis])
        stopped, over = self.crane.status.stopped, self.crane.time >= EPISODE
        return self._observe(), float(reward[0]), stopped, over, {"status": self.crane.status.label}

    def _observe(self):
        return observe(self.crane.state[np.newaxis], self.target[np.newaxis])[0]


gymnasium.register("GantryCrane-v0", entry_point=GantryCrane)

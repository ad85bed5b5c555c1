"""Train a linear policy with NumPy in less than a minute, on many cranes at once.

The cross-entropy method draws policies in each generation, lets all of them move the same random cranes to
the same targets, and keeps the best (Rubinstein and Kroese: The Cross-Entropy Method, 2004). Linear policies
suffice for tasks like this one (Mania, Guy, Recht: Simple random search provides a competitive approach to
reinforcement learning, 2018).
"""

from pathlib import Path

import numpy as np
from crane_env import STEPS, GantryCranes, act

POLICY = Path(__file__).with_name("policy.txt")
CRANES, BEST, GENERATIONS, EPISODES = 32, 6, 12, 2
FIRST_DEVIATION = 3.0  # of the gains in the first generation


def episode(cranes, gains, seed):
    """Return the sum of rewards (n,) of each policy over an episode, all with the same start and target."""
    seen, _ = cranes.reset(seed=[seed] * cranes.num_envs)
    total, running = np.zeros(cranes.num_envs), np.full(cranes.num_envs, True)
    for _ in range(STEPS):
        seen, reward, stopped, _, _ = cranes.step(act(gains, seen))
        total += reward * running
        running &= ~stopped
    return total


def train(seed=0):
    """Return the gains (6,) of the policy."""
    random, cranes = np.random.default_rng(seed), GantryCranes(CRANES)
    mean, deviation = np.zeros(6), np.full(6, FIRST_DEVIATION)
    for generation in range(GENERATIONS):
        gains = mean + deviation * random.standard_normal((CRANES, 6))
        total = sum(episode(cranes, gains, int(random.integers(2**31))) for _ in range(EPISODES))
        best = gains[np.argsort(total)[-BEST:]]
        mean, deviation = best.mean(axis=0), best.std(axis=0) + 0.5 * 0.8**generation
        print(f"generation {generation + 1}: gains {mean.round(1)}, which vary by {deviation.max():.2f}")
    return mean


if __name__ == "__main__":
    np.savetxt(POLICY, train(), fmt="%.4f")
    print(f"wrote {POLICY.name}")

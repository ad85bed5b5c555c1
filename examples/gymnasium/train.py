"""Train a linear policy with NumPy in less than a minute, on many cranes at once.

The cross-entropy method draws policies in each generation, lets all of them move a crane to the same random
targets, and keeps the best (Rubinstein and Kroese: The Cross-Entropy Method, 2004). Linear policies suffice
for tasks like this one (Mania, Guy, Recht: Simple random search provides a competitive approach to
reinforcement learning, 2018).
"""

from pathlib import Path

import numpy as np
from crane_env import EPISODE, FASTEST, SAMPLES, SCENARIO, act, draw_target, observe, rewards

import cranectl

POLICY = Path(__file__).with_name("policy.txt")
CRANES, BEST, GENERATIONS, TARGETS = 32, 6, 12, 2
FIRST_DEVIATION = 3.0  # of the gains in the first generation


def episode(cranes, gains, random):
    """Return the sum of rewards (n,) of each policy over an episode, all from one start to one target."""
    count = len(cranes)
    targets = np.tile(draw_target(random, cranes.scenarios[0]), (count, 1))
    states, total = cranes.reset(seeds=[int(random.integers(2**31))] * count), np.zeros(count)
    while cranes.time.max() < EPISODE:
        states = cranes.step(FASTEST * act(gains, observe(states, targets)), SAMPLES)
        total += rewards(states, targets)
    return total


def train(generations=GENERATIONS, seed=0):
    """Return the gains (6,) of the policy."""
    random = np.random.default_rng(seed)
    scenario = cranectl.load_scenario(SCENARIO)
    cranes = cranectl.open_runs([scenario] * CRANES, plant="elastic", drive="velocity")
    mean, deviation = np.zeros(6), np.full(6, FIRST_DEVIATION)
    for generation in range(generations):
        gains = mean + deviation * random.standard_normal((CRANES, 6))
        total = sum(episode(cranes, gains, random) for _ in range(TARGETS))
        best = gains[np.argsort(total)[-BEST:]]
        mean, deviation = best.mean(axis=0), best.std(axis=0) + 0.5 * 0.8**generation
        print(f"generation {generation + 1}: gains {mean.round(1)}, which vary by {deviation.max():.2f}")
    return mean


if __name__ == "__main__":
    np.savetxt(POLICY, train(), fmt="%.4f")
    print(f"wrote {POLICY.name}")

"""Compute energies of recorded runs from the model's matrices, which the controllers do not use."""

import numpy as np

from cranectl.model.dynamics import kinetic_energy, load_jacobian, potential_energy
from cranectl.simulate import Run
from tests.conftest import split


def energy_above_rest(run: Run, rates: np.ndarray) -> np.ndarray:
    """Return kinetic energy of `rates` (N, 5) plus potential energy above that of a plumb rope [J], (N,)."""
    rig = run.scenario.rig
    positions = run.block("state")[:, 0::2]
    kinetic = [kinetic_energy(q, v, rig) for q, v in zip(positions, rates, strict=True)]
    return np.array(kinetic) + [potential_energy(q, rig) + rig.weight * q[2] for q in positions]


def rope_directions(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return the direction of the rope and its rate [1/s], (N, 3) each."""
    pairs = [split(state) for state in run.block("state")]
    n = [load_jacobian(q)[:, 2] for q, _ in pairs]
    n_rate = [load_jacobian(q)[:, 3:] @ v[3:] / q[2] for q, v in pairs]
    return np.array(n), np.array(n_rate)


def integral(run: Run, power: np.ndarray) -> np.ndarray:
    """Return the integral [J] of `power` (N,) from the start to each sample, (N,)."""
    steps = 0.5 * np.diff(run.time) * (power[1:] + power[:-1])
    return np.concatenate([[0.0], np.cumsum(steps)])

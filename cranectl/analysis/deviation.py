"""How far the load of one run is from that of another."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.simulate import Run

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Size:
    """Of a deviation of the load position over a run: Euclidean norm over the axes [m]."""

    rms: float
    max: float
    final: float


def size_of(load: Array) -> Size:
    """Of deviations (N, 3); zero if there are none."""
    if not len(load):
        return Size(0.0, 0.0, 0.0)
    with np.errstate(over="ignore"):  # of predictions that run away
        norm = np.linalg.norm(load, axis=1)
    return Size(float(np.sqrt(np.mean(norm**2))), float(norm.max()), float(norm[-1]))


def load_difference(run: Run, before: Run) -> Array:
    """Load of `run` less that of `before`, over the samples that both have, (n, 3) [m]."""
    common = min(len(run.time_ns), len(before.time_ns))
    difference: Array = run.load_position[:common] - before.load_position[:common]
    return difference


def deviation(run: Run, before: Run) -> Size | None:
    """Of the load of `run` from that of `before`; None if they have no sample in common."""
    difference = load_difference(run, before)
    return size_of(difference) if len(difference) else None

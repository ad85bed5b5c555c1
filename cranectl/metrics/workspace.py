"""Where a run leaves the ranges of bridge, trolley and rope."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.simulate import Run

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WorkspaceViolation:
    """Where, how far and for how long a run left the workspace."""

    signal: str
    first_time_s: float
    max_excess_m: float
    time_outside_s: float  # of all its excursions together


def workspace_excess(run: Run) -> Array:
    """How far bridge, trolley and rope are outside their ranges [m], shape (N, 3), 0 inside."""
    positions = run.block("state")[:, [0, 2, 4]]
    low, high = run.scenario.rig.workspace.T
    excess: Array = np.maximum(np.maximum(low - positions, positions - high), 0.0)
    return excess

"""Limits of the set-points that velocity drives take: largest velocity, largest change in a period."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.effects.settings import DriveLimits
from cranectl.jit import jit

Array = NDArray[np.float64]


class SetpointLimits(NamedTuple):
    """Of bridge, trolley, winch."""

    velocity: Array  # (3,) [m/s]
    change: Array  # (3,) within a control period [m/s]


def make_limits(limits: DriveLimits | None, period: float) -> SetpointLimits:
    """The limits of drives that are sampled with `period` [s]; none at all for None."""
    if limits is None:
        return SetpointLimits(np.full(3, np.inf), np.full(3, np.inf))
    return SetpointLimits(np.array(limits.velocity), period * np.array(limits.acceleration))


@jit
def limited(limits, axis, setpoint, previous):
    """The set-point nearest to `setpoint` that the drive may be given after `previous` [m/s]."""
    change = limits.change[axis]
    reachable = min(max(setpoint, previous - change), previous + change)
    return min(max(reachable, -limits.velocity[axis]), limits.velocity[axis])

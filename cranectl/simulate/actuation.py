"""From what a law commands to what drives take: set-points that lead, and rest while the rope is slack.

The same for every law, so that all of them get the same lead and the same handling of limits.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.support.jit import jit

Array = NDArray[np.float64]

BRAKING = 0.1  # [s], time constant with which the drives come to rest while the rope is slack; assumed


class Actuation(NamedTuple):
    """What the loop does between a law and the drives of bridge, trolley, winch."""

    lag: Array  # (3,) [s], cancelled in the velocity set-points
    time_constant: Array  # (3,) [s], of the drives
    period: float  # [s]
    velocity: Array  # (3,) integral of the commanded accelerations [m/s], the set-points without lead


def make_actuation(nominal: Scenario, start: Array) -> Actuation:
    """For a run that starts at `start` (10,) under a controller that takes the crane for `nominal`."""
    return Actuation(
        lag=nominal.rig.time_constants * nominal.control.lag_compensation,
        time_constant=nominal.rig.time_constants,
        period=nominal.period_ns / NANOSECONDS,
        velocity=start[1:6:2].copy(),
    )


@jit
def actuate(actuation, command):
    """Write the set-points [m/s] that belong to the accelerations `command[:3]` into `command[3:]`."""
    for i in range(3):
        command[3 + i] = actuation.velocity[i] + actuation.lag[i] * command[i]
        actuation.velocity[i] += actuation.period * command[i]


@jit
def take_set_points(actuation, state, command):
    """`command[:3]` are set-points: put them into `command[3:]` and, before, what drives make of them."""
    for i in range(3):
        command[3 + i] = command[i]
        command[i] = (command[3 + i] - state[2 * i + 1]) / actuation.time_constant[i]
        actuation.velocity[i] = command[3 + i]


@jit
def brake(actuation, command):
    """Command accelerations that bring the drives to rest: no law holds while the rope is slack."""
    for i in range(3):
        command[i] = -actuation.velocity[i] / BRAKING

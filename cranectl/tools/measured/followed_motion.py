"""Follow the measured motion of bridge, trolley and rope.

This controller is not registered. `PreparedController.repeating` prepares it with the rows that it follows,
in place of a reference.
"""

import numpy as np

from cranectl.controllers import Controller
from cranectl.support import Array

LOOP_SPEED = 0.1  # of the loop that keeps the axes on their measured motion, times the control period


def follow_motion(
    parameters: Array,
    measured: Array,
    reference: Array,
    memory: Array,  # noqa: ARG001
    command: Array,
) -> int:
    """Compute accelerations that keep the axes on the positions, rates and accelerations of each row."""
    w = parameters[0]
    for axis in range(3):
        command[axis] = (
            reference[6 + axis]
            + 2.0 * w * (reference[3 + axis] - measured[2 * axis + 1])
            + w * w * (reference[axis] - measured[2 * axis])
        )
    return 0


MEASURED_MOTION = Controller(
    name="measured-motion",
    title="the measured motion of bridge, trolley and rope",
    step=follow_motion,
    prepare=lambda nominal: (np.array([LOOP_SPEED / nominal.period]), np.zeros(1)),
    command="acceleration",
)

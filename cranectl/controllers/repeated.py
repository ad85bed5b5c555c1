"""Repeat rows of numbers: commands, or the measured motion of bridge, trolley and rope.

These controllers are not registered. `simulate.Loop.repeating` prepares them with the rows that they
repeat, in place of a reference.
"""

import functools

import numpy as np

from cranectl.controllers.controller import Command, Controller

LOOP_SPEED = 0.1  # of the loop that keeps the axes on their measured motion, times the control period


def repeat_commands(parameters, measured, reference, memory, command):  # noqa: ARG001
    """Copy the commands, the first three numbers of each row."""
    for axis in range(3):
        command[axis] = reference[axis]
    return 0


def follow_motion(parameters, measured, reference, memory, command):  # noqa: ARG001
    """Compute accelerations that keep the axes on the positions, rates and accelerations of each row."""
    w = parameters[0]
    for axis in range(3):
        command[axis] = (
            reference[6 + axis]
            + 2.0 * w * (reference[3 + axis] - measured[2 * axis + 1])
            + w * w * (reference[axis] - measured[2 * axis])
        )
    return 0


@functools.cache
def repeated_commands(kind: Command, name: str = "measured-commands") -> Controller:
    """Return the controller that repeats commands of this kind."""
    return Controller(
        name=name,
        title="commands that are repeated",
        step=repeat_commands,
        prepare=lambda _: (np.zeros(1), np.zeros(1)),
        command=kind,
    )


MEASURED_MOTION = Controller(
    name="measured-motion",
    title="the measured motion of bridge, trolley and rope",
    step=follow_motion,
    prepare=lambda nominal: (np.array([LOOP_SPEED / nominal.period]), np.zeros(1)),
    command="acceleration",
)

"""Repeat rows of commands.

These controllers are not registered. `simulate.PreparedController.repeating` prepares them with the rows
that they repeat, in place of a reference.
"""

import functools

import numpy as np

from cranectl.controllers.controller import Command, Controller


def repeat_commands(parameters, measured, reference, memory, command):  # noqa: ARG001
    """Copy the commands, the first three numbers of each row."""
    for axis in range(3):
        command[axis] = reference[axis]
    return 0


@functools.cache
def repeated_commands(kind: Command, name: str) -> Controller:
    """Return the controller that repeats commands of this kind."""
    return Controller(
        name=name,
        title="commands that are repeated",
        step=repeat_commands,
        prepare=lambda _: (np.zeros(1), np.zeros(1)),
        command=kind,
    )

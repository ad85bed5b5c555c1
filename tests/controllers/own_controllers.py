"""Small controllers for tests, with compiled steps."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from cranectl.controllers.controller import Controller, Logged, Nominal, Parameter
from cranectl.controllers.registry import OPEN, register_controller
from cranectl.signals import Signal

INPUTS = 12 + 3 * 15 + 1  # measured, three rows of the reference, steps so far


def note_all(parameters, measured, reference, memory, command):  # type: ignore[no-untyped-def]
    """Copy all arguments into the memory; command the accelerations in the parameters."""
    for i in range(12):
        memory[i] = measured[i]
    for i in range(45):
        memory[12 + i] = reference[i]
    memory[57] += 1.0
    for i in range(3):
        command[i] = parameters[i]
    return 0


def give_up(parameters, _measured, _reference, memory, command):  # type: ignore[no-untyped-def]
    """Go on for ten steps, then return a status or command NaN."""
    memory[0] += 1.0
    for i in range(3):
        command[i] = 0.0
    if memory[0] <= 10.0:
        return 0
    command[1] = parameters[1]
    return int(parameters[0])


def follow_blindly(parameters, _measured, reference, _memory, command):  # type: ignore[no-untyped-def]
    """Command the velocities of the path, without any feedback."""
    for i in range(3):
        command[i] = parameters[i] * reference[3 + i]
    return 0


def _numbers(nominal: Nominal) -> tuple[np.ndarray, np.ndarray]:
    return np.array([float(value) for value in nominal.parameters.values()]), np.zeros(INPUTS)


def noting(**declared: object) -> Controller:
    """Return a controller that logs all arguments of its step."""
    return Controller(
        name="noting",
        title="for tests",
        step=note_all,
        prepare=_numbers,
        preview=2,
        parameters=tuple(Parameter(f"u_{axis}", 0.0, "m/s²", "commanded") for axis in "xyl"),
        logged=tuple(Logged(k, Signal(f"given_{k}", f"g{k}", "1", "given")) for k in range(INPUTS)),
        **declared,  # type: ignore[arg-type]
    )


def giving_up(code: float, acceleration: float = 0.0) -> Controller:
    """Return a controller that fails at its eleventh step."""
    numbers = np.array([code, acceleration]), np.zeros(1)
    return Controller(name="giving-up", title="for tests", step=give_up, prepare=lambda _: numbers)


FOLLOWING = Controller(
    name="following",
    title="for tests",
    step=follow_blindly,
    prepare=lambda _: (np.array([1.0, 1.0, -1.0]), np.zeros(0)),
    command="velocity",
)

PUSHING = replace(FOLLOWING, name="pushing", command="force")


@contextmanager
def known(controller: Controller) -> Iterator[str]:
    """Register a controller within a `with` block."""
    register_controller(controller)
    try:
        yield controller.name
    finally:
        del OPEN.registered[controller.name]

"""Prepare a controller for a crane, and check what its own code returns."""

import traceback
from collections.abc import Callable
from typing import Any

import numpy as np

from cranectl.controllers.controller import MAX_MEMORY, Controller, LinearController, Nominal
from cranectl.scenario import nanoseconds
from cranectl.support import Array, ForeignCode, InputError

LINEAR = "a linearise(nominal, rope_length) that returns a cranectl.controllers.controller.LinearController"
PAIR = "a prepare(nominal) that returns (parameters, memory), two arrays of at most a million numbers"


def prepared(controller: Controller, nominal: Nominal) -> tuple[Array, Array]:
    """Return parameters and memory, each with at least one number, so that pointers to them are valid.

    Raises InputError as the controller's `prepare` does, if that fails or returns no such pair, if the
    controller was made for another period, and if it logs an index that its memory does not have.
    """
    if controller.period is not None:
        _check_period(controller, controller.period, nominal.period)
    returned = _run_own_code(controller, "prepare", controller.prepare, PAIR, nominal)
    problem = f"prepare of {controller.name} returns "
    if not isinstance(returned, tuple | list) or len(returned) != 2:
        raise InputError(
            problem + InputError.shown(returned), allowed=PAIR, remedy="return both, an empty one too"
        )
    try:
        parameters, memory = map(real_numbers, returned)
    except (TypeError, ValueError, MemoryError) as error:
        raise InputError(
            f"{problem}{InputError.shown(returned)}: {error}",
            allowed=PAIR,
            remedy=f"return real numbers, at most {MAX_MEMORY} in each",
        ) from error
    for place, signal in controller.logged:
        if place >= len(memory):
            raise InputError(
                f"{controller.name} logs place {place} of its memory as '{signal.name}'",
                allowed=f"0 to {len(memory) - 1}: its memory has {len(memory)} numbers",
                remedy="log another place, or give it a larger memory",
            )
    return parameters, memory


def linearised(controller: Controller, nominal: Nominal, rope_length: float) -> LinearController:
    """Return the linear controller of one axis at a rope length [m]; raise InputError if it has none."""
    assert controller.linearise is not None
    returned = _run_own_code(controller, "linearise", controller.linearise, LINEAR, nominal, rope_length)
    if not isinstance(returned, LinearController):
        raise InputError(
            f"linearise of {controller.name} returns {InputError.shown(returned)}",
            allowed=LINEAR,
            remedy="return one",
        )
    return returned


def real_numbers(values: Any) -> Array:
    """Return a flat copy, or one zero for no `values`; raise TypeError, ValueError or MemoryError."""
    array = np.asarray(values)
    if array.size and array.dtype.kind not in "biuf":
        raise TypeError(f"{array.dtype} is no type of real numbers")
    if array.size > MAX_MEMORY:
        raise ValueError(f"{array.size} numbers")
    return array.astype(np.float64).ravel() if array.size else np.zeros(1)


def _check_period(controller: Controller, made_for: float, given: float) -> None:
    """Raise InputError unless the times [s] between two steps give the same control period."""
    control, every = made_for / controller.every, controller.every
    if nanoseconds(control) == nanoseconds(given / every):
        return
    divided = f", of which it takes every {every}th" if every > 1 else ""
    raise InputError(
        f"{controller.name} was made for steps of {round(made_for, 9):g} s, "
        f"this run gives it steps of {round(given, 9):g} s",
        allowed=f"control.period = {round(control, 9)!r}{divided}",
        remedy=f"add --set control.period={round(control, 9)!r} to the command, or set it in the scenario",
    )


def _run_own_code(
    controller: Controller, name: str, function: Callable[..., Any], allowed: str, *arguments: Any
) -> Any:
    """Return what a function returns; turn exceptions of code that is not ours into InputError."""
    if str(getattr(function, "__module__", "")).partition(".")[0] == __name__.partition(".")[0]:
        return function(*arguments)
    try:
        with ForeignCode.contained(f"{name} of {controller.name} has been running"):
            return function(*arguments)
    except (InputError, KeyboardInterrupt):
        raise
    except BaseException as error:  # also SystemExit, which `contained` makes of `os._exit`
        raise InputError(
            f"{name} of {controller.name} failed{_where(error)}: {InputError.describe(error)}",
            allowed=f"{allowed}, or raises cranectl.InputError with what the controller cannot do",
            remedy="correct it; in a class it has no self",
        ) from error


def _where(error: BaseException) -> str:
    """Return the last line in the traceback that is in no installed library, as ' in FILE:LINE'."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)[1:]  # the first is `_run_own_code`
        if "site-packages" not in frame.filename
    ]
    return f" in {frames[-1].filename.rpartition('/')[2]}:{frames[-1].lineno}" if frames else ""

"""Former names of arguments, which still work and warn until version 1.0 removes them."""

import functools
import warnings
from collections.abc import Callable
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
Result = TypeVar("Result")


def renamed_arguments(**names: str) -> Callable[[Callable[P, Result]], Callable[P, Result]]:
    """Let callers of a function use former names of keyword arguments: `former="present"`."""

    def decorate(function: Callable[P, Result]) -> Callable[P, Result]:
        @functools.wraps(function)
        def call(*args: P.args, **arguments: P.kwargs) -> Result:
            for former, present in names.items():
                if former not in arguments:
                    continue
                message = f"the argument {former} of {function.__name__} is now {present}"
                warnings.warn(message, DeprecationWarning, stacklevel=2)
                arguments.setdefault(present, arguments.pop(former))
            return function(*args, **arguments)

        return call

    return decorate

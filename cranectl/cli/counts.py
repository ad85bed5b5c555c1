"""Options for whole numbers, with bounds that help and message tell."""

import os
from collections.abc import Callable
from typing import Any, TypeVar

import click

from cranectl.support import MAX_RUNS, InputError, printable

F = TypeVar("F", bound=Callable[..., Any])


class Count(click.IntRange):
    """The type of an option for a whole number, with a lowest and a highest value that the help tells."""

    MAX_WORKERS = 1024  # threads or processes
    MAX_REPLAYS = 1000  # logs of a campaign's worst runs
    MAX_SEED = 2**63 - 1
    MAX_PORT = 2**16 - 1

    def __init__(self, highest: int, *, lowest: int = 1) -> None:
        super().__init__(lowest, highest)
        self.lowest, self.highest = lowest, highest

    def convert(self, value: Any, parameter: Any, context: click.Context | None) -> int:
        """Return the number; raise InputError if it is out of the range."""
        number: int = click.INT.convert(value, parameter, context)
        if self.lowest <= number <= self.highest or (context is not None and context.resilient_parsing):
            return number
        option = parameter.opts[0]
        raise InputError(
            f"{option} {printable(str(number), longest=40)}",
            allowed=f"a whole number from {self.lowest} to {self.highest}",
            remedy=f"choose such a number, or leave {option} out",
        )

    @staticmethod
    def available_cores() -> int:
        """Return the number of cores that this process may use."""
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

    @staticmethod
    def option(name: str, help_text: str, *, highest: int = MAX_RUNS) -> Callable[[F], F]:
        """Return an option for a number from 1 to `highest`."""
        return click.option(name, metavar="N", type=Count(highest), help=help_text)

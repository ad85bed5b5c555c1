"""How slow this machine is just now, and when something hangs, for tests that bound times."""

import time
import tomllib
from collections.abc import Callable

READ = "x = [" + "1.5," * 50_000 + "]"  # work of the processor and of memory
HANG = 600.0  # [s] after which a test says that something hangs; it decides nothing else
USUAL = 0.07  # [s] of the processor for this where the bounds were set


def slowness(clock: Callable[[], float] = time.process_time) -> float:
    """Times longer than usual that Python takes for the same, the worst of three; 1 on faster machines.

    By the processor's time; by another `clock` it also counts what else keeps the machine busy.
    """

    def spent() -> float:
        start = clock()
        tomllib.loads(READ)
        return clock() - start

    return max(1.0, *(spent() / USUAL for _ in range(3)))


def within(spent: float, bound: float) -> bool:
    """Whether `spent` [s] of the processor are less than `bound`, as the machine is now."""
    return spent < bound or spent < bound * slowness()

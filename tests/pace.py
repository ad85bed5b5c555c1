"""Time limits of tests: measure how slow this machine is at the moment, and define when something hangs."""

import time
import tomllib
from collections.abc import Callable

WORKLOAD = "x = [" + "1.5," * 50_000 + "]"  # a TOML text whose parsing needs processor and memory
HANG = 600.0  # [s] after which a test reports that something hangs
REFERENCE_TIME = 0.07  # [s] of processor time for the workload, on the machine on which limits were set


def slowness(clock: Callable[[], float] = time.process_time) -> float:
    """Return the factor by which this machine is slower than the reference, but at least 1.

    It is the worst of three measurements of processor time. A `clock` of wall-clock time also counts the
    load by other processes.
    """

    def measure() -> float:
        start = clock()
        tomllib.loads(WORKLOAD)
        return clock() - start

    return max(1.0, *(measure() / REFERENCE_TIME for _ in range(3)))


def within(seconds: float, limit: float) -> bool:
    """Return True if a processor time is below a limit, which is scaled by the slowness of the machine."""
    return seconds < limit or seconds < limit * slowness()

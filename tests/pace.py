"""How slow this machine is just now, where a test bounds the time that something takes."""

import time

ADDITIONS = 1_000_000
USUAL = 0.035  # [s] of the processor for these where the bounds were set


def slowness() -> float:
    """Times longer than usual that Python takes for the same, 1 on faster machines."""
    start, total = time.process_time(), 0
    for k in range(ADDITIONS):
        total += k
    return max(1.0, (time.process_time() - start) / USUAL)


def within(spent: float, bound: float) -> bool:
    """Whether `spent` [s] of the processor are less than `bound`, as the machine is now."""
    return spent < bound or spent < bound * slowness()

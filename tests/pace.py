"""How slow this machine is just now, where a test bounds the time that something takes."""

import time
import tomllib

READ = "x = [" + "1.5," * 50_000 + "]"  # work of the processor and of memory
USUAL = 0.07  # [s] of the processor for this where the bounds were set


def slowness() -> float:
    """Times longer than usual that Python takes for the same, the worst of three; 1 on faster machines."""

    def spent() -> float:
        start = time.process_time()
        tomllib.loads(READ)
        return time.process_time() - start

    return max(1.0, *(spent() / USUAL for _ in range(3)))


def within(spent: float, bound: float) -> bool:
    """Whether `spent` [s] of the processor are less than `bound`, as the machine is now."""
    return spent < bound or spent < bound * slowness()

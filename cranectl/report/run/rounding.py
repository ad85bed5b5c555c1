"""Curves that only rounding moves, which would fill an axis with nothing."""

from cranectl.support.arrays import Array

# The least span of a curve, by unit, that is more than rounding, which moves loads at rest by 1e-12 m, inputs
# by 2e-12 m/s² and 4e-11 m/s⁴; what tells plants apart begins at 1e-9 m.
LEAST_SPAN = {"m": 1e-11, "°": 1e-9, "m/s²": 1e-11, "m/s⁴": 1e-10}


def constant_axis(interval: Array, unit: str) -> tuple[float, float] | None:
    """The axis of values within `interval`, shape (2,), if they are constant but for rounding; else None."""
    (low, high), least = interval, LEAST_SPAN[unit]
    if not 0.0 <= high - low < least:
        return None
    middle = 0.0 if abs(high) < least else high
    half = 0.05 * (abs(middle) or 1.0)  # as matplotlib has it of a constant
    return middle - half, middle + half

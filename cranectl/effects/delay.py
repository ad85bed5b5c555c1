"""Transport: commands reach the drives a whole number of samples late."""

import numpy as np
from numpy.typing import NDArray

from cranectl.effects.settings import Delay
from cranectl.jit import jit

Array = NDArray[np.float64]


def make_line(delay: Delay | None, period: float, first: Array) -> Array:
    """Commands under way, shape (samples of delay, 3), each `first` (3,) as long as none has arrived."""
    samples = round(delay.seconds / period) if delay else 0
    return np.tile(first, (samples, 1))


@jit
def transport(line, sample, command):
    """Put `command` (3,) on the line and replace it by the one that arrives at `sample`."""
    length = line.shape[0]
    if length == 0:
        return
    place = sample % length
    for axis in range(3):
        line[place, axis], command[axis] = command[axis], line[place, axis]

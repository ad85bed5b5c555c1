"""Encoders: positions in whole steps, with noise. Velocities are for `cranectl.observer` to find."""

from math import floor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.effects.settings import Sensing
from cranectl.jit import jit

Array = NDArray[np.float64]


class Encoders(NamedTuple):
    """Of bridge, trolley, rope, alpha, beta; noise is drawn before the run, so the same on any plant."""

    resolution: Array  # (5,) [m, m, m, rad, rad]; 0: as fine as a number
    noise: Array  # (N, 5), repeated after N samples


def make_encoders(sensing: Sensing, samples: int) -> Encoders:
    """Encoders for a run of `samples`; white noise from the setting's seed."""
    deviation = np.array([*sensing.position_noise, sensing.angle_noise, sensing.angle_noise])
    resolution = np.array([*sensing.position_resolution, sensing.angle_resolution, sensing.angle_resolution])
    white = np.random.default_rng(sensing.seed).standard_normal((samples, 5))
    return Encoders(resolution, deviation * white)


@jit
def read_encoder(encoders, sample, joint, position):
    """What the encoder of `joint` says of `position`: noise first, then the nearest step."""
    value = position + encoders.noise[sample % encoders.noise.shape[0], joint]
    step = encoders.resolution[joint]
    return step * floor(value / step + 0.5) if step > 0.0 else value

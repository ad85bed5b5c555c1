"""Wind: the air's velocity over a run, and what of it acts on the load."""

import numpy as np
from numpy.typing import NDArray

from cranectl.effects.settings import EffectSettings, Wind

Array = NDArray[np.float64]


def air_drag(effects: EffectSettings) -> float:
    """Drag on the load over the square of its speed through the air, rho c A / 2 [kg/m]."""
    wind = effects.wind
    return 0.5 * wind.density * wind.drag_area if wind else 0.0


def air_velocity(wind: Wind | None, samples: int, period: float) -> Array:
    """Velocity of the air (x, y, z) [m/s] at every sample, shape (samples, 3).

    Horizontal gusts are white noise through 1/(1 + T s), exactly sampled and stationary from the start, the
    first-order form of Dryden's spectrum (MIL-F-8785C); the same seed gives the same wind.
    """
    if wind is None:
        return np.zeros((samples, 3))
    from scipy.signal import lfilter

    decay = np.exp(-period / wind.gust_time)
    white = np.random.default_rng(wind.seed).standard_normal((samples, 2))
    white[1:] *= np.sqrt(1.0 - decay**2)
    gusts = wind.gust * lfilter([1.0], [1.0, -decay], white, axis=0)
    velocity: Array = np.array(wind.mean) + np.column_stack([gusts, np.zeros(samples)])
    return velocity

"""The surroundings of a rig: wind, drag of the air, and gravity on sloping rails."""

from math import sin, sqrt

import numpy as np

from cranectl.scenario import EffectSettings
from cranectl.support import Array

FORCE = 3  # first column of the force on the load in `wind`, after the velocity of the air
STICTION_RATE = 0.01  # [rad/s]; below it a model without a constraint solver smooths Coulomb's friction


def gravity_in_rig(gravity: float, effects: EffectSettings) -> tuple[float, float, float]:
    """Return the acceleration of gravity along x, y, z of a rig whose rails slope as in `effects` [m/s²]."""
    if effects.installation is None:
        return 0.0, 0.0, -gravity
    along_x, along_y = (-sin(slope) for slope in effects.installation.tilt)
    return gravity * along_x, gravity * along_y, -gravity * sqrt(1.0 - along_x**2 - along_y**2)


def air_drag(effects: EffectSettings) -> float:
    """Return the drag on the load over the square of its speed through the air, rho c A / 2 [kg/m]."""
    wind = effects.wind
    return 0.5 * wind.density * wind.drag_area if wind else 0.0


def air_velocity(effects: EffectSettings, samples: int, period: float) -> Array:
    """Return the velocity of the air (x, y, z) at every sample [m/s], shape (samples, 3).

    Horizontal gusts are white noise filtered by 1/(1 + T s), the first-order form of Dryden's spectrum
    (MIL-F-8785C). They are sampled exactly and stationary from the start. Equal seeds give equal wind.
    """
    wind = effects.wind
    if wind is None:
        return np.zeros((samples, 3))
    from scipy.signal import lfilter

    decay = np.exp(-period / wind.gust_time)
    white = np.random.default_rng(wind.seed).standard_normal((samples, 2))
    white[1:] *= np.sqrt(1.0 - decay**2)
    gusts = wind.gust * lfilter([1.0], [1.0, -decay], white, axis=0)
    velocity: Array = np.array(wind.mean) + np.column_stack([gusts, np.zeros(samples)])
    return velocity

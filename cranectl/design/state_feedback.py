"""Static state feedback for the integrator chain z'''' = v (thesis 4.2)."""

from math import sqrt

import control
import numpy as np
from scipy.optimize import brentq

from cranectl.design.records import CHAIN_A, CHAIN_B
from cranectl.scenario import DesignSettings
from cranectl.support import Array


def pole_placement_gain(settings: DesignSettings) -> Array:
    """Return the gain (4,) that places the poles of one axis at `settings.poles` (4.12), (4.13)."""
    gain: Array = np.asarray(control.place_acker(CHAIN_A, CHAIN_B, [*map(complex, settings.poles)]))
    return gain.reshape(4)


def lqr_gain(settings: DesignSettings) -> Array:
    """Return the gain (4,) that minimises the integral of x'Qx + R v² for one axis (4.15).

    With p(s) = s⁴ + k3 s³ + k2 s² + k1 s + k0, p(s) p(-s) = s⁸ - q3 s⁶ + q2 s⁴ - q1 s² + q0, where q are the
    weights over R. Equal powers give k0, and k1 and k3 as functions of k2. The remaining equation for k2 is
    concave and positive at 2 √k0. Its root above that makes p stable. A solver of Riccati equations loses
    digits if weights are many decades apart, and its last digits depend on the processor.
    """
    q0, q1, q2, q3 = (weight / settings.input_weight for weight in settings.state_weights)
    k0 = sqrt(q0)

    def others(k2: float) -> tuple[float, float]:
        return sqrt(q1 + 2.0 * k0 * k2), sqrt(q3 + 2.0 * k2)

    def excess(k2: float) -> float:
        k1, k3 = others(k2)
        return (q2 - 2.0 * k0 + 2.0 * k1 * k3) / k2**2 - 1.0

    low = 2.0 * sqrt(k0)
    high = 2.0 * low
    while excess(high) > 0.0:
        high *= 2.0
    # SciPy takes no smaller rtol, so this root is as exact as its numbers.
    k2 = float(brentq(excess, low, high, xtol=np.finfo(float).tiny, rtol=4 * np.finfo(float).eps))
    k1, k3 = others(k2)
    return np.array([k0, k1, k2, k3])

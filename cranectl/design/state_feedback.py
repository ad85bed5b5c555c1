"""Static state feedback for the integrator chain z'''' = v (thesis 4.2), through python-control."""

import control
import numpy as np
from scipy.optimize import brentq

from cranectl.design.records import CHAIN_A, CHAIN_B
from cranectl.scenario import DesignSettings
from cranectl.support.arrays import Array

GAIN_AGREEMENT = 1e-7  # largest relative error of the Riccati solver's gains with which they are used


def pole_placement_gain(settings: DesignSettings) -> Array:
    """Return the gain (4,) that places the poles of one axis at `settings.poles` (4.12), (4.13)."""
    gain: Array = np.asarray(control.place_acker(CHAIN_A, CHAIN_B, [*map(complex, settings.poles)]))
    return gain.reshape(4)


def lqr_gain(settings: DesignSettings) -> Array:
    """Return the gain (4,) that minimises the integral of x'Qx + R v² for one axis (4.15).

    The solver of the Riccati equation fails or loses digits if weights are many decades apart. Then the gain
    comes from the spectral factor.
    """
    factor = spectral_factor(np.array(settings.state_weights) / settings.input_weight)
    try:
        gain, _, _ = control.lqr(
            CHAIN_A, CHAIN_B, np.diag(settings.state_weights), np.array([[settings.input_weight]])
        )
    except ValueError:  # LinAlgError is a subclass
        return factor
    gain = np.asarray(gain).reshape(4)
    return gain if np.allclose(gain, factor, rtol=GAIN_AGREEMENT, atol=0.0) else factor


def spectral_factor(weights: Array) -> Array:
    """Return the gain (4,) of lqr for state weights (4,) relative to the weight of v.

    With p(s) = s⁴ + k3 s³ + k2 s² + k1 s + k0, p(s) p(-s) = s⁸ - q3 s⁶ + q2 s⁴ - q1 s² + q0. Equal powers
    give k0, and k1 and k3 as functions of k2. The remaining equation for k2 is concave and positive at 2 √k0.
    Its root above that makes p stable.
    """
    q0, q1, q2, q3 = map(float, weights)
    k0 = np.sqrt(q0)

    def others(k2: float) -> tuple[float, float]:
        return float(np.sqrt(q1 + 2.0 * k0 * k2)), float(np.sqrt(q3 + 2.0 * k2))

    def excess(log_k2: float) -> float:
        k2 = np.exp(log_k2)
        k1, k3 = others(k2)
        return float((q2 - 2.0 * k0 + 2.0 * k1 * k3) / k2**2 - 1.0)

    low = np.log(2.0 * np.sqrt(k0))
    high = low + 1.0
    while excess(high) > 0.0:
        high += 1.0
    k2 = float(np.exp(brentq(excess, low, high, xtol=1e-15, rtol=4 * np.finfo(float).eps)))
    k1, k3 = others(k2)
    return np.array([k0, k1, k2, k3])

"""Static state feedback for the integrator chain z'''' = v (thesis 4.2), through python-control."""

import control
import numpy as np
from numpy.typing import NDArray

from cranectl.scenario import DesignSettings

Array = NDArray[np.float64]

# The chain of four integrators of one axis, states (e, e', e'', e'''), (3.17).
CHAIN_A: Array = np.diag(np.ones(3), 1)
CHAIN_B: Array = np.eye(4)[:, 3:]


def pole_placement_gain(settings: DesignSettings) -> Array:
    """Gain (4,) that places the poles of one axis at `settings.poles` (4.12), (4.13)."""
    gain: Array = np.asarray(control.place_acker(CHAIN_A, CHAIN_B, list(settings.poles)))
    return gain.reshape(4)


def lqr_gain(settings: DesignSettings) -> Array:
    """Gain (4,) that minimises the integral of x'Qx + R v² for one axis (4.15)."""
    weights = np.diag(settings.state_weights)
    gain, _, _ = control.lqr(CHAIN_A, CHAIN_B, weights, np.array([[settings.input_weight]]))
    return np.asarray(gain).reshape(4)


def loop_margins(gain: Array) -> tuple[float, float, float, float]:
    """(gain margin, phase margin [rad], modulus margin, crossover [rad/s]) of the loop cut at v."""
    loop = control.ss(CHAIN_A, CHAIN_B, gain.reshape(1, 4), 0.0)
    gain_margin, phase_margin, _, _, crossover, _ = control.stability_margins(loop)
    sensitivity = control.feedback(1.0, loop)
    peak = control.system_norm(sensitivity, "inf", tol=1e-9)
    return float(gain_margin), float(np.deg2rad(phase_margin)), float(1.0 / peak), float(crossover)

"""Static state feedback for the integrator chain z'''' = v (thesis 4.2), through python-control."""

import control
import numpy as np

from cranectl.design.records import CHAIN_A, CHAIN_B
from cranectl.scenario import DesignSettings
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError


def pole_placement_gain(settings: DesignSettings) -> Array:
    """Gain (4,) that places the poles of one axis at `settings.poles` (4.12), (4.13)."""
    gain: Array = np.asarray(control.place_acker(CHAIN_A, CHAIN_B, [*map(complex, settings.poles)]))
    return gain.reshape(4)


def lqr_gain(settings: DesignSettings) -> Array:
    """Gain (4,) that minimises the integral of x'Qx + R v² for one axis (4.15).

    Raises InputError for weights whose Riccati equation cannot be solved.
    """
    weights = np.diag(settings.state_weights)
    try:
        gain, _, poles = control.lqr(CHAIN_A, CHAIN_B, weights, np.array([[settings.input_weight]]))
    except np.linalg.LinAlgError as error:
        problem = str(error)
    else:
        if np.isfinite(gain).all() and poles.real.max() < 0.0:
            return np.asarray(gain).reshape(4)
        problem = "its solution does not stabilise"
    raise InputError(
        f"the Riccati equation of lqr is ill-conditioned: {problem}",
        allowed="state and input weights of less extreme ratio",
        remedy="scale design.state_weights and design.input_weight towards each other",
    )

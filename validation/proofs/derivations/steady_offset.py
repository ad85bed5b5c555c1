"""Compute in closed form the load's offset that feedback leaves under a constant disturbance.

The disturbance is a pair of constant angular accelerations d_alpha, d_beta. At rest, gravity balances it:

    sin 2 alpha = 2 d_alpha h / g          sin 2 beta = 2 d_beta h / (g cos² alpha)

with the vertical drop h = l cos(alpha) cos(beta). The drives rest only if the tracker commands zero. l'' = 0
and x_c'' = 0 give

    zeta = g (cos² alpha cos² beta - 1)    v_x = g p_x (zeta + g) / h        v_z = 0

The tracker computes the load's acceleration by the flat map, z_1'' = -p_x (zeta + g). So v = k_0 e - k_2 z''
gives

    e_x = p_x (zeta + g) (g / h - k_2) / k_0        e_z = k_2 zeta / k_0        and likewise for y

The flat map does not contain the disturbance, so it takes a leaning rope for an accelerated load. One
equation in h remains, which is solved to rounding below.

A robustifier adds v-bar = K(0) e at rest, so k_0 + K(0) replaces k_0. It reduces the offset by about
S(0) = k_0 / (k_0 + K(0)). With an integrator K(0) is infinite, and no offset remains. The S/KS optimum is
all-pass: |W_s S| = gamma where W_ks K S is small, so S(0) = gamma / W_s(0) = gamma A. The offset is not zero
because W_s is finite.

    python validation/proofs/derivations/steady_offset.py
"""

from math import asin, cos, sin, tan

import numpy as np
from scipy.optimize import brentq

from cranectl.design import design_controller


def tilt(d_alpha: float, d_beta: float, h: float, gravity: float) -> tuple[float, float]:
    """Return the cardan angles at rest under constant disturbances [rad]."""
    alpha = 0.5 * asin(2.0 * d_alpha * h / gravity)
    beta = 0.5 * asin(2.0 * d_beta * h / (gravity * cos(alpha) ** 2))
    return alpha, beta


def steady_state(
    gain: np.ndarray,
    desired: tuple[float, float, float],
    d_alpha: float,
    d_beta: float,
    gravity: float = 9.81,
    robustifier_gain: float = 0.0,
) -> dict[str, float]:
    """Return load position [m], angles [rad], zeta [m/s²] and rope length [m] of the loop at rest.

    `desired` is z_d [m], and `robustifier_gain` is K(0) [1/s⁴].
    """
    k_0, k_2 = float(gain[0]) + robustifier_gain, float(gain[2])

    def zeta_of(h: float) -> float:
        alpha, beta = tilt(d_alpha, d_beta, h, gravity)
        return gravity * ((cos(alpha) * cos(beta)) ** 2 - 1.0)

    # h = -z_3 = -(z_d3 - e_z)
    h = brentq(lambda h: -desired[2] + k_2 * zeta_of(h) / k_0 - h, 1e-6, -desired[2] + 1e-9, xtol=1e-15)
    alpha, beta = tilt(d_alpha, d_beta, h, gravity)
    zeta = zeta_of(h)
    factor = (zeta + gravity) * (gravity / h - k_2) / k_0
    p_x, p_y = tan(beta) / cos(alpha), tan(alpha)
    return {
        "load_x": desired[0] - p_x * factor,
        "load_y": desired[1] - p_y * factor,
        "load_z": -h,
        "alpha": alpha,
        "beta": beta,
        "zeta": zeta,
        "length": h / (cos(alpha) * cos(beta)),
    }


def residual(state: dict[str, float], d_alpha: float, d_beta: float, gravity: float = 9.81) -> float:
    """Return the larger angular acceleration in a state of `steady_state` [rad/s²], which should be 0."""
    length, alpha, beta = state["length"], state["alpha"], state["beta"]
    on_alpha = -gravity * sin(alpha) / (length * cos(beta)) + d_alpha
    on_beta = -gravity * cos(alpha) * sin(beta) / length + d_beta
    return max(abs(on_alpha), abs(on_beta))


if __name__ == "__main__":
    for name in ("pole-placement", "lqr", "pole-placement+hinf", "lqr+hinf"):
        design = design_controller(name)
        static_gain = design.robustifier.static_gain
        state = steady_state(design.gain, (1.0, 0.77, -0.7), 1.0, 1.0, robustifier_gain=static_gain)
        sensitivity = design.gain[0] / (design.gain[0] + static_gain)
        print(f"{name}: S(0) = {sensitivity:.4f},", {key: round(value, 4) for key, value in state.items()})

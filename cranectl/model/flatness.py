"""The load position as flat output: state and inputs follow from it and its derivatives, and back.

The rope slopes p = (p_x, p_y) are the horizontal run over the vertical drop h = -z_3 of the rope. From

    p_x = tan b / cos a = -z1'' / (z3'' + g)       x_c = z1 - p_x h      l = h sqrt(1 + p_x² + p_y²)
    p_y = tan a         = -z2'' / (z3'' + g)       y_c = z2 - p_y h

all else follows by differentiation in time, and no matrix is inverted. The result equals the thesis's (3.33)
to (3.46) with the corrections listed in docs/explanation/model.md. It is singular if the rope is slack
(z3'' + g <= 0) or has no length, and if a cardan angle reaches pi/2.
"""

from math import atan, cos, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from cranectl.model.dynamics import rope_direction, rope_direction_rate
from cranectl.signals import (
    ACCELERATION,
    ALPHA,
    ALPHA_RATE,
    BETA,
    BETA_RATE,
    BRIDGE,
    BRIDGE_RATE,
    JERK,
    ROPE,
    ROPE_RATE,
    SNAP,
    TROLLEY,
    TROLLEY_RATE,
    VELOCITY,
    X,
    Y,
    Z,
)
from cranectl.support import jit


@jit
def slopes_from_angles(alpha, alpha_rate, beta, beta_rate):
    """Return the rope slopes p_x, p_y and their rates, from the cardan angles and their rates."""
    secant, tan_b = 1.0 / cos(alpha), tan(beta)
    p_y = tan(alpha)
    p_x = tan_b * secant
    p_y_dot = alpha_rate * (1.0 + p_y * p_y)
    p_x_dot = beta_rate * (1.0 + tan_b * tan_b) * secant + p_x * p_y * alpha_rate
    return p_x, p_y, p_x_dot, p_y_dot


@jit
def angles_from_slopes(p_x, p_y, p_x_dot, p_y_dot):
    """Return the cardan angles and their rates from the rope slopes; inverse of `slopes_from_angles`."""
    alpha = atan(p_y)
    ca = cos(alpha)
    alpha_rate = p_y_dot * ca * ca
    tan_b = p_x * ca
    beta = atan(tan_b)
    tan_b_dot = p_x_dot * ca - p_x * p_y * ca * alpha_rate
    beta_rate = tan_b_dot / (1.0 + tan_b * tan_b)
    return alpha, alpha_rate, beta, beta_rate


@jit
def flat_output(state, zeta, zeta_dot, gravity, output):
    """Write the load position and its first three derivatives into `output`, from state and extension.

    `state` is in the order of `SignalGroup.STATE`. `zeta` and `zeta_dot` are the vertical acceleration of the
    load [m/s²] and its rate. `output[0:12]` becomes (z, z', z'', z'''), three axes each, by (3.24), (3.25),
    (3.43) and (3.44).
    """
    length, length_rate = state[ROPE], state[ROPE_RATE]
    alpha, alpha_rate, beta, beta_rate = state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE]
    n_x, n_y, n_z = rope_direction(alpha, beta)
    n_x_dot, n_y_dot, n_z_dot = rope_direction_rate(alpha, alpha_rate, beta, beta_rate)
    p_x, p_y, p_x_dot, p_y_dot = slopes_from_angles(alpha, alpha_rate, beta, beta_rate)
    lift = zeta + gravity
    output[X] = state[BRIDGE] + length * n_x
    output[Y] = state[TROLLEY] + length * n_y
    output[Z] = length * n_z
    output[VELOCITY + X] = state[BRIDGE_RATE] + length_rate * n_x + length * n_x_dot
    output[VELOCITY + Y] = state[TROLLEY_RATE] + length_rate * n_y + length * n_y_dot
    output[VELOCITY + Z] = length_rate * n_z + length * n_z_dot
    output[ACCELERATION + X] = -p_x * lift
    output[ACCELERATION + Y] = -p_y * lift
    output[ACCELERATION + Z] = zeta
    output[JERK + X] = -p_x_dot * lift - p_x * zeta_dot
    output[JERK + Y] = -p_y_dot * lift - p_y * zeta_dot
    output[JERK + Z] = zeta_dot


@jit
def drive_accelerations(h, h_dot, p_x, p_y, p_x_dot, p_y_dot, p_x_ddot, p_y_ddot, zeta, gravity):
    """Return the accelerations (x_c'', y_c'', l'') [m/s²] that give the slopes these second derivatives.

    They are the second derivatives of x_c = z1 - p_x h, y_c = z2 - p_y h and l = h s, where
    s² = 1 + p_x² + p_y², h'' = -zeta and z1'' = -p_x (zeta + g).
    """
    s = sqrt(1.0 + p_x * p_x + p_y * p_y)
    s_dot = (p_x * p_x_dot + p_y * p_y_dot) / s
    speed2 = p_x_dot * p_x_dot + p_y_dot * p_y_dot
    s_ddot = (speed2 + p_x * p_x_ddot + p_y * p_y_ddot - s_dot * s_dot) / s
    u_x = -(gravity * p_x + 2.0 * p_x_dot * h_dot + h * p_x_ddot)
    u_y = -(gravity * p_y + 2.0 * p_y_dot * h_dot + h * p_y_ddot)
    u_l = -zeta * s + 2.0 * h_dot * s_dot + h * s_ddot
    return u_x, u_y, u_l


@jit
def slope_acceleration(slope, slope_rate, jerk_rate, zeta_d2, zeta_dot, lift):
    """Return p'' of a slope p, from z'''' = `jerk_rate` and the derivatives of z'' = -p (zeta + g)."""
    return -(jerk_rate + 2.0 * slope_rate * zeta_dot + slope * zeta_d2) / lift


@jit
def linearising_input(state, zeta, zeta_dot, v_x, v_y, v_z, gravity):
    """Return the accelerations (x_c'', y_c'', l'') [m/s²] at which z'''' = (v_x, v_y, v_z) [m/s⁴] exactly.

    The dynamic extension obeys zeta'' = v_z. The state must be regular: l > 0, angles within pi/2 and
    zeta + g > 0.
    """
    length, length_rate = state[ROPE], state[ROPE_RATE]
    alpha, alpha_rate, beta, beta_rate = state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE]
    p_x, p_y, p_x_dot, p_y_dot = slopes_from_angles(alpha, alpha_rate, beta, beta_rate)
    n_z = rope_direction(alpha, beta)[2]
    n_z_dot = rope_direction_rate(alpha, alpha_rate, beta, beta_rate)[2]
    h = -length * n_z
    h_dot = -length_rate * n_z - length * n_z_dot
    lift = zeta + gravity
    p_x_ddot = slope_acceleration(p_x, p_x_dot, v_x, v_z, zeta_dot, lift)
    p_y_ddot = slope_acceleration(p_y, p_y_dot, v_y, v_z, zeta_dot, lift)
    return drive_accelerations(h, h_dot, p_x, p_y, p_x_dot, p_y_dot, p_x_ddot, p_y_ddot, zeta, gravity)


@jit
def state_and_input(flat, gravity, state, inputs):
    """Write `state` and `inputs` that follow from the load position and its four derivatives.

    `flat` (15,) is (z, z', z'', z''', z''''), three axes each. `state` (10,) is in the order of
    `SignalGroup.STATE`, and `inputs` (3,) is (x_c'', y_c'', l'') [m/s²], by the corrected (3.34) to (3.39).
    z_3 < 0 and z_3'' + g > 0 must hold.
    """
    lift = flat[ACCELERATION + Z] + gravity
    h, h_dot = -flat[Z], -flat[VELOCITY + Z]
    p_x, p_y = -flat[ACCELERATION + X] / lift, -flat[ACCELERATION + Y] / lift
    p_x_dot = -(flat[JERK + X] + p_x * flat[JERK + Z]) / lift
    p_y_dot = -(flat[JERK + Y] + p_y * flat[JERK + Z]) / lift
    p_x_ddot = slope_acceleration(p_x, p_x_dot, flat[SNAP + X], flat[SNAP + Z], flat[JERK + Z], lift)
    p_y_ddot = slope_acceleration(p_y, p_y_dot, flat[SNAP + Y], flat[SNAP + Z], flat[JERK + Z], lift)
    s = sqrt(1.0 + p_x * p_x + p_y * p_y)
    s_dot = (p_x * p_x_dot + p_y * p_y_dot) / s
    state[BRIDGE] = flat[X] - p_x * h
    state[BRIDGE_RATE] = flat[VELOCITY + X] - p_x_dot * h - p_x * h_dot
    state[TROLLEY] = flat[Y] - p_y * h
    state[TROLLEY_RATE] = flat[VELOCITY + Y] - p_y_dot * h - p_y * h_dot
    state[ROPE] = h * s
    state[ROPE_RATE] = h_dot * s + h * s_dot
    alpha, alpha_rate, beta, beta_rate = angles_from_slopes(p_x, p_y, p_x_dot, p_y_dot)
    state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE] = alpha, alpha_rate, beta, beta_rate
    u_x, u_y, u_l = drive_accelerations(
        h, h_dot, p_x, p_y, p_x_dot, p_y_dot, p_x_ddot, p_y_ddot, flat[ACCELERATION + Z], gravity
    )
    inputs[0], inputs[1], inputs[2] = u_x, u_y, u_l


@jit
def _states_and_inputs(rows, gravity, states, inputs):
    for k in range(rows.shape[0]):
        state_and_input(rows[k], gravity, states[k], inputs[k])


def states_and_inputs(
    rows: NDArray[np.float64], gravity: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Apply `state_and_input` to many samples: rows (N, 15) → states (N, 10), inputs (N, 3)."""
    states, inputs = np.empty((len(rows), 10)), np.empty((len(rows), 3))
    _states_and_inputs(np.ascontiguousarray(rows), gravity, states, inputs)  # else it would be compiled again
    return states, inputs

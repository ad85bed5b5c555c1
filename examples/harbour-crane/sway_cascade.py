"""Our control law: the load's error asks for a sway, the trolley makes that sway.

The usual cascade of sway control; x is the load's position, theta the rope's small angle, l its length, a the
drive's acceleration, and each loop has a natural frequency w and the damping d:

    load:  x'' = -g theta              theta_d = -(x_d'' + w² e + 2 d w e') / g,  with e = x_d - x
    sway:  l theta'' = -g theta - a    theta'' = w² (theta_d - theta) + 2 d w (theta_d' - theta')
"""

import numpy as np

from cranectl import Controller, Logged, Parameter, Signal

DAMPING = 0.7  # of all loops


def step(parameters, measured, reference, memory, command):
    """One sample, compiled by Numba; the five arrays are explained in cranectl's docs on controllers."""
    gravity, outer, inner, winch = parameters[0], parameters[1], parameters[2], parameters[3]
    length, length_rate = measured[4], measured[5]
    for axis in range(2):  # bridge along x with beta, trolley along y with alpha
        drive, drive_rate = measured[2 * axis], measured[2 * axis + 1]
        sway, sway_rate = measured[8 - 2 * axis], measured[9 - 2 * axis]
        error = reference[axis] - (drive + length * sway)
        error_rate = reference[3 + axis] - (drive_rate + length * sway_rate + length_rate * sway)
        error_acceleration = reference[6 + axis] + gravity * sway
        correction = outer**2 * error + 2 * DAMPING * outer * error_rate
        correction_rate = outer**2 * error_rate + 2 * DAMPING * outer * error_acceleration
        wanted = -(reference[6 + axis] + correction) / gravity
        wanted_rate = -(reference[9 + axis] + correction_rate) / gravity
        sway_acceleration = inner**2 * (wanted - sway) + 2 * DAMPING * inner * (wanted_rate - sway_rate)
        command[axis] = -gravity * sway - length * sway_acceleration
        memory[axis] = wanted
    error, error_rate = -reference[2] - length, -reference[5] - length_rate
    command[2] = -reference[8] + winch**2 * error + 2 * DAMPING * winch * error_rate
    return 0


def prepare(nominal):
    """Parameters and memory of the step, for the crane that the law takes the real one for."""
    given = nominal.parameters
    frequencies = [given["outer_frequency"], given["inner_frequency"], given["winch_frequency"]]
    return np.array([nominal.rig.gravity, *frequencies]), np.zeros(2)


LAW = Controller(
    name="cascade",
    title="the load asks for a sway, the trolley makes it",
    step=step,
    prepare=prepare,
    parameters=(
        Parameter("outer_frequency", 0.4, "rad/s", "of the load's error", 0.0, 10.0),
        Parameter("inner_frequency", 1.2, "rad/s", "of the sway", 0.0, 10.0),
        Parameter("winch_frequency", 1.0, "rad/s", "of the rope's length", 0.0, 10.0),
    ),
    logged=(
        Logged(0, Signal("beta_wanted", "β_d", "rad", "sway along x that the outer loop asks for")),
        Logged(1, Signal("alpha_wanted", "α_d", "rad", "sway along y that the outer loop asks for")),
    ),
)

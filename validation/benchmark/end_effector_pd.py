"""`end-effector-pd`: a spring and a damper on the drive's place less a part of what the load is ahead of it.

    cranectl run fast-diagonal --controller validation/benchmark/end_effector_pd.py:END_EFFECTOR_PD

Source: Sun and Fang, IEEE Trans. Industrial Electronics 59 (2012), planar with a rope of constant length;
here for both axes. With e what a drive is off the set-point, n the rope's direction, k = K / (M + m) by the
masses M that the drive moves and m of the load,

    F = -k_p (e - k n) - k_d (e' - k n')

At constant length l the crane passes power F (e' - k n') into a storage, so that

    V = E + K (l n'·n'/2 + g (1 + n_z)) - sum over x, y of (m l k n'² - k_p (e - k n)²)/2
    V' = - sum of k_d (e' - k n')²

with E the crane's energy as in `energy-coupling`. The winch is a servo: it holds the rope's length against
the tension. Assumes: full state, masses (for the winch, and for k of the two axes in the ratio that V
needs), no friction, constant length. Certain: the planar law up to its gains; V in space was derived here.
A standing push that leans the rope leaves e = (k + S/k_p) n with S the tension.
"""

import numpy as np

from cranectl.controllers.controller import Controller, Logged, Parameter
from cranectl.model.dynamics import (
    AxisMasses,
    axis_masses,
    rope_direction,
    rope_direction_rate,
    winch_force,
)
from cranectl.signals import ALPHA, ALPHA_RATE, BETA, BETA_RATE, ROPE, ROPE_RATE, Signal, X, Y, Z

# Places of parameters, the first five as in `AxisMasses`, and of memory.
STIFFNESS, DAMPING, LEAD, HOIST = 5, 7, 9, 11
COUPLED, MEMORY = 0, 2


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. State and set-point in, forces out."""
    masses = AxisMasses(parameters[0], parameters[1], parameters[2], parameters[3], parameters[4])
    n = rope_direction(measured[ALPHA], measured[BETA])
    n_rate = rope_direction_rate(measured[ALPHA], measured[ALPHA_RATE], measured[BETA], measured[BETA_RATE])
    for axis in range(2):
        lead = parameters[LEAD + axis]
        error = measured[2 * axis] - reference[axis] - lead * n[axis]
        rate = measured[2 * axis + 1] - lead * n_rate[axis]
        command[axis] = -parameters[STIFFNESS + axis] * error - parameters[DAMPING + axis] * rate
        memory[COUPLED + axis] = error
    pole = parameters[HOIST]
    u_l = -pole * (pole * (measured[ROPE] + reference[Z]) + 2.0 * measured[ROPE_RATE])
    command[Z] = winch_force(masses, measured, command[X], command[Y], u_l)
    return 0


def prepare(nominal):
    """Parameters and memory."""
    masses, length, given = axis_masses(nominal.rig), nominal.state[ROPE], nominal.parameters
    pace = np.sqrt(masses.gravity / length)
    moved = np.array([masses.bridge, masses.trolley]) + masses.load
    stiffness = moved * (given["frequency"] * pace) ** 2
    damping = moved * 2.0 * given["damping"] * given["frequency"] * pace
    lead = given["lead"] * length * moved[Y] / moved
    return np.array([*masses, *stiffness, *damping, *lead, given["hoist"] * pace]), np.zeros(MEMORY)


END_EFFECTOR_PD = Controller(
    name="end-effector-pd",
    title="spring and damper on the drives, less a part of the load's lead",
    step=step,
    prepare=prepare,
    command="force",
    follows="set-point",
    parameters=(
        Parameter(
            "frequency", 0.33, "1", "√(k_p/(M + m)) over √(g/l) of the start", 0.0, 10.0, search=(0.1, 1.0)
        ),
        Parameter("damping", 0.9, "1", "k_d/√(4 k_p (M + m))", 0.0, 10.0, search=(0.2, 4.0)),
        Parameter("lead", 2.0, "1", "k of the trolley, in rope lengths", 0.0, 100.0, search=(0.2, 10.0)),
        Parameter("hoist", 0.7, "1", "pole of the winch's servo, over √(g/l)", 0.0, 100.0, search=(0.2, 5.0)),
    ),
    logged=tuple(
        Logged(COUPLED + k, Signal(f"coupled_error_{axis}", f"xi_{axis}", "m", f"e - k n, {axis}"))
        for k, axis in ((X, "x"), (Y, "y"))
    ),
)

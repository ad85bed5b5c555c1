"""`cnf`: composite nonlinear feedback, with little damping far from the target and much near it.

    cranectl run fast-diagonal --controller validation/benchmark/composite_nonlinear_feedback.py:CNF

Lengths are in units of l, times of sqrt(l/g) and accelerations of g. For each horizontal axis near plumb, x =
(drive, rate, angle, rate) is the deviation from the set-point at rest, and y = drive + angle is that of the
load:

    x' = A x + B sat(u)    u = F x + rho B'P x    (A + B F)'P + P (A + B F) = -W
    rho = -b |exp(-a |y| / |y_0|) - exp(-a)|

F places a pair of poles with frequency w and damping ratio z, and a pair with frequency 1 and damping ratio
0.7. y_0 is the value of y when the set-point changed, but at least 0.1. So rho starts at 0 and ends at -b (1
- exp(-a)). With W = diag(0.1, 0.1, 1, 1) and the defaults, the least damping ratio rises all the way. V = x'P
x falls while |F x| is within the limits of the drives. The rope has two poles at -w sqrt(g/l) and the limit
of its drive.

- Measured: the full state.
- Assumed: constant rope length, limits of the drives; masses are not used. The papers command forces, and the
  loop computes them from u.
- Certain: the method. The papers on cranes that the thesis cites as XW12 and YLL14 were not accessible, so
  the gains are ours.
- Limits: there is no integral. Under a constant disturbance, which leans the rope, the crane stops where F x
  + rho B'P x = 0.

References
----------
Lin, Pachter and Banda, Int. J. Control 70 (1998). Chen and others, IEEE Trans. Autom. Control 48 (2003).
"""

from math import exp, sqrt

import numpy as np
from numba import carray
from scipy.linalg import solve_continuous_lyapunov

from cranectl.controllers.common import saturate
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, X, Z
from cranectl.status import RunStatus
from cranectl.support.arrays import round_digits
from cranectl.support.jit import jit

WEIGHTS = (0.1, 0.1, 1.0, 1.0)  # W
MIN_STEP = 0.1  # smallest |y_0|, in rope lengths: a disturbed load at its target counts as near

PARAMETERS = Slots(gravity=1, frequency=1, strength=1, sharpness=1, limit=3, gain=4, costate=4)
MEMORY = Slots(target=2, step=2, rho=2, begun=1)


@jit
def damping(strength, sharpness, share):
    """Return rho where the load's distance from its target is `share` of the initial one."""
    return -strength * abs(exp(-sharpness * abs(share)) - exp(-sharpness))


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations (3,) [m/s²] of one sample from state and set-point."""
    stored = carray(memory, (MEMORY.size,))
    gravity, length = parameters[PARAMETERS.gravity], measured[ROPE]
    if length <= 0.0:
        return RunStatus.SLACK_ROPE
    pole = sqrt(gravity / length)
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        drive = (measured[joint] - reference[axis]) / length
        load = drive + measured[angle]
        if stored[MEMORY.begun] == 0.0 or stored[MEMORY.target + axis] != reference[axis]:
            stored[MEMORY.target + axis] = reference[axis]
            stored[MEMORY.step + axis] = max(abs(load), MIN_STEP)
        rho = damping(
            parameters[PARAMETERS.strength],
            parameters[PARAMETERS.sharpness],
            load / stored[MEMORY.step + axis],
        )
        feedback = 0.0
        for i in range(4):
            value = drive if i == 0 else measured[angle] if i == 2 else measured[angle + 1] / pole
            if i == 1:
                value = measured[joint + 1] / (pole * length)
            feedback += (parameters[PARAMETERS.gain + i] + rho * parameters[PARAMETERS.costate + i]) * value
        stored[MEMORY.rho + axis] = rho
        command[axis] = saturate(gravity * feedback, parameters[PARAMETERS.limit + axis])
    stored[MEMORY.begun] = 1.0
    rope = parameters[PARAMETERS.frequency] * pole
    lifted = -rope * rope * (length + reference[Z]) - 2.0 * rope * measured[ROPE + 1]
    command[Z] = saturate(lifted, parameters[PARAMETERS.limit + Z])
    return 0


def linear_part(frequency, ratio):
    """Return A + B F (4, 4), B (4,), F (4,) and P (4, 4), in units of l, sqrt(l/g) and g."""
    a = np.array([[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]], float)
    b = np.array([0.0, 1.0, 0.0, -1.0])
    pair = [1.0, 2.0 * ratio * frequency, frequency**2]
    _, cubic, square, slope, constant = np.polymul(pair, [1.0, 1.4, 1.0])
    gain = -np.array([constant, slope, 1.0 + constant - square, slope - cubic])
    closed = a + np.outer(b, gain)
    return closed, b, gain, solve_continuous_lyapunov(closed.T, -np.diag(WEIGHTS))


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    names = ("frequency", "ratio", "strength", "sharpness")
    frequency, ratio, strength, sharpness = (float(nominal.parameters[name]) for name in names)
    _, b, gain, cost = linear_part(frequency, ratio)
    parameters = PARAMETERS.array(
        gravity=nominal.rig.gravity,
        frequency=frequency,
        strength=strength,
        sharpness=sharpness,
        limit=nominal.rig.effects.limits.acceleration,
        gain=gain,
        costate=round_digits(b @ cost),
    )
    return parameters, MEMORY.array()


CNF = Controller(
    name="cnf",
    title="composite nonlinear feedback: little damping far from the set-point, much near it",
    step=step,
    prepare=prepare,
    reads=("gravity", "limits"),
    follows="set-point",
    parameters=(
        Parameter("frequency", 0.4, "1", "w of the slow pair, over sqrt(g/l)", 0.01, 10.0, search=(0.1, 1.0)),
        Parameter("ratio", 0.3, "1", "z, its damping ratio far away", 0.01, 10.0, search=(0.1, 1.0)),
        Parameter("strength", 0.8, "1", "b, most that rho can be", 0.0, 1e3, search=(0.1, 5.0)),
        Parameter(
            "sharpness", 2.0, "1", "a, how near the target damping begins", 0.0, 1e3, search=(0.5, 10.0)
        ),
    ),
    logged=MEMORY.logged(rho=per_axis("rho", "rho", "1", "gain of the nonlinear part")),
)

"""`hierarchical-sliding-mode`: a surface of the drive, one of the rope, and their sum, which is reached.

    cranectl run fast-diagonal --controller validation/benchmark/hierarchical_sliding_mode.py:HIERARCHICAL

Source: the method of Qian and Yi, Hierarchical Sliding Mode Control for Under-actuated Cranes (2016),
planar with a rope of constant length L and forces; here both axes, with accelerations. With e what the
drive, b what the angle is off the state that the flat map gives for the path,

    s_1 = e' + c_1 e,    s_2 = L (b' + c_2 b),    S = s_1 - a s_2,    S' = -k S - r sgn S

for which the acceleration is found from the rope's equations, exactly, while the rope is hoisted too. On S
= 0 the crane l b'' = -g b - e'' has the polynomial (l r² + g) (r + c_1) + a L (r + c_2) r². At l = L its
roots are all -p by

    p = √(g / (3 L (1 + a))),    c_1 = p/3,    c_2 = p (3 (1 + a) - 1/3) / a

and it is stable at every length, for c_2 > c_1 > 0. S is zero after log(1 + k |S_0| / r) / k. The rope has
s_1 alone, with c_1 = hoist √(g/L). sgn is that of the next sample, by which S stays zero. Assumes: full
state; masses are not used. Certain: the method; ours: its numbers. A standing push that leans the rope by b
pulls at S with a L g b / l: r must be more; then e = (8 + 9 a) L b is left.
"""

from math import cos, sqrt

import numpy as np
from numba import carray

from cranectl.controllers.controller import Controller, Logged, Parameter
from cranectl.model.dynamics import angular_accelerations
from cranectl.model.flatness import state_and_input
from cranectl.signals import (
    ACCELERATION,
    ALPHA,
    ALPHA_RATE,
    BETA,
    BETA_RATE,
    BRIDGE,
    ROPE,
    ROPE_RATE,
    TROLLEY,
    Signal,
    X,
    Y,
    Z,
)
from cranectl.support.jit import jit

# Places of parameters and memory.
PERIOD, GRAVITY, LEVER, FORGETS, SWINGS, HOIST, DECAY, REACH = range(8)
SURFACE, DESIRED, INPUT, MEMORY = 0, 3, 13, 16


def surface_numbers(length, gravity, share):
    """(c_1, c_2) [1/s] for three equal poles at a rope length [m]."""
    pole = sqrt(gravity / (3.0 * length * (1.0 + share)))
    return pole / 3.0, pole * (3.0 * (1.0 + share) - 1.0 / 3.0) / share


@jit
def swing(state, u_x, u_y, gravity):
    """Accelerations of alpha and beta [rad/s²] in `state` (10,) under the drives' [m/s²]."""
    alpha, alpha_rate, beta, beta_rate = state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE]
    return angular_accelerations(
        state[ROPE], state[ROPE_RATE], alpha, alpha_rate, beta, beta_rate, u_x, u_y, gravity
    )


@jit
def reached(parameters, surface):
    """-k S - r sgn S, with the sign that S has after a period."""
    rest = surface / parameters[PERIOD] - parameters[DECAY] * surface
    return -parameters[DECAY] * surface - min(max(rest, -parameters[REACH]), parameters[REACH])


@jit
def slide(parameters, measured, held, joint, angle):
    """(S, S' less what the accelerations of drive and angle give) of a horizontal axis."""
    forgets, lever, swings = parameters[FORGETS], parameters[LEVER], parameters[SWINGS]
    e, e_rate = measured[joint] - held[DESIRED + joint], measured[joint + 1] - held[DESIRED + joint + 1]
    b, b_rate = measured[angle] - held[DESIRED + angle], measured[angle + 1] - held[DESIRED + angle + 1]
    return e_rate + forgets * e - lever * (b_rate + swings * b), forgets * e_rate - lever * swings * b_rate


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. State and path in, accelerations out."""
    held = carray(memory, (MEMORY,))
    gravity, lever, length = parameters[GRAVITY], parameters[LEVER], measured[ROPE]
    if reference[ACCELERATION + Z] + gravity <= 0.0 or reference[Z] >= 0.0:
        return 2
    desired, inputs = held[DESIRED:INPUT], held[INPUT:MEMORY]
    state_and_input(reference, gravity, desired, inputs)
    wanted = swing(desired, inputs[X], inputs[Y], gravity)
    cos_beta = cos(measured[BETA])

    surface, drift = slide(parameters, measured, held, TROLLEY, ALPHA)
    drift -= lever * (swing(measured, 0.0, 0.0, gravity)[0] - wanted[0])
    gain = 1.0 + lever * cos(measured[ALPHA]) / (length * cos_beta)
    command[Y] = (inputs[Y] - drift + reached(parameters, surface)) / gain
    held[SURFACE + Y] = surface

    surface, drift = slide(parameters, measured, held, BRIDGE, BETA)
    drift -= lever * (swing(measured, 0.0, command[Y], gravity)[1] - wanted[1])
    command[X] = (inputs[X] - drift + reached(parameters, surface)) / (1.0 + lever * cos_beta / length)
    held[SURFACE + X] = surface

    rate = measured[ROPE_RATE] - desired[ROPE_RATE]
    held[SURFACE + Z] = rate + parameters[HOIST] * (length - desired[ROPE])
    command[Z] = inputs[Z] - parameters[HOIST] * rate + reached(parameters, held[SURFACE + Z])
    return 0


def prepare(nominal):
    """Parameters and memory."""
    gravity, length, given = nominal.rig.gravity, nominal.state[ROPE], nominal.parameters
    pace, share = sqrt(gravity / length), given["share"]
    forgets, swings = surface_numbers(length, gravity, share)
    head = [nominal.period, gravity, share * length, forgets, swings, given["hoist"] * pace]
    return np.array([*head, given["decay"] * pace, given["reach"] * gravity]), np.zeros(MEMORY)


HIERARCHICAL = Controller(
    name="hierarchical-sliding-mode",
    title="sliding mode on the sum of a drive's and a rope's surface, flat path as feed-forward",
    step=step,
    prepare=prepare,
    parameters=(
        Parameter("share", 0.3, "1", "a, of the rope's surface in S", 1e-3, 100.0, search=(0.05, 3.0)),
        Parameter("hoist", 1.0, "1", "c_1 of the rope, over √(g/L)", 0.0, 100.0, search=(0.2, 5.0)),
        Parameter("decay", 1.0, "1", "k, over √(g/L)", 0.0, 100.0, search=(0.1, 10.0)),
        Parameter("reach", 0.03, "1", "r, over g", 0.0, 10.0, search=(0.003, 0.3)),
    ),
    logged=tuple(
        Logged(SURFACE + k, Signal(f"surface_{axis}", f"S_{axis}", "m/s", f"sliding surface, {axis}"))
        for k, axis in ((X, "x"), (Y, "y"), (Z, "l"))
    ),
)

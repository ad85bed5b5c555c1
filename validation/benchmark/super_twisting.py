"""`super-twisting`: the second-order sliding mode of Levant on a surface of ours, with the flat path's input.

    cranectl run fast-diagonal --controller validation/benchmark/super_twisting.py:SUPER_TWISTING

Source: A. Levant, Int. J. Control 58 (1993), as Vázquez, Fridman and Collado use it on a crane (2013); their
surface is not in what could be read, so the law has the method's name. Per horizontal axis, near plumb, with
e the drive's and b the angle's deviation from the state that the flat map gives for the path, u_d its input,

    s = e' + lambda e - kappa b
    u = u_d - lambda e' + kappa b' - k_1 |s|^(1/2) sgn(s) + w,    w' = -k_2 sgn(s)

On s = 0 the crane l b'' = -g b - e'' has the polynomial (l r² + g)(r + lambda) + kappa r², whose three roots
are -p for lambda = p/3, kappa = 8 p l/3, p = sqrt(g/3l), whatever the length l. The rope's surface is
e' + lambda e. Assumes: full state, slow hoisting, of which the polynomial knows nothing; masses are not used.
Certain: the algorithm; ours: the surface. A standing push that leans the rope by b leaves e = 8 l b, since
the surface has no integral. Sampled with period T, s stays below k_1² T².
"""

from math import sqrt

import numpy as np
from numba import carray

from cranectl.controllers.controller import Controller, Logged, Parameter
from cranectl.model.flatness import state_and_input
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, ROPE, TROLLEY, Signal, X, Y, Z
from cranectl.support.jit import jit

# Places of parameters and memory.
PERIOD, GRAVITY, ROOT, TWIST, ROPE_POLE = range(5)
TWISTED, SURFACE, DESIRED, INPUT, MEMORY = 0, 3, 6, 16, 19


@jit
def slopes(length, gravity):
    """Lambda [1/s] and kappa [m/s] of the surface at a rope length [m]."""
    pole = sqrt(gravity / (3.0 * length))
    return pole / 3.0, 8.0 * pole * length / 3.0


@jit
def twisted(parameters, memory, axis, surface):
    """-k_1 |s|^(1/2) sgn(s) + w of an axis; w goes on."""
    sign = 1.0 if surface > 0.0 else -1.0 if surface < 0.0 else 0.0
    found = memory[TWISTED + axis] - parameters[ROOT] * sqrt(abs(surface)) * sign
    memory[TWISTED + axis] -= parameters[PERIOD] * parameters[TWIST] * sign
    memory[SURFACE + axis] = surface
    return found


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. State and path in, accelerations out."""
    held = carray(memory, (MEMORY,))
    desired, inputs = held[DESIRED:INPUT], held[INPUT:MEMORY]
    gravity = parameters[GRAVITY]
    if reference[ACCELERATION + Z] + gravity <= 0.0 or reference[Z] >= 0.0:
        return 2
    state_and_input(reference, gravity, desired, inputs)
    forgets, sways = slopes(measured[ROPE], gravity)
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        rate = measured[joint + 1] - desired[joint + 1]
        surface = rate + forgets * (measured[joint] - desired[joint])
        surface -= sways * (measured[angle] - desired[angle])
        command[axis] = inputs[axis] - forgets * rate + sways * (measured[angle + 1] - desired[angle + 1])
        command[axis] += twisted(parameters, held, axis, surface)
    rate = measured[ROPE + 1] - desired[ROPE + 1]
    surface = rate + parameters[ROPE_POLE] * (measured[ROPE] - desired[ROPE])
    command[Z] = inputs[Z] - parameters[ROPE_POLE] * rate + twisted(parameters, held, Z, surface)
    return 0


def prepare(nominal):
    """Parameters and memory."""
    given = [float(nominal.parameters[name]) for name in ("root_gain", "twist_gain", "rope_pole")]
    return np.array([nominal.period, nominal.rig.gravity, *given]), np.zeros(MEMORY)


SUPER_TWISTING = Controller(
    name="super-twisting",
    title="super-twisting sliding mode with sway in its surface, flat path as feed-forward",
    step=step,
    prepare=prepare,
    parameters=(
        Parameter(
            "root_gain",
            1.5,
            "m^0.5/s^1.5",
            "k_1 on the root of the surface",
            0.0,
            1e3,
            search=(0.1, 10.0),
            length_power=-0.25,
        ),
        Parameter(
            "twist_gain",
            1.1,
            "m/s³",
            "k_2, rate of what holds against constant pushes",
            0.0,
            1e3,
            search=(0.1, 10.0),
            length_power=-0.5,
        ),
        Parameter(
            "rope_pole",
            3.0,
            "1/s",
            "lambda of the rope's surface",
            0.0,
            1e3,
            search=(0.5, 20.0),
            length_power=-0.5,
        ),
    ),
    logged=tuple(
        Logged(SURFACE + k, Signal(f"surface_{axis}", f"s_{axis}", "m/s", f"sliding surface, {axis}"))
        for k, axis in ((X, "x"), (Y, "y"), (Z, "l"))
    ),
)

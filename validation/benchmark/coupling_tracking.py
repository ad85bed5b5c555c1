"""`coupling-tracking`: drives follow the path as if the load hung plumb, and give way to the swinging rope.

    cranectl run fast-diagonal --controller validation/benchmark/coupling_tracking.py:COUPLING_TRACKING

Source: Zhang and others, 2018, in the form of its planar case, taken for both axes alike. With e the drive's
deviation from the load's path (x, y) and b the rope's angle,

    zeta = e' - lambda sin b,    u = x_d'' + lambda b' cos b - k_d zeta - k_p integral of zeta

so zeta'' = -k_d zeta' - k_p zeta whatever the load does, and on zeta = 0 the crane l b'' = -g b - u swings as
l b'' + lambda b' + g b = 0. The integral begins with what the drive is off its path. The rope has zeta = e',
and -k_p e. Assumes: full state; masses and length are not used. Certain: up to the scaling by masses. A
standing push that leans the rope by b drives the crane away with the velocity lambda sin b: it tracks in its
paper, where nothing pushes.
"""

from math import cos, sin

import numpy as np

from cranectl.controllers.controller import Controller, Logged, Parameter
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, ROPE, TROLLEY, VELOCITY, Signal, X, Y, Z

# Places of parameters and memory.
PERIOD, COUPLING, DAMPING, STIFFNESS = range(4)
INTEGRAL, ERROR, BEGUN, MEMORY = 0, 2, 4, 5


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. State and path in, accelerations out."""
    coupling, damping, stiffness = parameters[COUPLING], parameters[DAMPING], parameters[STIFFNESS]
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        if memory[BEGUN] == 0.0:
            memory[INTEGRAL + axis] = measured[joint] - reference[axis]
        error = measured[joint + 1] - reference[VELOCITY + axis] - coupling * sin(measured[angle])
        command[axis] = reference[ACCELERATION + axis] - damping * error - stiffness * memory[INTEGRAL + axis]
        command[axis] += coupling * measured[angle + 1] * cos(measured[angle])
        memory[INTEGRAL + axis] += parameters[PERIOD] * error
        memory[ERROR + axis] = error
    memory[BEGUN] = 1.0
    command[Z] = -reference[ACCELERATION + Z] - damping * (measured[ROPE + 1] + reference[VELOCITY + Z])
    command[Z] -= stiffness * (measured[ROPE] + reference[Z])
    return 0


def prepare(nominal):
    """Parameters and memory."""
    given = [float(nominal.parameters[name]) for name in ("coupling", "damping", "stiffness")]
    return np.array([nominal.period, *given]), np.zeros(MEMORY)


COUPLING_TRACKING = Controller(
    name="coupling-tracking",
    title="PID on the drives' rates less a part of the rope's lean, load's path as feed-forward",
    step=step,
    prepare=prepare,
    parameters=(
        Parameter(
            "coupling",
            2.0,
            "m/s",
            "lambda, by which a drive follows the lean",
            0.0,
            1e3,
            search=(0.2, 20.0),
            length_power=0.5,
        ),
        Parameter("damping", 4.0, "1/s", "k_d on zeta", 0.0, 1e3, search=(0.4, 40.0), length_power=-0.5),
        Parameter(
            "stiffness", 4.0, "1/s²", "k_p on its integral", 0.0, 1e6, search=(0.4, 40.0), length_power=-1.0
        ),
    ),
    logged=tuple(
        Logged(ERROR + k, Signal(f"coupled_error_{axis}", f"zeta_{axis}", "m/s", f"zeta, {axis}"))
        for k, axis in ((X, "x"), (Y, "y"))
    ),
)

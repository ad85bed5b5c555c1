"""The trained policy as a controller of cranectl: `train.py` writes its six gains into policy.txt."""

from math import cos, sin
from pathlib import Path

import numpy as np

from cranectl import Controller

POLICY = Path(__file__).with_name("policy.txt")


def step(parameters, measured, reference, memory, command):  # noqa: ARG001
    """Do what `crane_env.act` does for one crane, compiled by Numba."""
    rope, alpha, beta = measured[4], measured[6], measured[8]
    errors = (
        reference[0] - measured[0] - rope * sin(beta),
        reference[1] - measured[2] - rope * cos(beta) * sin(alpha),
        reference[2] + rope * cos(beta) * cos(alpha),
    )
    for axis in range(2):  # beta is the angle along x
        angle, angle_rate = measured[8 - 2 * axis], measured[9 - 2 * axis]
        command[axis] = parameters[0] * errors[axis] + parameters[1] * measured[1 + 2 * axis]
        command[axis] += parameters[2] * angle + parameters[3] * angle_rate
    command[2] = parameters[4] * errors[2] + parameters[5] * measured[5]
    for axis in range(3):
        command[axis] = parameters[6 + axis] * min(max(command[axis], -1.0), 1.0)
    return 0


def prepare(_):
    """Return parameters, the gains and the fastest set-points [m/s], and no memory."""
    return np.array([*np.loadtxt(POLICY), 0.5, 0.5, 0.3]), np.zeros(0)


LEARNED = Controller(
    name="learned",
    title="a linear policy that was trained on the plant `elastic`",
    step=step,
    prepare=prepare,
    command="velocity",
    follows="set-point",
    every=20,
)

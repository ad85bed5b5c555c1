"""`adaptive`: Slotine and Li's adaptive law on the drives' rows of the crane, which learns the masses.

    cranectl run fast-diagonal --controller validation/benchmark/adaptive.py:ADAPTIVE --drive force

Source: Slotine and Li, Int. J. Robotics Research 6 (1987), as Yang and others use it on cranes (2009,
2011); their regressor is not in what could be read, so the law has the method's name. The drives' rows with
the swing taken out of them, P q'' + w = F (`cranectl.model.dynamics`), are linear in the masses M = (bridge
and trolley, trolley, winch, load): with N = (n_x, n_y, 1), D = diag of the first three, h the rope's
specific force without drives,

    P = D + m N Nᵀ,    w = m h N
    q_r' = q_d' - lambda e + kappa b,    s = q' - q_r'
    F = P^ q_r'' + w^ - dP^/dt s/2 - K s = Y M^ - K s,    M^' = -Gamma Yᵀ s
    V = (s·P s + (M^ - M)·Gamma^-1 (M^ - M))/2,    V' = -s·K s

e, b are what drive and angle are off the state that the flat map gives for the path, and lambda = p/3,
kappa = 8 p l/3 with p = √(g/3l) put all poles on s = 0 at -p (`super_twisting.py`). The masses begin as
they are believed. Assumes: full state, masses that stay. Certain: the method, V; ours: the sway in s.
Masses are learnt only as far as the motion shows them, and wander where something pushes that is no mass:
nothing holds them positive. A standing push that leans the rope by b leaves e = 8 l b: there is no
integral.
"""

from math import sqrt

import numpy as np
from numba import carray

from cranectl.controllers.controller import Controller, Logged, Parameter
from cranectl.model.dynamics import axis_masses, rope_direction, rope_direction_rate, specific_rope_force
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

LOAD = 3  # among the masses: bridge and trolley, trolley, winch, load
# Places of parameters and memory.
PERIOD, GRAVITY, FORGETS, SWAYS, ROPE_POLE, GAIN, ADAPTATION = 0, 1, 2, 3, 4, 5, 8
MASS, SURFACE, DESIRED, INPUT, WANTED, MEMORY = 0, 4, 7, 17, 20, 23


@jit
def follow(parameters, measured, held, joint, angle):
    """(s, q_r'') of a horizontal axis whose rope swings by the state's `angle`."""
    length, rate = measured[ROPE], 0.5 * measured[ROPE_RATE] / measured[ROPE]
    pole = sqrt(parameters[GRAVITY] / (3.0 * length))
    forgets, sways = parameters[FORGETS] * pole, parameters[SWAYS] * pole * length
    e, e_rate = measured[joint] - held[DESIRED + joint], measured[joint + 1] - held[DESIRED + joint + 1]
    b, b_rate = measured[angle] - held[DESIRED + angle], measured[angle + 1] - held[DESIRED + angle + 1]
    wanted = held[INPUT + joint // 2] - forgets * (e_rate - rate * e) + sways * (b_rate + rate * b)
    return e_rate + forgets * e - sways * b, wanted


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. State and path in, forces out."""
    held = carray(memory, (MEMORY,))
    gravity = parameters[GRAVITY]
    if reference[ACCELERATION + Z] + gravity <= 0.0 or reference[Z] >= 0.0:
        return 2
    state_and_input(reference, gravity, held[DESIRED:INPUT], held[INPUT:WANTED])
    s, wanted = held[SURFACE:DESIRED], held[WANTED:MEMORY]
    s[X], wanted[X] = follow(parameters, measured, held, BRIDGE, BETA)
    s[Y], wanted[Y] = follow(parameters, measured, held, TROLLEY, ALPHA)
    rate = measured[ROPE_RATE] - held[DESIRED + ROPE_RATE]
    s[Z] = rate + parameters[ROPE_POLE] * (measured[ROPE] - held[DESIRED + ROPE])
    wanted[Z] = held[INPUT + Z] - parameters[ROPE_POLE] * rate
    alpha, alpha_rate, beta, beta_rate = (
        measured[ALPHA],
        measured[ALPHA_RATE],
        measured[BETA],
        measured[BETA_RATE],
    )
    n = rope_direction(alpha, beta)
    turn = rope_direction_rate(alpha, alpha_rate, beta, beta_rate)
    pull = specific_rope_force(
        measured[ROPE], alpha, alpha_rate, beta, beta_rate, wanted[X], wanted[Y], wanted[Z], gravity
    )
    along, turning = n[0] * s[X] + n[1] * s[Y] + s[Z], turn[0] * s[X] + turn[1] * s[Y]
    # The masses first: sampled as well, V falls.
    for axis in range(3):
        held[axis] -= parameters[PERIOD] * parameters[ADAPTATION + axis] * wanted[axis] * s[axis]
    held[LOAD] -= parameters[PERIOD] * parameters[ADAPTATION + LOAD] * along * (pull - turning)
    for axis in range(3):
        direction, change = (1.0, 0.0) if axis == Z else (n[axis], turn[axis])
        reaction = direction * (pull - 0.5 * turning) - 0.5 * change * along
        command[axis] = held[axis] * wanted[axis] + held[LOAD] * reaction - parameters[GAIN + axis] * s[axis]
    return 0


def prepare(nominal):
    """Parameters and memory, which begins with the masses as they are believed."""
    rig, length, given = nominal.rig, nominal.state[ROPE], nominal.parameters
    pace, believed = np.sqrt(rig.gravity / length), np.array(axis_masses(rig)[:4])
    gain = given["gain"] * pace * rig.driven_masses
    adaptation = given["adaptation"] * believed / (rig.gravity * length)
    surface = [given["position"], given["sway"], given["rope_pole"] * pace]
    head = [nominal.period, rig.gravity, *surface]
    return np.array([*head, *gain, *adaptation]), np.concatenate([believed, np.zeros(MEMORY - SURFACE)])


ADAPTIVE = Controller(
    name="adaptive",
    title="Slotine-Li adaptive law on the drives' rows, with sway in its surface",
    step=step,
    prepare=prepare,
    command="force",
    parameters=(
        Parameter("position", 1.0 / 3.0, "1", "lambda over p", 0.0, 100.0, search=(0.1, 1.0)),
        Parameter("sway", 8.0 / 3.0, "1", "kappa over p l", 0.0, 100.0, search=(0.8, 8.0)),
        Parameter("rope_pole", 1.0, "1", "lambda of the rope, over √(g/l)", 0.0, 100.0, search=(0.2, 5.0)),
        Parameter(
            "gain",
            2.0,
            "1",
            "K, over what each drive moves and √(g/l) of the start",
            0.0,
            1e3,
            search=(0.2, 10.0),
        ),
        Parameter(
            "adaptation",
            1.0,
            "1",
            "Gamma, over the masses and 1/(g l) of the start",
            0.0,
            1e3,
            search=(0.1, 10.0),
        ),
    ),
    logged=(
        *(
            Logged(MASS + k, Signal(f"{name}_mass", f"M_{k + 1}", "kg", f"as it is learnt, {what}"))
            for k, (name, what) in enumerate(
                (
                    ("bridge", "bridge and trolley"),
                    ("trolley", "trolley"),
                    ("winch", "winch"),
                    ("load", "load"),
                )
            )
        ),
        *(
            Logged(SURFACE + k, Signal(f"surface_{axis}", f"s_{axis}", "m/s", f"of the drive, {axis}"))
            for k, axis in ((X, "x"), (Y, "y"), (Z, "l"))
        ),
    ),
)

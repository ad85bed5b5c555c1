"""`pid`: what cranes are sold with. Drives follow the path by their encoders; input shaping calms the load.

w = r' + k_p e + k_i ∫e + k_d e', e = r - q, for bridge, trolley and rope, whose paths are those of a load
that hangs plumb: x, y and -z. r is the path convolved with impulses A_i at t_i; T = 2 pi sqrt(l/g), undamped:

    zv   1/2, 1/2                   at 0, T/2      Singer, Seering, J. Dyn. Sys. Meas. Control 112 (1990)
    zvd  1/4, 1/2, 1/4              at 0, T/2, T   the same
    ei   (1+V)/4, (1-V)/2, (1+V)/4  at 0, T/2, T   Singhose, Seering, Singer, J. Mech. Des. 116 (1994)

Assumes: drives that follow set-points of velocity, a rope about as long as the shaper is made for; masses are
not used. Measures: encoders of the drives. Certain. It sees no angle: a load that is pushed swings on.
"""

from math import pi, sqrt

import numpy as np

from cranectl.controllers.controller import Controller, Logged, Nominal, Parameter
from cranectl.signals import ROPE, Signal
from cranectl.support.arrays import Array

SHAPERS = ("none", "zv", "zvd", "ei")
VIBRATION = 0.05  # V of ei, the part of the unshaped vibration that may remain at the modelled frequency

# Places of parameters and memory; up to three impulses, and a ring of past rows of the path.
PERIOD, PROPORTIONAL, INTEGRAL_GAIN, DERIVATIVE, FILTER, IMPULSES, ROWS, AMPLITUDE = range(8)
DELAY = AMPLITUDE + 3
INTEGRAL, ERROR, RATE, SHAPED, CLOCK, RING = 0, 3, 6, 9, 12, 13
KEPT = 6  # position and velocity of a row of the path


def impulses(shaper: str, period: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Amplitudes and times [s] of a shaper for a swing of `period` [s]."""
    v = VIBRATION
    amplitudes = {
        "none": (1.0,),
        "zv": (0.5, 0.5),
        "zvd": (0.25, 0.5, 0.25),
        "ei": (0.25 * (1.0 + v), 0.5 * (1.0 - v), 0.25 * (1.0 + v)),
    }[shaper]
    return amplitudes, tuple(0.5 * period * k for k in range(len(amplitudes)))


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. Readings and path in, set-points of velocity out."""
    period, clock, rows = parameters[PERIOD], int(memory[CLOCK]), int(parameters[ROWS])
    memory[CLOCK] += 1.0
    for i in range(KEPT):
        memory[RING + KEPT * (clock % rows) + i] = reference[i]
    for axis in range(3):
        sign = -1.0 if axis == 2 else 1.0  # the rope is longer the lower the load
        position, velocity = 0.0, 0.0
        for k in range(int(parameters[IMPULSES])):
            past = RING + KEPT * (max(clock - int(parameters[DELAY + k]), 0) % rows) + axis
            position += sign * parameters[AMPLITUDE + k] * memory[past]
            velocity += sign * parameters[AMPLITUDE + k] * memory[past + 3]
        error = position - measured[axis]
        rate = (error - memory[ERROR + axis]) / period
        memory[RATE + axis] += period / (period + parameters[FILTER]) * (rate - memory[RATE + axis])
        memory[ERROR + axis] = error
        memory[SHAPED + axis] = position
        command[axis] = (
            velocity
            + parameters[PROPORTIONAL] * error
            + parameters[INTEGRAL_GAIN] * memory[INTEGRAL + axis]
            + parameters[DERIVATIVE] * memory[RATE + axis]
        )
        memory[INTEGRAL + axis] += period * error
    return 0


def prepare(nominal: Nominal) -> tuple[Array, Array]:
    """Parameters and memory; the shaper is made for one rope length."""
    given = nominal.parameters
    length = given["rope_length"] or nominal.state[ROPE]
    amplitudes, times = impulses(str(given["shaper"]), 2.0 * pi * sqrt(length / nominal.rig.gravity))
    delays = [round(time / nominal.period) for time in times]
    parameters = np.zeros(DELAY + 3)
    parameters[:AMPLITUDE] = (
        nominal.period,
        *(given[name] for name in ("proportional", "integral", "derivative", "filter_time")),
        len(amplitudes),
        delays[-1] + 1,
    )
    parameters[AMPLITUDE : AMPLITUDE + len(amplitudes)] = amplitudes
    parameters[DELAY : DELAY + len(delays)] = delays
    memory = np.zeros(RING + KEPT * (delays[-1] + 1))
    memory[ERROR : ERROR + 3] = nominal.reference[0, :3] * (1.0, 1.0, -1.0) - nominal.state[:5:2]
    return parameters, memory


_AXES = (("bridge", "x"), ("trolley", "y"), ("rope", "l"))

PID = Controller(
    name="pid",
    title="PID on bridge, trolley and rope encoders, with input shaping",
    step=step,
    prepare=prepare,
    command="velocity",
    measures="encoders",
    parameters=(
        Parameter("shaper", "zv", "", "impulses that the path is convolved with", choices=SHAPERS),
        Parameter(
            "rope_length", 0.0, "m", "for which the shaper is made; 0: that of the path's start", 0.0, 1e4
        ),
        Parameter(
            "proportional",
            4.0,
            "1/s",
            "k_p, velocity for an error of position",
            0.0,
            1e4,
            search=(0.4, 40.0),
            length_power=-0.5,
        ),
        Parameter(
            "integral",
            2.0,
            "1/s²",
            "k_i, velocity for the integral of the error",
            0.0,
            1e6,
            search=(0.1, 40.0),
            length_power=-1.0,
        ),
        Parameter("derivative", 0.0, "1", "k_d, velocity for the rate of the error", 0.0, 1e2),
        Parameter(
            "filter_time", 0.02, "s", "time constant of the filter of the rate", 0.0, 1e2, length_power=0.5
        ),
    ),
    logged=(
        *(
            Logged(SHAPED + k, Signal(f"shaped_{name}_position", f"r_{s}", "m", f"shaped path of the {name}"))
            for k, (name, s) in enumerate(_AXES)
        ),
        *(
            Logged(INTEGRAL + k, Signal(f"{name}_error_integral", f"∫e_{s}", "m s", f"of the {name}'s error"))
            for k, (name, s) in enumerate(_AXES)
        ),
    ),
)

"""`pid`: what industrial cranes have. Drives follow the path by their encoders; input shaping damps the load.

w = r' + k_p e + k_i ∫e + k_d e' with e = r - q, for bridge, trolley and rope. Their paths are those of a load
that hangs plumb: x, y and -z. r is the path convolved with impulses A_i at times t_i. The undamped period of
the load is T = 2 pi sqrt(l/g):

    zv   1/2, 1/2                   at 0, T/2      Singer, Seering, J. Dyn. Sys. Meas. Control 112 (1990)
    zvd  1/4, 1/2, 1/4              at 0, T/2, T   the same
    ei   (1+V)/4, (1-V)/2, (1+V)/4  at 0, T/2, T   Singhose, Seering, Singer, J. Mech. Des. 116 (1994)

Assumes: drives that follow velocity set-points, a rope about as long as the shaper is made for; masses are
not used. Measures: encoders of the drives. Certain. It measures no angle, so a disturbed load swings on.
"""

from math import pi, sqrt

import numpy as np

from cranectl.controllers.controller import Controller, Nominal, Parameter
from cranectl.controllers.slots import Slots
from cranectl.signals import ROPE, Signal
from cranectl.support import Array

SHAPERS = ("none", "zv", "zvd", "ei")
VIBRATION = 0.05  # V of ei: the share of the unshaped vibration that may remain at the modelled frequency

MAX_IMPULSES = 3
KEPT = 6  # numbers of a row of the path that are stored: position and velocity

PARAMETERS = Slots(
    period=1,
    proportional=1,
    integral=1,
    derivative=1,
    filter=1,
    impulses=1,
    rows=1,
    amplitude=MAX_IMPULSES,
    delay=MAX_IMPULSES,
)
MEMORY = Slots(integral=3, error=3, rate=3, shaped=3, clock=1, ring=0)  # ring: buffer of past path rows


def impulses(shaper: str, period: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return amplitudes and times [s] of a shaper for a swing of `period` [s]."""
    v = VIBRATION
    amplitudes = {
        "none": (1.0,),
        "zv": (0.5, 0.5),
        "zvd": (0.25, 0.5, 0.25),
        "ei": (0.25 * (1.0 + v), 0.5 * (1.0 - v), 0.25 * (1.0 + v)),
    }[shaper]
    return amplitudes, tuple(0.5 * period * k for k in range(len(amplitudes)))


def step(parameters, measured, reference, memory, command):
    """Compute the velocity set-points of one sample from readings and path; see `controller`."""
    period, rows = parameters[PARAMETERS.period], int(parameters[PARAMETERS.rows])
    clock = int(memory[MEMORY.clock])
    memory[MEMORY.clock] += 1.0
    for i in range(KEPT):
        memory[MEMORY.ring + KEPT * (clock % rows) + i] = reference[i]
    for axis in range(3):
        sign = -1.0 if axis == 2 else 1.0  # a lower load means a longer rope
        position, velocity = 0.0, 0.0
        for k in range(int(parameters[PARAMETERS.impulses])):
            # Before the run the path rests at its first row, which the ring keeps as long as it is read.
            past = MEMORY.ring + KEPT * (max(clock - int(parameters[PARAMETERS.delay + k]), 0) % rows) + axis
            position += sign * parameters[PARAMETERS.amplitude + k] * memory[past]
            velocity += sign * parameters[PARAMETERS.amplitude + k] * memory[past + 3]
        error = position - measured[axis]
        rate = (error - memory[MEMORY.error + axis]) / period
        memory[MEMORY.rate + axis] += (
            period / (period + parameters[PARAMETERS.filter]) * (rate - memory[MEMORY.rate + axis])
        )
        memory[MEMORY.error + axis] = error
        memory[MEMORY.shaped + axis] = position
        command[axis] = (
            velocity
            + parameters[PARAMETERS.proportional] * error
            + parameters[PARAMETERS.integral] * memory[MEMORY.integral + axis]
            + parameters[PARAMETERS.derivative] * memory[MEMORY.rate + axis]
        )
        memory[MEMORY.integral + axis] += period * error
    return 0


def prepare(nominal: Nominal) -> tuple[Array, Array]:
    """Return parameters and memory; the shaper is made for one rope length."""
    numbers = nominal.parameters
    length = numbers["rope_length"] or nominal.state[ROPE]
    amplitudes, times = impulses(str(numbers["shaper"]), 2.0 * pi * sqrt(length / nominal.rig.gravity))
    delays = [round(time / nominal.period) for time in times]
    rows, unused = delays[-1] + 1, (0, MAX_IMPULSES - len(delays))
    parameters = PARAMETERS.array(
        period=nominal.period,
        filter=numbers["filter_time"],
        impulses=len(amplitudes),
        rows=rows,
        amplitude=np.pad(amplitudes, unused),
        delay=np.pad(delays, unused),
        **{name: numbers[name] for name in ("proportional", "integral", "derivative")},
    )
    # With the first error in the memory, the derivative does not jump at the first sample.
    error = nominal.reference[0, :3] * (1.0, 1.0, -1.0) - nominal.state[:5:2]
    return parameters, MEMORY.array(error=error, ring=np.zeros(KEPT * rows))


_AXES = (("bridge", "x"), ("trolley", "y"), ("rope", "l"))

PID = Controller(
    name="pid",
    title="PID on bridge, trolley and rope encoders, with input shaping",
    step=step,
    prepare=prepare,
    reads=("gravity",),
    command="velocity",
    measures="encoders",
    parameters=(
        Parameter("shaper", "zv", "", "impulses that the path is convolved with", choices=SHAPERS),
        Parameter("rope_length", 0.0, "m", "for which the shaper is made; 0: that of the path's start",
                  0.0, 1e4),
        Parameter("proportional", 4.0, "1/s", "k_p, velocity for an error of position", 0.0, 1e4,
                  search=(0.4, 40.0), length_power=-0.5),
        Parameter("integral", 2.0, "1/s²", "k_i, velocity for the integral of the error", 0.0, 1e6,
                  search=(0.1, 40.0), length_power=-1.0),
        Parameter("derivative", 0.0, "1", "k_d, velocity for the rate of the error", 0.0, 1e2),
        Parameter("filter_time", 0.02, "s", "time constant of the filter of the rate", 0.0, 1e2,
                  length_power=0.5),
    ),
    logged=MEMORY.logged(
        shaped=[Signal(f"shaped_{n}_position", f"r_{s}", "m", f"shaped path of the {n}") for n, s in _AXES],
        integral=[Signal(f"{n}_error_integral", f"∫e_{s}", "m s", f"of the {n}'s error") for n, s in _AXES],
    ),
)  # fmt: skip

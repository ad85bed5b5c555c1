"""`mppi`: model predictive path integral control, which averages random plans with weights by their cost.

    cranectl run fast-diagonal --controller validation/benchmark/mppi.py:MPPI

Every EVERY control periods it plans STEPS steps ahead, separately for each horizontal axis. The model
describes deviations from the state that the flat map gives for the path: x of the drive, b of the angle. l is
the rope length on the path, and d is the disturbance that the observer estimates:

    x'' = v    l b'' = -g b - 2 l' b' - v + l d    e = x + l b    u = u_d + v

    S = mean of (e/l)² + rate (e'/(w l))² + effort (v/g)²    w² = g/l
    v <- sum of exp(-S_i/temperature) v_i, over the sum of these weights

v is linear between KNOTS knots. The knots of plan i are normally distributed about those of v, which starts
from the previous plan. The random numbers are those of Park and Miller, from one seed, so runs repeat.

- Measured: the full state, and the disturbance if there is an observer. It uses a preview of the path.
- Assumed: gravity; masses are not used.
- Certain: the method, without its cost on the distance from zero input: plans are drawn about the previous
  plan. Model and cost are ours.
- Limits: a constant disturbance that no observer estimates leaves an error.

References
----------
Williams, Aldrich, Theodorou, J. Guidance Control Dyn. 40 (2017). Random numbers: Park and Miller, Comm. ACM
31 (1988).
"""

from math import cos, exp, log, pi, sqrt

import numpy as np
from numba import carray

from cranectl.controllers.common import rope_acceleration, state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots
from cranectl.signals import (
    ALPHA,
    BETA,
    BRIDGE,
    MEASUREMENT,
    REFERENCE,
    ROPE,
    ROPE_RATE,
    STATE,
    TROLLEY,
    X,
    Z,
)
from cranectl.status import RunStatus
from cranectl.support.jit import jit

EVERY = 20  # control periods from plan to plan, and per step of a plan
PATHS = 256
STEPS = 48
KNOTS = 7
PER_KNOT = STEPS // (KNOTS - 1)

PARAMETERS = Slots(period=1, gravity=1, noise=1, temperature=1, rate=1, effort=1, rope_pole=1)
MEMORY = Slots(seed=1, planned=2 * KNOTS)
ROW, MEASURED, STATES = len(REFERENCE), len(MEASUREMENT), len(STATE)
FIRST_SEED = 20170131.0


@jit
def uniform(memory):
    """Return a uniform random number between 0 and 1.

    The products are integers below 2^46, which are exact as doubles.
    """
    memory[MEMORY.seed] = (16807.0 * memory[MEMORY.seed]) % 2147483647.0
    return memory[MEMORY.seed] / 2147483647.0


@jit
def normal(memory):
    """Return a normal random number with mean 0 and standard deviation 1 (Box and Muller)."""
    radius = sqrt(-2.0 * log(uniform(memory)))
    return radius * cos(2.0 * pi * uniform(memory))


@jit
def between(knots, k):
    """Return the input v [m/s²] at step `k` of a plan."""
    first = min(k // PER_KNOT, KNOTS - 2)
    share = (k - PER_KNOT * first) / PER_KNOT
    return knots[first] + share * (knots[first + 1] - knots[first])


@jit
def cost(parameters, lengths, start, push, knots):
    """Return S of a plan from `start` = (x, x', b, b'); `lengths` (STEPS, 2) has l [m] and l' [m/s]."""
    period, gravity = parameters[PARAMETERS.period], parameters[PARAMETERS.gravity]
    x, x_rate, b, b_rate = start[0], start[1], start[2], start[3]
    total = 0.0
    for k in range(STEPS):
        v, length, rate = between(knots, k), lengths[k, 0], lengths[k, 1]
        b_rate += period * (push - (gravity * b + 2.0 * rate * b_rate + v) / length)
        x_rate += period * v
        b += period * b_rate
        x += period * x_rate
        error, error_rate = x + length * b, x_rate + length * b_rate + rate * b
        total += (error / length) ** 2 + parameters[PARAMETERS.rate] * error_rate**2 / (gravity * length)
        total += parameters[PARAMETERS.effort] * (v / gravity) ** 2
    return total / STEPS


@jit
def plan(parameters, lengths, start, push, knots, memory, paths):
    """Replace `knots` (KNOTS,) by the weighted average of `paths` random plans around them."""
    tried, costs = np.empty((paths, KNOTS)), np.empty(paths)
    for i in range(paths):
        for j in range(KNOTS):
            tried[i, j] = knots[j] + parameters[PARAMETERS.noise] * parameters[PARAMETERS.gravity] * normal(
                memory
            )
        costs[i] = cost(parameters, lengths, start, push, tried[i])
    least, total = costs.min(), 0.0
    knots[:] = 0.0
    for i in range(paths):
        weight = exp((least - costs[i]) / parameters[PARAMETERS.temperature])
        total += weight
        for j in range(KNOTS):
            knots[j] += weight * tried[i, j]
    for j in range(KNOTS):
        knots[j] /= total


def step(parameters, measured, reference, memory, command):
    """Plan once, and return the accelerations (3,) [m/s²] that start the plan, from state and path."""
    stored, rows = carray(memory, (MEMORY.size,)), carray(reference, ((1 + EVERY * STEPS) * ROW,))
    measurement = carray(measured, (MEASURED,))
    desired, inputs, later = np.empty(STATES), np.empty(3), np.empty(3)
    lengths, start = np.empty((STEPS, 2)), np.empty(4)
    gravity = parameters[PARAMETERS.gravity]
    for k in range(STEPS, -1, -1):
        row = rows[EVERY * k * ROW : (EVERY * k + 1) * ROW]
        if not state_on_path(row, gravity, desired, inputs if k == 0 else later):
            return RunStatus.SLACK_ROPE
        if k > 0:
            lengths[k - 1, 0], lengths[k - 1, 1] = desired[ROPE], desired[ROPE_RATE]
    for axis in range(2):
        joint, angle, push = (BRIDGE, BETA, 11) if axis == X else (TROLLEY, ALPHA, 10)
        start[:2] = measurement[joint : joint + 2] - desired[joint : joint + 2]
        start[2:] = measurement[angle : angle + 2] - desired[angle : angle + 2]
        knots = stored[MEMORY.planned + KNOTS * axis : MEMORY.planned + KNOTS * (axis + 1)]
        plan(parameters, lengths, start, measurement[push], knots, stored, PATHS)
        command[axis] = inputs[axis] + knots[0]
        for j in range(KNOTS):  # the next plan starts one step later
            knots[j] = between(knots, min(j * PER_KNOT + 1, STEPS))
    pole = parameters[PARAMETERS.rope_pole] * sqrt(gravity / measurement[ROPE])
    command[Z] = rope_acceleration(pole, measurement, desired, inputs[Z])
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    parameters = PARAMETERS.array(period=nominal.period, gravity=nominal.rig.gravity, **nominal.parameters)
    return parameters, MEMORY.array(seed=FIRST_SEED)


MPPI = Controller(
    name="mppi",
    title="model predictive path integral control about the flat path",
    step=step,
    prepare=prepare,
    reads=("gravity",),
    every=EVERY,
    preview=EVERY * STEPS,
    parameters=(
        Parameter("noise", 0.02, "g", "deviation of the knots", 1e-6, 10.0, search=(0.005, 0.2)),
        Parameter("temperature", 1e-4, "1", "of the weights", 1e-12, 1e3, search=(1e-6, 1e-2)),
        Parameter("rate", 0.3, "1", "weight of the error's rate", 0.0, 1e3, search=(0.03, 3.0)),
        Parameter("effort", 1.0, "1", "weight of the input", 0.0, 1e3, search=(0.1, 10.0)),
        Parameter("rope_pole", 1.0, "sqrt(g/l)", "double pole of the rope", 0.0, 1e3, search=(0.3, 6.0)),
    ),
)

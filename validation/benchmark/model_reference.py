"""`model-reference`: a bounded robust term makes the crane follow a model of itself under state feedback.

    cranectl run fast-diagonal --controller validation/benchmark/model_reference.py:MODEL_REFERENCE

Lengths are in units of l, times of sqrt(l/g) and accelerations of g. For each horizontal axis near plumb, x =
(drive, rate, angle, rate) is the deviation from the state that the flat map gives for the path, and u the
deviation from its input:

    x' = A x + B (u + w)    x_m' = A_m x_m    A_m = A - B K, all poles at -a
    u = -K x - rho B'P e / (|B'P e| + delta)    e = x - x_m    A_m'P + P A_m = -I

The model starts at the first measurement. V = e'P e falls while |e|² > 2 rho delta, for any matched
disturbance w with |w| <= rho. A constant w leaves K e + rho sigma/(|sigma| + delta) = w with sigma = B'P e.
The rope has two poles at -a sqrt(g/l) and no robust term.

- Measured: the full state.
- Assumed: slow hoisting; masses are not used.
- Certain: the structure. The numbers of the source were not accessible. It considers a planar crane with
  matched uncertainty.
- Limits: a disturbance of the load is not matched. A constant one leaves the error of the same equation, with
  w = 0 and the rope's lean in e.

References
----------
Cho and others (2008), by Lyapunov's method.
"""

from math import sqrt

import numpy as np
from numba import carray
from scipy.linalg import solve_continuous_lyapunov

from cranectl.controllers.common import rope_acceleration, state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, Signal, X, Z
from cranectl.status import RunStatus
from cranectl.support.arrays import round_digits
from cranectl.support.jit import jit

# Each axis has four numbers: drive, rate, angle, rate.
PARAMETERS = Slots(period=1, gravity=1, pole=1, bound=1, layer=1, gain=4, costate=4)
MEMORY = Slots(model=8, desired=10, inputs=3, error=8, begun=1)


@jit
def scaled(row, deviation, place, length, pole):
    """Return the product of `row` (4,) and the deviation (4,) from index `place`, in units of the model."""
    total = row[0] * deviation[place] / length + row[1] * deviation[place + 1] / (length * pole)
    return total + row[2] * deviation[place + 2] + row[3] * deviation[place + 3] / pole


@jit
def advance_model(parameters, model, place, length, acceleration):
    """Advance the model by one period under a constant acceleration [m/s²], by a method of order 2."""
    period, gravity = parameters[PARAMETERS.period], parameters[PARAMETERS.gravity]
    model[place] += period * (model[place + 1] + 0.5 * period * acceleration)
    model[place + 1] += period * acceleration
    middle = model[place + 2] + 0.5 * period * model[place + 3]
    swing = -(gravity * middle + acceleration) / length
    model[place + 2] += period * (model[place + 3] + 0.5 * period * swing)
    model[place + 3] += period * swing


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations (3,) [m/s²] of one sample from state and path."""
    stored = carray(memory, (MEMORY.size,))
    model, error = stored[: MEMORY.desired], stored[MEMORY.error : MEMORY.begun]
    desired, inputs = stored[MEMORY.desired : MEMORY.inputs], stored[MEMORY.inputs : MEMORY.error]
    gravity, length = parameters[PARAMETERS.gravity], measured[ROPE]
    if not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    numbers = carray(parameters, (PARAMETERS.size,))
    gain, costate = numbers[PARAMETERS.gain : PARAMETERS.costate], numbers[PARAMETERS.costate :]
    pole = sqrt(gravity / length)
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        place = 4 * axis
        for i in range(4):
            source = joint + i if i < 2 else angle + i - 2
            deviation = measured[source] - desired[source]
            if stored[MEMORY.begun] == 0.0:
                model[place + i] = deviation
            error[place + i] = deviation - model[place + i]
        sigma = scaled(costate, error, place, length, pole)
        model_acceleration = -gravity * scaled(gain, model, place, length, pole)
        feedback = scaled(gain, error, place, length, pole)
        feedback += parameters[PARAMETERS.bound] * sigma / (abs(sigma) + parameters[PARAMETERS.layer])
        command[axis] = inputs[axis] + model_acceleration - gravity * feedback
        advance_model(parameters, model, place, length, model_acceleration)
    stored[MEMORY.begun] = 1.0
    command[Z] = rope_acceleration(parameters[PARAMETERS.pole] * pole, measured, desired, inputs[Z])
    return 0


def model_and_cost(pole):
    """Return A_m (4, 4), B (4,), K (4,) and P (4, 4), in units of l, sqrt(l/g) and g."""
    a = np.array([[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]], float)
    b = np.array([0.0, 1.0, 0.0, -1.0])
    gain = np.array([pole**4, 4 * pole**3, 1 + pole**4 - 6 * pole**2, 4 * pole**3 - 4 * pole])
    closed = a - np.outer(b, gain)
    return closed, b, gain, solve_continuous_lyapunov(closed.T, -np.eye(4))


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    pole, bound, layer = (float(nominal.parameters[name]) for name in ("pole", "bound", "layer"))
    _, b, gain, cost = model_and_cost(pole)
    parameters = PARAMETERS.array(
        period=nominal.period,
        gravity=nominal.rig.gravity,
        pole=pole,
        bound=bound,
        layer=layer,
        gain=gain,
        costate=round_digits(b @ cost),
    )
    return parameters, MEMORY.array()


MODEL_REFERENCE = Controller(
    name="model-reference",
    title="state feedback held to its model by a bounded robust term, flat path as feed-forward",
    step=step,
    prepare=prepare,
    reads=("gravity",),
    parameters=(
        Parameter("pole", 0.7, "1", "a, of all four poles, over sqrt(g/l)", 0.01, 100.0, search=(0.2, 2.0)),
        Parameter("bound", 0.05, "1", "rho, over g", 0.0, 100.0, search=(0.005, 0.5)),
        Parameter("layer", 0.05, "1", "delta", 1e-9, 1e3, search=(0.0015, 0.5)),
    ),
    logged=MEMORY.logged(
        error=(
            Signal(f"model_error_{name}_{what}", f"e_{name}{i}", unit, f"to the model, {said}")
            for name in "xy"
            for i, (what, unit, said) in enumerate(
                (
                    ("drive", "m", "drive"),
                    ("rate", "m/s", "its rate"),
                    ("angle", "rad", "angle"),
                    ("swing", "rad/s", "its rate"),
                )
            )
        )
    ),
)

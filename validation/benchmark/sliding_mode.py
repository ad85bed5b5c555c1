"""`sliding-mode-observer`: first-order sliding mode on actuated and swing errors, with a Luenberger observer.

    cranectl run fast-diagonal --controller validation/benchmark/sliding_mode.py:SLIDING_MODE_OBSERVER

Source: the structure of Almutairi and Zribi, J. Vibration and Control 15 (2009); their gains could not be
read. Per horizontal axis, with e the drive's and b the angle's deviation from the state that the flat map
gives for the path, u_d its input, p = sqrt(g/l),

    s = e' + lambda e - kappa b        lambda = p l_1, kappa = l p l_2
    u = u_d - lambda e' + kappa b' - W s - K sat(s/phi)    W = p w, K = g k, phi = l p f

so s' = -W s - K sat(s/phi): it comes in finite time into the layer |s| < phi, where its pole is -(W + K/phi);
on s = 0 those of the crane are the roots of (r² + 1)(r + l_1) + l_2 r², times p, by default three at
-p/sqrt(3). The rope has s = e' + p e. The paper commands forces; the loop makes them of u for force drives.
Only positions are measured. The observer has two poles at -o p of each drive, -o p +- i p of the angles, with
p of the path's beginning, and predicts with the equations of motion. Assumes: slow hoisting; masses are not
used. Measures: encoders. Certain: the structure. A standing push that leans the rope by b leaves e near kappa
b / lambda, 8 l b by default: neither surface nor observer integrates.
"""

from math import exp, sqrt

import numpy as np
from numba import carray

from cranectl.controllers.controller import Controller, Logged, Parameter
from cranectl.controllers.observer import (
    JOINTS,
    POSITION,
    VELOCITY,
    Observer,
    correct,
    initial_estimate,
    predict,
)
from cranectl.model.flatness import state_and_input
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, ROPE, TROLLEY, Signal, X, Y, Z
from cranectl.support.jit import jit

# Places of parameters and memory.
PERIOD, GRAVITY, POSITION_GAIN, VELOCITY_GAIN, SLOPE, SWAY_SLOPE, REACH, SWITCH, LAYER = range(9)
DESIRED, INPUT, SURFACE, BEGUN, MEMORY = 15, 25, 28, 31, 32


@jit
def pushed_back(parameters, surface, length):
    """-W s - K sat(s/phi) [m/s²] at a rope length [m]."""
    gravity = parameters[GRAVITY]
    share = surface / (parameters[LAYER] * sqrt(gravity * length))
    switched = parameters[SWITCH] * min(max(share, -1.0), 1.0)
    return -parameters[REACH] * sqrt(gravity / length) * surface - gravity * switched


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. Encoders and path in, accelerations out."""
    held = carray(memory, (MEMORY,))
    estimate, desired, inputs = held[:DESIRED], held[DESIRED:INPUT], held[INPUT:SURFACE]
    gravity = parameters[GRAVITY]
    observer = Observer(
        parameters[POSITION_GAIN], parameters[VELOCITY_GAIN], 0.0, parameters[PERIOD], gravity
    )
    for joint in range(JOINTS):
        if held[BEGUN] == 0.0:
            estimate[POSITION + joint] = measured[joint]
        correct(observer, joint, measured[joint], estimate)
    held[BEGUN] = 1.0
    length = estimate[POSITION + 2]
    if reference[ACCELERATION + Z] + gravity <= 0.0 or reference[Z] >= 0.0 or length <= 0.0:
        return 2
    state_and_input(reference, gravity, desired, inputs)
    pole = sqrt(gravity / length)
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        error = estimate[POSITION + joint // 2] - desired[joint]
        rate = estimate[VELOCITY + joint // 2] - desired[joint + 1]
        swing = estimate[POSITION + angle // 2] - desired[angle]
        swing_rate = estimate[VELOCITY + angle // 2] - desired[angle + 1]
        forgets, sways = parameters[SLOPE] * pole, parameters[SWAY_SLOPE] * pole * length
        held[SURFACE + axis] = rate + forgets * error - sways * swing
        inputs[axis] += sways * swing_rate - forgets * rate
    rate = estimate[VELOCITY + 2] - desired[ROPE + 1]
    held[SURFACE + Z] = rate + pole * (length - desired[ROPE])
    inputs[Z] -= pole * rate
    for axis in range(3):
        inputs[axis] += pushed_back(parameters, held[SURFACE + axis], length)
        command[axis] = inputs[axis]
    predict(observer, inputs, estimate)
    return 0


def prepare(nominal):
    """Parameters and memory."""
    names = ("slope", "sway_slope", "reach", "switch", "layer")
    given = [float(nominal.parameters[name]) for name in names]
    gravity, period = nominal.rig.gravity, nominal.period
    bandwidth = float(nominal.parameters["observer"]) * sqrt(gravity / nominal.state[ROPE])
    decay = exp(-bandwidth * period)
    memory = np.zeros(MEMORY)
    memory[:DESIRED] = initial_estimate(nominal.state)
    return np.array([period, gravity, 1.0 - decay**2, (1.0 - decay) ** 2 / period, *given]), memory


SLIDING_MODE_OBSERVER = Controller(
    name="sliding-mode-observer",
    title="sliding mode with sway in its surface and a boundary layer, Luenberger observer on encoders",
    step=step,
    prepare=prepare,
    measures="encoders",
    parameters=(
        Parameter("slope", 0.19245, "1", "l_1, lambda over sqrt(g/l)", 0.0, 1e3, search=(0.05, 1.0)),
        Parameter("sway_slope", 1.5396, "1", "l_2, kappa over sqrt(g l)", 0.0, 1e3, search=(0.3, 6.0)),
        Parameter("reach", 2.0, "1", "w, W over sqrt(g/l)", 0.0, 1e3, search=(0.2, 10.0)),
        Parameter("switch", 0.05, "1", "k, K over g", 0.0, 1e3, search=(0.005, 0.5)),
        Parameter("layer", 0.02, "1", "f, phi over sqrt(g l)", 1e-6, 1e3, search=(0.005, 0.2)),
        Parameter("observer", 10.0, "1", "o, over sqrt(g/l)", 0.1, 1e3, search=(3.0, 30.0)),
    ),
    logged=tuple(
        Logged(SURFACE + k, Signal(f"surface_{axis}", f"s_{axis}", "m/s", f"sliding surface, {axis}"))
        for k, axis in ((X, "x"), (Y, "y"), (Z, "l"))
    ),
)

"""`quasi-pid`: PID control of each drive with bounded force, and with more damping while the rope swings.

    cranectl run fast-diagonal --controller validation/benchmark/quasi_pid.py:QUASI_PID

e is the drive's deviation from the set-point in units of l, e' its rate in units of √(g l), b' the rope's
rate in units of √(g/l), and time is in units of √(l/g):

    F = -k_p tanh e - (k_d + k_b tanh² b') tanh e' - k_i tanh o,    o = c² e + c integral of tanh e

So |F| < k_p + k_d + k_b + k_i. With the crane's energy E as in `energy-coupling`, at constant rope length,

    V = E + sum of l (k_p log cosh e + k_i/c² log cosh o)
    V' = -sum of √(g l) ((k_d + k_b tanh² b') e' tanh e' - k_i/c tanh o tanh e)

Only the integral causes the last term. Without it V falls. The winch is a servo.

- Measured: the full state.
- Assumed: masses, for the winch only.
- Certain: the form, read from a published collection. The source has a double pendulum; here is its form for
  a single pendulum and both axes. The scaling by l is ours.
- Limits: a constant disturbance whose pull is less than k_i leaves no error of the drive. The load is off by
  the rope's lean.

References
----------
Sun, Yang, Fang, Wu and Chen, IEEE Trans. Systems, Man, Cybernetics 49 (2019).
"""

from math import tanh

import numpy as np

from cranectl.controllers.common import AXIS_MASSES, MASSES, masses_at, winch_servo
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.model.dynamics import axis_masses
from cranectl.signals import ALPHA_RATE, BETA_RATE, ROPE, X

PARAMETERS = Slots(
    masses=MASSES, period=1, length=1, pace=1, cross=1, hoist=1, spring=2, damper=2, swing=2, integral=2
)
MEMORY = Slots(sum=2)


def step(parameters, measured, reference, memory, command):
    """Compute the forces (3,) [N] of one sample from state and set-point."""
    length, pace, cross = (
        parameters[PARAMETERS.length],
        parameters[PARAMETERS.pace],
        parameters[PARAMETERS.cross],
    )
    for axis in range(2):
        error = (measured[2 * axis] - reference[axis]) / length
        rate = measured[2 * axis + 1] / (pace * length)
        swing = tanh(measured[BETA_RATE if axis == X else ALPHA_RATE] / pace)
        offset = cross * (cross * error + memory[MEMORY.sum + axis])
        damper = parameters[PARAMETERS.damper + axis] + parameters[PARAMETERS.swing + axis] * swing * swing
        command[axis] = -parameters[PARAMETERS.spring + axis] * tanh(error) - damper * tanh(rate)
        command[axis] -= parameters[PARAMETERS.integral + axis] * tanh(offset)
        memory[MEMORY.sum + axis] += parameters[PARAMETERS.period] * pace * tanh(error)
    masses = masses_at(parameters, PARAMETERS.masses)
    winch_servo(masses, parameters[PARAMETERS.hoist], measured, reference, command)
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    masses, length, settings = axis_masses(nominal.rig), nominal.state[ROPE], nominal.parameters
    pace = np.sqrt(masses.gravity / length)
    weight = masses.gravity * (np.array([masses.bridge, masses.trolley]) + masses.load)
    parameters = PARAMETERS.array(
        masses=masses,
        period=nominal.period,
        length=length,
        pace=pace,
        cross=settings["cross"],
        hoist=settings["hoist"] * pace,
        **{name: settings[name] * weight for name in ("spring", "damper", "swing", "integral")},
    )
    return parameters, MEMORY.array()


QUASI_PID = Controller(
    name="quasi-pid",
    title="PID of bounded force on the drives, damped more as the rope swings",
    step=step,
    prepare=prepare,
    reads=AXIS_MASSES,
    command="force",
    follows="set-point",
    parameters=(
        Parameter(
            "spring", 0.15, "1", "k_p, over the weight of drive and load", 0.0, 10.0, search=(0.02, 3.0)
        ),
        Parameter("damper", 0.5, "1", "k_d, over the same", 0.0, 10.0, search=(0.05, 3.0)),
        Parameter("swing", 1.0, "1", "k_b, over the same", 0.0, 100.0, search=(0.1, 10.0)),
        Parameter("integral", 0.01, "1", "k_i, over the same", 0.0, 10.0, search=(0.001, 0.1)),
        Parameter("cross", 0.1, "1", "c, error and its integral in o", 1e-3, 100.0, search=(0.02, 1.0)),
        Parameter("hoist", 0.7, "1", "pole of the winch's servo, over √(g/l)", 0.0, 100.0, search=(0.2, 5.0)),
    ),
    logged=MEMORY.logged(sum=per_axis("error_integral", "eta", "1", "of tanh e")),
)

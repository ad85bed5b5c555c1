"""`swing-damping-servo`: a position servo for each axis with swing feedback, with gains by pole placement.

    cranectl run fast-diagonal --controller validation/benchmark/swing_damping_servo.py:SWING_DAMPING_SERVO

e is the drive's deviation from the load's path (x, y), b is the rope's angle and l its length:

    u = x_d'' - k_p e - k_d e' + k_b b + k_w b'

The crane l b'' = -g b - u has the polynomial

    l r⁴ + (l k_d + k_w) r³ + (l k_p + g + k_b) r² + g k_d r + g k_p

All four roots are -p, at every constant length, for

    k_p = l p⁴/g    k_d = 4 l p³/g    k_w = 4 l p - l k_d    k_b = 6 l p² - l k_p - g

The rope has the gains -p² and -2 p.

- Measured: the full state.
- Assumed: slow hoisting; masses are not used.
- Certain: the structure: position servos, swing feedback on the linearised crane, and a servo of the hoist.
  The gains of the source come from loop shaping.
- Limits: there is no integral, so a constant disturbance that leans the rope by b leaves e = k_b b / k_p.

References
----------
Lee, J. Dyn. Sys. Meas. Control 120 (1998).
"""

from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, ROPE, TROLLEY, VELOCITY, X, Z
from cranectl.support.jit import jit

PARAMETERS = Slots(gravity=1, pole=1)


@jit
def gains(length, gravity, pole):
    """Return k_p [1/s²], k_d [1/s], k_b [m/s²], k_w [m/s] at a rope length [m]."""
    k_p, k_d = length * pole**4 / gravity, 4.0 * length * pole**3 / gravity
    return k_p, k_d, 6.0 * length * pole**2 - length * k_p - gravity, 4.0 * length * pole - length * k_d


def step(parameters, measured, reference, memory, command):  # noqa: ARG001  (as of all controllers)
    """Compute the accelerations (3,) [m/s²] of one sample from state and path."""
    k_p, k_d, k_b, k_w = gains(measured[ROPE], parameters[PARAMETERS.gravity], parameters[PARAMETERS.pole])
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        command[axis] = reference[ACCELERATION + axis] - k_p * (measured[joint] - reference[axis])
        command[axis] -= k_d * (measured[joint + 1] - reference[VELOCITY + axis])
        command[axis] += k_b * measured[angle] + k_w * measured[angle + 1]
    pole = parameters[PARAMETERS.pole]
    command[Z] = -reference[ACCELERATION + Z] - pole * pole * (measured[ROPE] + reference[Z])
    command[Z] -= 2.0 * pole * (measured[ROPE + 1] + reference[VELOCITY + Z])
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    return PARAMETERS.array(gravity=nominal.rig.gravity, **nominal.parameters), []


SWING_DAMPING_SERVO = Controller(
    name="swing-damping-servo",
    title="position servos with swing feedback, four equal poles at every rope length",
    step=step,
    prepare=prepare,
    reads=("gravity",),
    parameters=(
        Parameter(
            "pole", 2.5, "1/s", "p, all poles are at -p", 0.0, 1e3, search=(0.8, 12.0), length_power=-0.5
        ),
    ),
)

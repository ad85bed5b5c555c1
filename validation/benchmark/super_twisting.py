"""`super-twisting`: Levant's second-order sliding mode of drive and swing, with feed-forward of the path.

    cranectl run fast-diagonal --controller validation/benchmark/super_twisting.py:SUPER_TWISTING

For each horizontal axis near plumb, the deviations e of the drive and b of the angle refer to the state that
the flat map gives for the path. u_d is the input for the path:

    s = e' + lambda e - kappa b
    u = u_d - lambda e' + kappa b' - k_1 |s|^(1/2) sgn(s) + w,    w' = -k_2 sgn(s)

On s = 0 the crane l b'' = -g b - e'' has the polynomial (l r² + g)(r + lambda) + kappa r². Its three roots
are -p at every rope length l for lambda = p/3, kappa = 8 p l/3, p = sqrt(g/3l). The rope's surface is e' +
lambda e.

- Measured: the full state.
- Assumed: slow hoisting, which the polynomial neglects; masses are not used.
- Certain: the algorithm. The surface is ours, because that of the source on cranes was not accessible. So the
  controller has the name of the method.
- Limits: the surface has no integral, so a constant disturbance that leans the rope by b leaves e = 8 l b.
  With the period T, s stays below k_1² T².

References
----------
Levant, Int. J. Control 58 (1993). On a crane: Vázquez, Fridman and Collado (2013).
"""

from math import sqrt

from numba import carray

from cranectl.controllers.common import state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, X, Z
from cranectl.status import RunStatus
from cranectl.support.jit import jit

PARAMETERS = Slots(period=1, gravity=1, root_gain=1, twist_gain=1, rope_pole=1)
MEMORY = Slots(integral=3, surface=3, desired=10, inputs=3)


@jit
def slopes(length, gravity):
    """Return lambda [1/s] and kappa [m/s] of the surface at a rope length [m]."""
    pole = sqrt(gravity / (3.0 * length))
    return pole / 3.0, 8.0 * pole * length / 3.0


@jit
def twisting_term(parameters, memory, axis, surface):
    """Return -k_1 |s|^(1/2) sgn(s) + w of an axis [m/s²], and advance w by one period."""
    sign = 1.0 if surface > 0.0 else -1.0 if surface < 0.0 else 0.0
    found = memory[MEMORY.integral + axis] - parameters[PARAMETERS.root_gain] * sqrt(abs(surface)) * sign
    memory[MEMORY.integral + axis] -= parameters[PARAMETERS.period] * parameters[PARAMETERS.twist_gain] * sign
    memory[MEMORY.surface + axis] = surface
    return found


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations (3,) [m/s²] of one sample from state and path."""
    stored = carray(memory, (MEMORY.size,))
    desired, inputs = stored[MEMORY.desired : MEMORY.inputs], stored[MEMORY.inputs :]
    gravity = parameters[PARAMETERS.gravity]
    if not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    slope, sway_slope = slopes(measured[ROPE], gravity)
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        rate = measured[joint + 1] - desired[joint + 1]
        surface = rate + slope * (measured[joint] - desired[joint])
        surface -= sway_slope * (measured[angle] - desired[angle])
        command[axis] = inputs[axis] - slope * rate + sway_slope * (measured[angle + 1] - desired[angle + 1])
        command[axis] += twisting_term(parameters, stored, axis, surface)
    rate = measured[ROPE + 1] - desired[ROPE + 1]
    surface = rate + parameters[PARAMETERS.rope_pole] * (measured[ROPE] - desired[ROPE])
    command[Z] = (
        inputs[Z] - parameters[PARAMETERS.rope_pole] * rate + twisting_term(parameters, stored, Z, surface)
    )
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    parameters = PARAMETERS.array(period=nominal.period, gravity=nominal.rig.gravity, **nominal.parameters)
    return parameters, MEMORY.array()


SUPER_TWISTING = Controller(
    name="super-twisting",
    title="super-twisting sliding mode with sway in its surface, flat path as feed-forward",
    step=step,
    prepare=prepare,
    reads=("gravity",),
    parameters=(
        Parameter(
            "root_gain",
            1.5,
            "m^0.5/s^1.5",
            "k_1 on the root of the surface",
            0.0,
            1e3,
            search=(0.1, 10.0),
            length_power=-0.25,
        ),
        Parameter(
            "twist_gain",
            1.1,
            "m/s³",
            "k_2, rate of what holds against constant pushes",
            0.0,
            1e3,
            search=(0.03, 10.0),
            length_power=-0.5,
        ),
        Parameter(
            "rope_pole",
            3.0,
            "1/s",
            "lambda of the rope's surface",
            0.0,
            1e3,
            search=(0.5, 20.0),
            length_power=-0.5,
        ),
    ),
    logged=MEMORY.logged(surface=per_axis("surface", "s", "m/s", "sliding surface", "xyl")),
)

"""`hierarchical-sliding-mode`: sliding mode on the sum of a surface of the drive and a surface of the swing.

    cranectl run fast-diagonal --controller validation/benchmark/hierarchical_sliding_mode.py:HIERARCHICAL

The deviations e of the drive and b of the angle refer to the state that the flat map gives for the path:

    s_1 = e' + c_1 e,    s_2 = L (b' + c_2 b),    S = s_1 - a s_2,    S' = -k S - r sgn S

The controller computes the acceleration for this S' from the rope's exact equations, while hoisting too. On S
= 0 the crane l b'' = -g b - e'' has the polynomial (l r² + g) (r + c_1) + a L (r + c_2) r². At l = L all its
roots are -p for

    p = √(g / (3 L (1 + a))),    c_1 = p/3,    c_2 = p (3 (1 + a) - 1/3) / a

It is stable at every length because c_2 > c_1 > 0. S is zero after the time log(1 + k |S_0| / r) / k. The
rope has only s_1, with c_1 = hoist √(g/L). sgn takes the sign of the next sample, which keeps S at zero.

- Measured: the full state.
- Assumed: gravity; masses are not used.
- Certain: the method. The source has a planar crane with constant rope length L and forces; here are both
  axes and accelerations. The numbers are ours.
- Limits: a constant disturbance that leans the rope by b changes S by a L g b / l per second, and r must be
  larger. Then e = (8 + 9 a) L b remains.

References
----------
Qian and Yi, Hierarchical Sliding Mode Control for Under-actuated Cranes (2016).
"""

from math import cos, sqrt

from numba import carray

from cranectl.controllers.common import state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.model.dynamics import angular_accelerations
from cranectl.signals import (
    ALPHA,
    ALPHA_RATE,
    BETA,
    BETA_RATE,
    BRIDGE,
    ROPE,
    ROPE_RATE,
    TROLLEY,
    X,
    Y,
    Z,
)
from cranectl.status import RunStatus
from cranectl.support.jit import jit

PARAMETERS = Slots(period=1, gravity=1, lever=1, c_1=1, c_2=1, hoist=1, decay=1, reach=1)
MEMORY = Slots(surface=3, desired=10, inputs=3)


def surface_numbers(length, gravity, share):
    """Return c_1 and c_2 [1/s] that give three equal poles at a rope length [m]."""
    pole = sqrt(gravity / (3.0 * length * (1.0 + share)))
    return pole / 3.0, pole * (3.0 * (1.0 + share) - 1.0 / 3.0) / share


@jit
def swing(state, u_x, u_y, gravity):
    """Return the accelerations of alpha and beta [rad/s²] in `state` (10,) for drive accelerations [m/s²]."""
    alpha, alpha_rate, beta, beta_rate = state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE]
    return angular_accelerations(
        state[ROPE], state[ROPE_RATE], alpha, alpha_rate, beta, beta_rate, u_x, u_y, gravity
    )


@jit
def reaching_term(parameters, surface):
    """Return -k S - r sgn S [m/s²], where sgn takes the sign of S after one period."""
    rest = surface / parameters[PARAMETERS.period] - parameters[PARAMETERS.decay] * surface
    return -parameters[PARAMETERS.decay] * surface - min(
        max(rest, -parameters[PARAMETERS.reach]), parameters[PARAMETERS.reach]
    )


@jit
def slide(parameters, measured, stored, joint, angle):
    """Return S [m/s], and the part of S' that does not depend on accelerations [m/s²], of an axis."""
    c_1, lever, c_2 = parameters[PARAMETERS.c_1], parameters[PARAMETERS.lever], parameters[PARAMETERS.c_2]
    e, e_rate = (
        measured[joint] - stored[MEMORY.desired + joint],
        measured[joint + 1] - stored[MEMORY.desired + joint + 1],
    )
    b, b_rate = (
        measured[angle] - stored[MEMORY.desired + angle],
        measured[angle + 1] - stored[MEMORY.desired + angle + 1],
    )
    return e_rate + c_1 * e - lever * (b_rate + c_2 * b), c_1 * e_rate - lever * c_2 * b_rate


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations (3,) [m/s²] of one sample from state and path."""
    stored = carray(memory, (MEMORY.size,))
    gravity, lever, length = parameters[PARAMETERS.gravity], parameters[PARAMETERS.lever], measured[ROPE]
    desired, inputs = stored[MEMORY.desired : MEMORY.inputs], stored[MEMORY.inputs :]
    if not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    expected = swing(desired, inputs[X], inputs[Y], gravity)
    cos_beta = cos(measured[BETA])

    surface, drift = slide(parameters, measured, stored, TROLLEY, ALPHA)
    drift -= lever * (swing(measured, 0.0, 0.0, gravity)[0] - expected[0])
    gain = 1.0 + lever * cos(measured[ALPHA]) / (length * cos_beta)
    command[Y] = (inputs[Y] - drift + reaching_term(parameters, surface)) / gain
    stored[MEMORY.surface + Y] = surface

    surface, drift = slide(parameters, measured, stored, BRIDGE, BETA)
    drift -= lever * (swing(measured, 0.0, command[Y], gravity)[1] - expected[1])
    command[X] = (inputs[X] - drift + reaching_term(parameters, surface)) / (1.0 + lever * cos_beta / length)
    stored[MEMORY.surface + X] = surface

    rate = measured[ROPE_RATE] - desired[ROPE_RATE]
    stored[MEMORY.surface + Z] = rate + parameters[PARAMETERS.hoist] * (length - desired[ROPE])
    command[Z] = (
        inputs[Z]
        - parameters[PARAMETERS.hoist] * rate
        + reaching_term(parameters, stored[MEMORY.surface + Z])
    )
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    gravity, length, settings = nominal.rig.gravity, nominal.state[ROPE], nominal.parameters
    pace, share = sqrt(gravity / length), settings["share"]
    c_1, c_2 = surface_numbers(length, gravity, share)
    parameters = PARAMETERS.array(
        period=nominal.period,
        gravity=gravity,
        lever=share * length,
        c_1=c_1,
        c_2=c_2,
        hoist=settings["hoist"] * pace,
        decay=settings["decay"] * pace,
        reach=settings["reach"] * gravity,
    )
    return parameters, MEMORY.array()


HIERARCHICAL = Controller(
    name="hierarchical-sliding-mode",
    title="sliding mode on the sum of a drive's and a rope's surface, flat path as feed-forward",
    step=step,
    prepare=prepare,
    reads=("gravity",),
    parameters=(
        Parameter("share", 0.3, "1", "a, of the rope's surface in S", 1e-3, 100.0, search=(0.05, 3.0)),
        Parameter("hoist", 1.0, "1", "c_1 of the rope, over √(g/L)", 0.0, 100.0, search=(0.2, 5.0)),
        Parameter("decay", 1.0, "1", "k, over √(g/L)", 0.0, 100.0, search=(0.1, 10.0)),
        Parameter("reach", 0.03, "1", "r, over g", 0.0, 10.0, search=(0.001, 0.3)),
    ),
    logged=MEMORY.logged(surface=per_axis("surface", "S", "m/s", "sliding surface", "xyl")),
)

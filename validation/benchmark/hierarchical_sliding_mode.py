"""`hierarchical-sliding-mode`: a surface of the drive, one of the rope, and their sum, which is reached.

    cranectl run fast-diagonal --controller validation/benchmark/hierarchical_sliding_mode.py:HIERARCHICAL

Source: the method of Qian and Yi, Hierarchical Sliding Mode Control for Under-actuated Cranes (2016),
planar with a rope of constant length L and forces; here both axes, with accelerations. With e what the
drive, b what the angle is off the state that the flat map gives for the path,

    s_1 = e' + c_1 e,    s_2 = L (b' + c_2 b),    S = s_1 - a s_2,    S' = -k S - r sgn S

for which the acceleration is found from the rope's equations, exactly, while the rope is hoisted too. On S
= 0 the crane l b'' = -g b - e'' has the polynomial (l r² + g) (r + c_1) + a L (r + c_2) r². At l = L its
roots are all -p by

    p = √(g / (3 L (1 + a))),    c_1 = p/3,    c_2 = p (3 (1 + a) - 1/3) / a

and it is stable at every length, for c_2 > c_1 > 0. S is zero after log(1 + k |S_0| / r) / k. The rope has
s_1 alone, with c_1 = hoist √(g/L). sgn is that of the next sample, by which S stays zero. Assumes: full
state; masses are not used. Certain: the method; ours: its numbers. A standing push that leans the rope by b
pulls at S with a L g b / l: r must be more; then e = (8 + 9 a) L b is left.
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

GIVEN = Slots(period=1, gravity=1, lever=1, forgets=1, swings=1, hoist=1, decay=1, reach=1)
MEMORY = Slots(surface=3, desired=10, inputs=3)


def surface_numbers(length, gravity, share):
    """Return (c_1, c_2) [1/s] for three equal poles at a rope length [m]."""
    pole = sqrt(gravity / (3.0 * length * (1.0 + share)))
    return pole / 3.0, pole * (3.0 * (1.0 + share) - 1.0 / 3.0) / share


@jit
def swing(state, u_x, u_y, gravity):
    """Return the accelerations of alpha and beta [rad/s²] in `state` (10,) under the drives' [m/s²]."""
    alpha, alpha_rate, beta, beta_rate = state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE]
    return angular_accelerations(
        state[ROPE], state[ROPE_RATE], alpha, alpha_rate, beta, beta_rate, u_x, u_y, gravity
    )


@jit
def reached(parameters, surface):
    """Return -k S - r sgn S, with the sign that S has after a period."""
    rest = surface / parameters[GIVEN.period] - parameters[GIVEN.decay] * surface
    return -parameters[GIVEN.decay] * surface - min(
        max(rest, -parameters[GIVEN.reach]), parameters[GIVEN.reach]
    )


@jit
def slide(parameters, measured, held, joint, angle):
    """Return (S, S' less what the accelerations of drive and angle give) of a horizontal axis."""
    forgets, lever, swings = parameters[GIVEN.forgets], parameters[GIVEN.lever], parameters[GIVEN.swings]
    e, e_rate = (
        measured[joint] - held[MEMORY.desired + joint],
        measured[joint + 1] - held[MEMORY.desired + joint + 1],
    )
    b, b_rate = (
        measured[angle] - held[MEMORY.desired + angle],
        measured[angle + 1] - held[MEMORY.desired + angle + 1],
    )
    return e_rate + forgets * e - lever * (b_rate + swings * b), forgets * e_rate - lever * swings * b_rate


def step(parameters, measured, reference, memory, command):
    """Take one sample; see `controller`. State and path in, accelerations out."""
    held = carray(memory, (MEMORY.size,))
    gravity, lever, length = parameters[GIVEN.gravity], parameters[GIVEN.lever], measured[ROPE]
    desired, inputs = held[MEMORY.desired : MEMORY.inputs], held[MEMORY.inputs :]
    if not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    wanted = swing(desired, inputs[X], inputs[Y], gravity)
    cos_beta = cos(measured[BETA])

    surface, drift = slide(parameters, measured, held, TROLLEY, ALPHA)
    drift -= lever * (swing(measured, 0.0, 0.0, gravity)[0] - wanted[0])
    gain = 1.0 + lever * cos(measured[ALPHA]) / (length * cos_beta)
    command[Y] = (inputs[Y] - drift + reached(parameters, surface)) / gain
    held[MEMORY.surface + Y] = surface

    surface, drift = slide(parameters, measured, held, BRIDGE, BETA)
    drift -= lever * (swing(measured, 0.0, command[Y], gravity)[1] - wanted[1])
    command[X] = (inputs[X] - drift + reached(parameters, surface)) / (1.0 + lever * cos_beta / length)
    held[MEMORY.surface + X] = surface

    rate = measured[ROPE_RATE] - desired[ROPE_RATE]
    held[MEMORY.surface + Z] = rate + parameters[GIVEN.hoist] * (length - desired[ROPE])
    command[Z] = inputs[Z] - parameters[GIVEN.hoist] * rate + reached(parameters, held[MEMORY.surface + Z])
    return 0


def prepare(nominal):
    """Return parameters and memory."""
    gravity, length, given = nominal.rig.gravity, nominal.state[ROPE], nominal.parameters
    pace, share = sqrt(gravity / length), given["share"]
    forgets, swings = surface_numbers(length, gravity, share)
    parameters = GIVEN.array(
        period=nominal.period,
        gravity=gravity,
        lever=share * length,
        forgets=forgets,
        swings=swings,
        hoist=given["hoist"] * pace,
        decay=given["decay"] * pace,
        reach=given["reach"] * gravity,
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
        Parameter("reach", 0.03, "1", "r, over g", 0.0, 10.0, search=(0.003, 0.3)),
    ),
    logged=MEMORY.logged(surface=per_axis("surface", "S", "m/s", "sliding surface", "xyl")),
)

"""`barrier-tracking`: the drives follow the load's path within a fixed distance, while hoisting too.

    cranectl run fast-diagonal --controller validation/benchmark/barrier_tracking.py:BARRIER_TRACKING

For bridge, trolley and rope, e is the deviation from the path of a load that hangs plumb:

    F = -k_p e - 2 L Z² e / (Z² - e²)² - k_d e' - f sgn e' + F_d

The second term is minus the derivative of the barrier L e² / (Z² - e²), which is infinite at |e| = Z. F_d is
the feed-forward for the path, with the drives' own masses M, the rope's direction n and W = (0, 0, m g):

    F_d = M q_d'' + m (b_x, b_y, b·n) - W,    b = c_d'' + l_d'' n + l_d' n',    c_d = (x_d, y_d, 0)

Let E be the crane's energy with the rates (e', a', b') of errors and angles in place of the rates. Then V = E
+ sum of (k_p e² / 2 + L e² / (Z² - e²)) has the derivative

    V' = -sum of (k_d e'² + f |e'|) + m l_d' (g (1 + n_z) - l n'·n') - m l n'·c_d''

So V falls wherever the path is at rest, and is bounded if the path is finite. Hence |e| stays below Z. Here L
= share k_p Z²/2, and tanh(e'/v) with v = √(g l)/100 replaces sgn e'.

- Measured: the full state.
- Assumed: known masses, and |e| < Z at the start.
- Certain: the structure; V' was derived here. F_d is ours.
- Limits: under a constant disturbance, which leans the rope, an error remains. There k_p and the barrier
  balance the rope's tension.

References
----------
Sun and Fang, Automatica 50 (2014), for a planar crane.
"""

from math import tanh

import numpy as np

from cranectl.controllers.common import AXIS_MASSES, MASSES, masses_at
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.model.dynamics import axis_masses, rope_direction, rope_direction_rate
from cranectl.signals import ACCELERATION, ALPHA, ALPHA_RATE, BETA, BETA_RATE, ROPE, VELOCITY, X, Y, Z
from cranectl.support.jit import jit

PARAMETERS = Slots(masses=MASSES, share=1, bound=1, soft=1, stiffness=3, damping=3, friction=3)
MEMORY = Slots(error=3)


@jit
def barrier_force(stiffness, bound, error):
    """Return the barrier's force -2 L Z² e / (Z² - e²)² [N], where 2 L = `stiffness` Z² and Z = `bound`."""
    room = 1.0 - (error / bound) ** 2
    return -stiffness * error / room**2


@jit
def feedback(parameters, axis, error, rate):
    """Return the force of one axis without the feed-forward F_d [N]."""
    stiffness = parameters[PARAMETERS.stiffness + axis]
    barrier = barrier_force(parameters[PARAMETERS.share] * stiffness, parameters[PARAMETERS.bound], error)
    damped = parameters[PARAMETERS.damping + axis] * rate + parameters[PARAMETERS.friction + axis] * tanh(
        rate / parameters[PARAMETERS.soft]
    )
    return barrier - stiffness * error - damped


def step(parameters, measured, reference, memory, command):
    """Compute the forces (3,) [N] of one sample from state and path."""
    masses = masses_at(parameters, PARAMETERS.masses)
    load = masses.load
    n = rope_direction(measured[ALPHA], measured[BETA])
    n_rate = rope_direction_rate(measured[ALPHA], measured[ALPHA_RATE], measured[BETA], measured[BETA_RATE])
    u_x, u_y, u_l = reference[ACCELERATION], reference[ACCELERATION + Y], -reference[ACCELERATION + Z]
    pay_out = -reference[VELOCITY + Z]
    along = n[0] * u_x + n[1] * u_y + u_l  # because n has length 1, and n' is normal to n
    feed_forward_x = (masses.bridge + load) * u_x + load * (u_l * n[0] + pay_out * n_rate[0])
    feed_forward_y = (masses.trolley + load) * u_y + load * (u_l * n[1] + pay_out * n_rate[1])
    feed_forward_l = masses.winch * u_l + load * (along - masses.gravity)
    for axis in range(3):
        feed_forward = feed_forward_x if axis == X else feed_forward_y if axis == Y else feed_forward_l
        sign = -1.0 if axis == Z else 1.0
        error = measured[2 * axis] - sign * reference[axis]
        rate = measured[2 * axis + 1] - sign * reference[VELOCITY + axis]
        command[axis] = feed_forward + feedback(parameters, axis, error, rate)
        memory[MEMORY.error + axis] = error
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    rig, length, settings = nominal.rig, nominal.state[ROPE], nominal.parameters
    pace, inertia = np.sqrt(rig.gravity / length), rig.driven_masses
    stiffness = inertia * (settings["frequency"] * pace) ** 2
    damping = inertia * 2.0 * settings["damping"] * settings["frequency"] * pace
    parameters = PARAMETERS.array(
        masses=axis_masses(rig),
        share=settings["barrier"],
        bound=settings["bound"] * length,
        soft=0.01 * pace * length,
        stiffness=stiffness,
        damping=damping,
        friction=settings["friction"] * rig.gravity * inertia,
    )
    return parameters, MEMORY.array()


BARRIER_TRACKING = Controller(
    name="barrier-tracking",
    title="drives on the load's path as springs and dampers, with a barrier at a largest error",
    step=step,
    prepare=prepare,
    reads=(*AXIS_MASSES, "driven_masses"),
    command="force",
    parameters=(
        Parameter(
            "frequency",
            1.0,
            "1",
            "√(k_p/M_d), M_d what a drive moves, over √(g/l) of the start",
            0.0,
            10.0,
            search=(0.2, 5.0),
        ),
        Parameter("damping", 0.4, "1", "k_d/√(4 k_p M_d)", 0.0, 10.0, search=(0.05, 4.0)),
        Parameter("bound", 0.5, "1", "Z, in rope lengths of the start", 1e-6, 100.0, search=(0.2, 2.0)),
        Parameter("barrier", 0.3, "1", "2 L/Z² over k_p", 0.0, 100.0, search=(0.03, 3.0)),
        Parameter("friction", 0.002, "1", "f, over the weight of what moves", 0.0, 1.0, search=(2e-4, 2e-2)),
    ),
    logged=MEMORY.logged(error=per_axis("drive_error", "e", "m", "of the drive", "xyl")),
)

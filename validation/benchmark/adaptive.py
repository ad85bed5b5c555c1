"""`adaptive`: adaptive control of the drives after Slotine and Li, which estimates the masses.

    cranectl run fast-diagonal --controller validation/benchmark/adaptive.py:ADAPTIVE --drive force

With the swing eliminated, the equations of motion of the drives are P q'' + w = F
(`cranectl.model.dynamics`). They are linear in the masses M = (bridge and trolley, trolley, winch, load):

    P = D + m N Nᵀ,    w = m h N

D is the diagonal matrix of the first three masses, N = (n_x, n_y, 1) contains the rope's direction n, m is
the mass of the load, and h is the rope's specific force while the drives do not accelerate. With estimates
marked by ^, the controller is

    q_r' = q_d' - lambda e + kappa b,    s = q' - q_r'
    F = P^ q_r'' + w^ - dP^/dt s/2 - K s = Y M^ - K s,    M^' = -Gamma Yᵀ s
    V = (s·P s + (M^ - M)·Gamma^-1 (M^ - M))/2,    V' = -s·K s

The deviations e of the drive and b of the angle refer to the state that the flat map gives for the path.
lambda = p/3 and kappa = 8 p l/3 with p = √(g/3l) place all poles on s = 0 at -p, see `super_twisting.py`.

- Measured: the full state.
- Assumed: constant masses. The estimates start at the nominal masses.
- Certain: the method and V. The sway in s is ours. The published regressor for cranes was not accessible, so
  the controller has the name of the method.
- Limits: the masses converge only as far as the motion excites them. Under a force that no mass explains they
  drift, and may become negative. There is no integral, so a constant disturbance that leans the rope by b
  leaves e = 8 l b.

References
----------
Slotine and Li, Int. J. Robotics Research 6 (1987). For cranes: Yang and others (2009, 2011).
"""

from math import sqrt

import numpy as np
from numba import carray

from cranectl.controllers.common import AXIS_MASSES, state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.model.dynamics import axis_masses, rope_direction, rope_direction_rate, specific_rope_force
from cranectl.signals import (
    ALPHA,
    ALPHA_RATE,
    BETA,
    BETA_RATE,
    BRIDGE,
    ROPE,
    ROPE_RATE,
    TROLLEY,
    Signal,
    X,
    Y,
    Z,
)
from cranectl.status import RunStatus
from cranectl.support.jit import jit

LOAD = 3  # index in the masses: bridge and trolley, trolley, winch, load
PARAMETERS = Slots(period=1, gravity=1, slope=1, sway_slope=1, rope_pole=1, gain=3, adaptation=4)
MEMORY = Slots(mass=4, surface=3, desired=10, inputs=3, required=3)


@jit
def follow(parameters, measured, stored, joint, angle):
    """Return s [m/s] and q_r'' [m/s²] of the horizontal axis `joint` whose rope swings by `angle`."""
    length, rate = measured[ROPE], 0.5 * measured[ROPE_RATE] / measured[ROPE]
    pole = sqrt(parameters[PARAMETERS.gravity] / (3.0 * length))
    slope, sway_slope = parameters[PARAMETERS.slope] * pole, parameters[PARAMETERS.sway_slope] * pole * length
    e, e_rate = (
        measured[joint] - stored[MEMORY.desired + joint],
        measured[joint + 1] - stored[MEMORY.desired + joint + 1],
    )
    b, b_rate = (
        measured[angle] - stored[MEMORY.desired + angle],
        measured[angle + 1] - stored[MEMORY.desired + angle + 1],
    )
    required = (
        stored[MEMORY.inputs + joint // 2] - slope * (e_rate - rate * e) + sway_slope * (b_rate + rate * b)
    )
    return e_rate + slope * e - sway_slope * b, required


def step(parameters, measured, reference, memory, command):
    """Compute the forces (3,) [N] of one sample from state and path."""
    stored = carray(memory, (MEMORY.size,))
    mass, s, required = (
        stored[: MEMORY.surface],
        stored[MEMORY.surface : MEMORY.desired],
        stored[MEMORY.required :],
    )
    gravity = parameters[PARAMETERS.gravity]
    desired, inputs = stored[MEMORY.desired : MEMORY.inputs], stored[MEMORY.inputs : MEMORY.required]
    if not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    s[X], required[X] = follow(parameters, measured, stored, BRIDGE, BETA)
    s[Y], required[Y] = follow(parameters, measured, stored, TROLLEY, ALPHA)
    rate = measured[ROPE_RATE] - desired[ROPE_RATE]
    s[Z] = rate + parameters[PARAMETERS.rope_pole] * (measured[ROPE] - desired[ROPE])
    required[Z] = inputs[Z] - parameters[PARAMETERS.rope_pole] * rate
    alpha, alpha_rate, beta, beta_rate = (
        measured[ALPHA],
        measured[ALPHA_RATE],
        measured[BETA],
        measured[BETA_RATE],
    )
    n = rope_direction(alpha, beta)
    turn = rope_direction_rate(alpha, alpha_rate, beta, beta_rate)
    pull = specific_rope_force(
        measured[ROPE], alpha, alpha_rate, beta, beta_rate, required[X], required[Y], required[Z], gravity
    )
    along, turning = n[0] * s[X] + n[1] * s[Y] + s[Z], turn[0] * s[X] + turn[1] * s[Y]
    # Update the masses first, so that V falls in the sampled loop too.
    for axis in range(3):
        mass[axis] -= (
            parameters[PARAMETERS.period]
            * parameters[PARAMETERS.adaptation + axis]
            * required[axis]
            * s[axis]
        )
    mass[LOAD] -= (
        parameters[PARAMETERS.period] * parameters[PARAMETERS.adaptation + LOAD] * along * (pull - turning)
    )
    for axis in range(3):
        direction, change = (1.0, 0.0) if axis == Z else (n[axis], turn[axis])
        reaction = direction * (pull - 0.5 * turning) - 0.5 * change * along
        command[axis] = (
            mass[axis] * required[axis] + mass[LOAD] * reaction - parameters[PARAMETERS.gain + axis] * s[axis]
        )
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory; the memory contains the nominal masses."""
    rig, length, settings = nominal.rig, nominal.state[ROPE], nominal.parameters
    pace, believed = np.sqrt(rig.gravity / length), np.array(axis_masses(rig)[:4])
    parameters = PARAMETERS.array(
        period=nominal.period,
        gravity=rig.gravity,
        slope=settings["position"],
        sway_slope=settings["sway"],
        rope_pole=settings["rope_pole"] * pace,
        gain=settings["gain"] * pace * rig.driven_masses,
        adaptation=settings["adaptation"] * believed / (rig.gravity * length),
    )
    return parameters, MEMORY.array(mass=believed)


ADAPTIVE = Controller(
    name="adaptive",
    title="Slotine-Li adaptive law on the drives' rows, with sway in its surface",
    step=step,
    prepare=prepare,
    reads=(*AXIS_MASSES, "driven_masses"),
    command="force",
    parameters=(
        Parameter("position", 1.0 / 3.0, "1", "lambda over p", 0.0, 100.0, search=(0.1, 4.0)),
        Parameter("sway", 8.0 / 3.0, "1", "kappa over p l", 0.0, 100.0, search=(0.25, 8.0)),
        Parameter("rope_pole", 1.0, "1", "lambda of the rope, over √(g/l)", 0.0, 100.0, search=(0.2, 5.0)),
        Parameter(
            "gain",
            2.0,
            "1",
            "K, over what each drive moves and √(g/l) of the start",
            0.0,
            1e3,
            search=(0.2, 10.0),
        ),
        Parameter(
            "adaptation",
            1.0,
            "1",
            "Gamma, over the masses and 1/(g l) of the start",
            0.0,
            1e3,
            search=(0.1, 10.0),
        ),
    ),
    logged=MEMORY.logged(
        mass=[
            Signal("bridge_mass", "M_1", "kg", "as it is learnt, bridge and trolley"),
            Signal("trolley_mass", "M_2", "kg", "as it is learnt, trolley"),
            Signal("winch_mass", "M_3", "kg", "as it is learnt, winch"),
            Signal("load_mass", "M_4", "kg", "as it is learnt, load"),
        ],
        surface=per_axis("surface", "s", "m/s", "of the drive", "xyl"),
    ),
)

"""`adrc`: active disturbance rejection with an extended state observer for each of five double integrators.

    cranectl run fast-diagonal --controller validation/benchmark/adrc.py:ADRC

Each axis is described by double integrators: of the load's position z, and of the angle b in which the rope
of length l swings along the axis. All other effects are a disturbance f:

    z'' = -g b + f_z    b'' = -u/l + f_b    z_3'' = -u_l + f_3

f_b contains the gravity -g b/l of the pendulum too. Each observer has three poles at -w_o and takes f for
constant. With e = z_d - z, and with z'' = -g b + f_z and z''' = -g b' from the observers, the inputs are

    v = z_d'''' + 4 w_c e''' + 6 w_c² e'' + 4 w_c³ e' + w_c⁴ e
    u = l (f_b + v/g)    u_l = f_3 - z_d3'' - 2 w_c e_3' - w_c² e_3

They give four poles at -w_c to each horizontal coordinate of the load, and two to its height. u and u_l are
limited as the drives are: otherwise the observers would take the limits of the drives for a disturbance. w_c
= c sqrt(g/l) with the rope length l at the start of the path, and w_o = o w_c.

- Measured: encoders.
- Assumed: gravity and the limits of the drives; masses are not used.
- Certain: the method. That each axis has two double integrators is ours.
- Limits: a constant disturbance is contained in f_z and f_b, so it leaves no error. The estimates lag where f
  changes fast, as on a fast path.

References
----------
Han, IEEE Trans. Ind. Electron. 56 (2009). The two bandwidths: Gao, ACC 2003. The flatness approach:
Ramírez-Neria and others, ISA Trans. 53 (2014).
"""

from math import sqrt

from numba import carray

from cranectl.controllers.common import saturate
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.observer import EXPECTED, JOINTS, Observer, advance, correct, make_observer
from cranectl.controllers.slots import Slots, per_axis
from cranectl.model.dynamics import rope_direction
from cranectl.signals import ACCELERATION, JERK, ROPE, SNAP, VELOCITY, Signal, X, Z
from cranectl.support.jit import jit

# Double integrators, in the order of the observer's joints: load x, y, z, alpha, beta.
PARAMETERS = Slots(bandwidth=1, observer=len(Observer._fields), limit=3)
MEMORY = Slots(chains=EXPECTED.size, begun=1)


@jit
def read_chains(observer, measured, estimate, begun):
    """Correct the estimates by the encoders' readings (5,); start them there if `begun` is False."""
    direction = rope_direction(measured[3], measured[4])
    for chain in range(JOINTS):
        position = measured[chain]
        if chain < 2:
            position += measured[2] * direction[chain]
        elif chain == 2:
            position = measured[2] * direction[2]
        if not begun:
            estimate[EXPECTED.position + chain] = position
        correct(observer, chain, position, estimate)


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations (3,) [m/s²] of one sample from encoders and path."""
    estimate, w = carray(memory, (MEMORY.size,)), parameters[PARAMETERS.bandwidth]
    numbers, at = parameters, PARAMETERS.observer
    observer = Observer(numbers[at], numbers[at + 1], numbers[at + 2], numbers[at + 3], numbers[at + 4])
    read_chains(observer, measured, estimate, estimate[MEMORY.begun] == 1.0)
    estimate[MEMORY.begun] = 1.0
    gravity, period, length = observer.gravity, observer.period, measured[2]
    for axis in range(2):
        angle = 4 if axis == X else 3
        load = reference[axis] - estimate[EXPECTED.position + axis]
        rate = reference[VELOCITY + axis] - estimate[EXPECTED.velocity + axis]
        pulled = -gravity * estimate[EXPECTED.position + angle]
        acceleration = reference[ACCELERATION + axis] - pulled - estimate[EXPECTED.disturbance + axis]
        jerk = reference[JERK + axis] + gravity * estimate[EXPECTED.velocity + angle]
        v = reference[SNAP + axis] + w * (4.0 * jerk + w * (6.0 * acceleration + w * (4.0 * rate + w * load)))
        unsaturated = length * (estimate[EXPECTED.disturbance + angle] + v / gravity)
        command[axis] = saturate(unsaturated, parameters[PARAMETERS.limit + axis])
        # Predict with the acceleration of the load in the middle of the period.
        pulled -= 0.5 * period * gravity * estimate[EXPECTED.velocity + angle]
        advance(estimate, axis, pulled, period)
        advance(estimate, angle, -command[axis] / length, period)
    lifted = reference[ACCELERATION + Z] + 2.0 * w * (
        reference[VELOCITY + Z] - estimate[EXPECTED.velocity + Z]
    )
    lifted += w * w * (reference[Z] - estimate[EXPECTED.position + Z])
    command[Z] = saturate(estimate[EXPECTED.disturbance + Z] - lifted, parameters[PARAMETERS.limit + Z])
    advance(estimate, Z, -command[Z], period)
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory; the load starts with the rates of the path."""
    pole = sqrt(nominal.rig.gravity / nominal.state[ROPE])
    bandwidth = float(nominal.parameters["bandwidth"]) * pole
    fast = float(nominal.parameters["observer"]) * bandwidth
    observer = make_observer(fast, period=nominal.period, gravity=nominal.rig.gravity)
    limits = nominal.rig.effects.limits.acceleration
    rates = [*nominal.reference[0, VELOCITY : VELOCITY + 3], *nominal.state[[7, 9]]]
    parameters = PARAMETERS.array(bandwidth=bandwidth, observer=observer, limit=limits)
    return parameters, MEMORY.array(chains=EXPECTED.array(velocity=rates))


ADRC = Controller(
    name="adrc",
    title="active disturbance rejection: extended state observers of load and angles on encoders",
    step=step,
    prepare=prepare,
    reads=("gravity", "limits"),
    measures="encoders",
    parameters=(
        Parameter("bandwidth", 0.7, "1", "c, w_c over sqrt(g/l)", 0.01, 100.0, search=(0.2, 2.0)),
        Parameter("observer", 10.0, "1", "o, w_o over w_c", 0.1, 1e3, search=(3.0, 40.0)),
    ),
    logged=EXPECTED.logged(
        disturbance=(
            *per_axis("disturbance", "f", "m/s²", "on the load", "xyz"),
            Signal("disturbance_alpha", "f_alpha", "rad/s²", "on the angle alpha"),
            Signal("disturbance_beta", "f_beta", "rad/s²", "on the angle beta"),
        )
    ),
)

"""`adrc`: active disturbance rejection, an extended state observer on each of five chains of two integrators.

    cranectl run fast-diagonal --controller validation/benchmark/adrc.py:ADRC

Source: Han, IEEE Trans. Ind. Electron. 56 (2009), with two bandwidths as Gao has it, ACC 2003. That a crane
takes two chains per axis, load and angle, is ours, after the flatness approach of Ramírez-Neria and others,
ISA Trans. 53 (2014). With z the load, b the angle that swings along the axis, l the rope length, all else is
a disturbance f, which an observer with three poles at -w_o takes for a constant:

    z'' = -g b + f_z    b'' = -u/l + f_b    z_3'' = -u_l + f_3

With e = z_d - z, of which z'' is -g b + f_z and z''' is -g b' by the observers, the load has four poles at
-w_c, its height two, under

    v = z_d'''' + 4 w_c e''' + 6 w_c² e'' + 4 w_c³ e' + w_c⁴ e
    u = l (f_b + v/g)    u_l = f_3 - z_d3'' - 2 w_c e_3' - w_c² e_3

Both u are cut off at the drives' limits, or the observers would take for a push what drives do not do.
f_b holds the pendulum's own -g b/l. w_c is c sqrt(g/l) with l where the path begins, w_o is o w_c. Assumes:
nothing of masses. Measures: encoders. Certain: the method. A push that stands is in f_z and f_b and leaves
nothing; where f changes fast, as on a fast path, it is late.
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

# Chains: load x, y, z, then alpha, beta, as the observer's joints.
GIVEN = Slots(bandwidth=1, observer=len(Observer._fields), limit=3)
MEMORY = Slots(chains=EXPECTED.size, begun=1)


@jit
def read_chains(observer, measured, estimate, begun):
    """Correct all chains by the readings (5,) of the encoders; before the first, begin at them."""
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
    """Take one sample; see `controller`. Encoders and path in, accelerations out."""
    estimate, w = carray(memory, (MEMORY.size,)), parameters[GIVEN.bandwidth]
    given, at = parameters, GIVEN.observer
    observer = Observer(given[at], given[at + 1], given[at + 2], given[at + 3], given[at + 4])
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
        wanted = length * (estimate[EXPECTED.disturbance + angle] + v / gravity)
        command[axis] = saturate(wanted, parameters[GIVEN.limit + axis])
        # Over the period the rope pulls as it does in its middle.
        pulled -= 0.5 * period * gravity * estimate[EXPECTED.velocity + angle]
        advance(estimate, axis, pulled, period)
        advance(estimate, angle, -command[axis] / length, period)
    lifted = reference[ACCELERATION + Z] + 2.0 * w * (
        reference[VELOCITY + Z] - estimate[EXPECTED.velocity + Z]
    )
    lifted += w * w * (reference[Z] - estimate[EXPECTED.position + Z])
    command[Z] = saturate(estimate[EXPECTED.disturbance + Z] - lifted, parameters[GIVEN.limit + Z])
    advance(estimate, Z, -command[Z], period)
    return 0


def prepare(nominal):
    """Return parameters and memory; the load's rates are the path's."""
    pole = sqrt(nominal.rig.gravity / nominal.state[ROPE])
    bandwidth = float(nominal.parameters["bandwidth"]) * pole
    fast = float(nominal.parameters["observer"]) * bandwidth
    observer = make_observer(fast, period=nominal.period, gravity=nominal.rig.gravity)
    limits = nominal.rig.effects.limits.acceleration
    rates = [*nominal.reference[0, VELOCITY : VELOCITY + 3], *nominal.state[[7, 9]]]
    parameters = GIVEN.array(bandwidth=bandwidth, observer=observer, limit=limits)
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

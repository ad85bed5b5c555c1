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

import numpy as np
from numba import carray

from cranectl.controllers.controller import Controller, Logged, Parameter
from cranectl.controllers.observer import (
    DISTURBANCE,
    JOINTS,
    POSITION,
    VELOCITY,
    Observer,
    correct,
    make_observer,
)
from cranectl.model.dynamics import rope_direction
from cranectl.signals import ACCELERATION, JERK, ROPE, SNAP, Signal, X, Y, Z
from cranectl.signals import VELOCITY as RATE
from cranectl.support.jit import jit

# Places of parameters and memory; chains: load x, y, z, then alpha, beta, as the observer's joints.
BANDWIDTH, OBSERVER, LIMIT, MEMORY = 0, 1, 6, 3 * JOINTS + 1
BEGUN = 3 * JOINTS


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
            estimate[POSITION + chain] = position
        correct(observer, chain, position, estimate)


@jit
def go_on(observer, chain, known, estimate):
    """Expect the next sample of a chain, `known` [1/s²] being its acceleration but for the disturbance."""
    period, velocity = observer.period, estimate[VELOCITY + chain]
    acceleration = known + estimate[DISTURBANCE + chain]
    estimate[POSITION + chain] += period * (velocity + 0.5 * period * acceleration)
    estimate[VELOCITY + chain] = velocity + period * acceleration


@jit
def cut(value, limit):
    """The nearest to `value` within +-`limit`."""
    return min(max(value, -limit), limit)


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. Encoders and path in, accelerations out."""
    estimate = carray(memory, (MEMORY,))
    w, given = parameters[BANDWIDTH], parameters
    observer = Observer(
        given[OBSERVER], given[OBSERVER + 1], given[OBSERVER + 2], given[OBSERVER + 3], given[OBSERVER + 4]
    )
    read_chains(observer, measured, estimate, estimate[BEGUN] == 1.0)
    estimate[BEGUN] = 1.0
    gravity, length = observer.gravity, measured[2]
    for axis in range(2):
        angle = 4 if axis == X else 3
        load = reference[axis] - estimate[POSITION + axis]
        rate = reference[RATE + axis] - estimate[VELOCITY + axis]
        pulled = -gravity * estimate[POSITION + angle]
        acceleration = reference[ACCELERATION + axis] - pulled - estimate[DISTURBANCE + axis]
        jerk = reference[JERK + axis] + gravity * estimate[VELOCITY + angle]
        v = reference[SNAP + axis] + w * (4.0 * jerk + w * (6.0 * acceleration + w * (4.0 * rate + w * load)))
        wanted = length * (estimate[DISTURBANCE + angle] + v / gravity)
        command[axis] = cut(wanted, parameters[LIMIT + axis])
        # Over the period the rope pulls as it does in its middle.
        go_on(observer, axis, pulled - 0.5 * observer.period * gravity * estimate[VELOCITY + angle], estimate)
        go_on(observer, angle, -command[axis] / length, estimate)
    lifted = reference[ACCELERATION + Z] + 2.0 * w * (reference[RATE + Z] - estimate[VELOCITY + Z])
    lifted += w * w * (reference[Z] - estimate[POSITION + Z])
    command[Z] = cut(estimate[DISTURBANCE + Z] - lifted, parameters[LIMIT + Z])
    go_on(observer, Z, -command[Z], estimate)
    return 0


def prepare(nominal):
    """Parameters and memory; the load's rates are the path's."""
    pole = sqrt(nominal.rig.gravity / nominal.state[ROPE])
    bandwidth = float(nominal.parameters["bandwidth"]) * pole
    fast = float(nominal.parameters["observer"]) * bandwidth
    observer = make_observer(fast, period=nominal.period, gravity=nominal.rig.gravity)
    memory = np.zeros(MEMORY)
    memory[VELOCITY : VELOCITY + 3] = nominal.reference[0, RATE : RATE + 3]
    memory[VELOCITY + 3 : DISTURBANCE] = nominal.state[[7, 9]]
    return np.array([bandwidth, *observer, *nominal.rig.effects.limits.acceleration]), memory


ADRC = Controller(
    name="adrc",
    title="active disturbance rejection: extended state observers of load and angles on encoders",
    step=step,
    prepare=prepare,
    measures="encoders",
    parameters=(
        Parameter("bandwidth", 0.7, "1", "c, w_c over sqrt(g/l)", 0.01, 100.0, search=(0.2, 2.0)),
        Parameter("observer", 10.0, "1", "o, w_o over w_c", 0.1, 1e3, search=(3.0, 40.0)),
    ),
    logged=tuple(
        Logged(DISTURBANCE + chain, Signal(f"disturbance_{name}", f"f_{name}", unit, f"on the {said}"))
        for chain, name, unit, said in (
            (X, "x", "m/s²", "load, x"),
            (Y, "y", "m/s²", "load, y"),
            (Z, "z", "m/s²", "load, z"),
            (3, "alpha", "rad/s²", "angle alpha"),
            (4, "beta", "rad/s²", "angle beta"),
        )
    ),
)

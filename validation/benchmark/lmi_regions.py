"""`lmi-regions`: state feedback of least H-infinity norm with its poles in a region of the plane.

    cranectl run fast-diagonal --controller validation/benchmark/lmi_regions.py:LMI_REGIONS

Source: the method of Tumari, Saealal, Ghazali and Abdul Wahab for a gantry crane (2013), with the regions of
Chilali and Gahinet, IEEE TAC 41 (1996). With time in units of sqrt(l/g) and lengths in units of l all cranes
are one: per horizontal axis, near plumb, with e the drive's and b the angle's deviation from the state that
the flat map gives for the path, u_d its input, w a push as angular acceleration,

    e'' = u    b'' = -b - u + w    z = (e + b, rho u)    u = -k x, x = (e, e', b, b')

and k = -Y X⁻¹ minimises gamma over symmetric X > 0, with M = A X + B Y, s the sine and c the cosine of the
sector's half angle, under

    [M + M' , B_w, (C X + D Y)'; ., -gamma, 0; ., ., -gamma] < 0    the norm from w to z is below gamma
    M + M' + 2 decay X < 0    [-radius X, M; M', -radius X] < 0     poles left of -decay, within the disk
    [s (M + M'), c (M - M'); c (M' - M), s (M + M')] < 0            damping ratios above c

One k serves every rope: u = u_d - (w² k_1 e + w k_2 e' + g k_3 b + (g/w) k_4 b'), w² = g/l. The rope's length
has a double pole. Assumes: full state, constant or slow rope; masses are not used. Certain: the method; the
paper's motor model, its z and its region are not at hand. One X for all demands is what makes them convex:
gamma is a bound. There is no integral: a push that leans the rope by b leaves the drive e = -b l k_3/k_1 off.
"""

from functools import lru_cache
from math import sqrt

import numpy as np
from numba import carray

from cranectl.controllers.controller import Controller, Parameter
from cranectl.design.discretisation import check_sampled, zero_order_hold
from cranectl.design.linear_systems import poles_text
from cranectl.design.semidefinite import minimise
from cranectl.model.flatness import state_and_input
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, ROPE, TROLLEY, X, Z
from cranectl.support.errors import InputError

# Places of parameters and memory.
GRAVITY, ROPE_POLE, GAIN, NUMBERS = 0, 1, 2, 6
DESIRED, INPUT, MEMORY = 0, 10, 13

NEAR = 1e-4  # outside of the region a pole may lie: inequalities hold to some eight digits, poles to fewer

# The crane of unit length under unit gravity.
A = np.array([[0.0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]])
B = np.array([[0.0], [1], [0], [-1]])
PUSH = np.array([[0.0], [0], [0], [1]])
SEEN = np.array([[1.0, 0, 1, 0], [0, 0, 0, 0]])


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. State and path in, accelerations out."""
    held, k = carray(memory, (MEMORY,)), carray(parameters, (NUMBERS,))[GAIN:]
    desired, inputs = held[DESIRED:INPUT], held[INPUT:MEMORY]
    gravity = parameters[GRAVITY]
    if reference[ACCELERATION + Z] + gravity <= 0.0 or reference[Z] >= 0.0:
        return 2
    state_and_input(reference, gravity, desired, inputs)
    w = sqrt(gravity / measured[ROPE])
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        command[axis] = inputs[axis] - w * w * k[0] * (measured[joint] - desired[joint])
        command[axis] -= w * k[1] * (measured[joint + 1] - desired[joint + 1])
        command[axis] -= gravity * k[2] * (measured[angle] - desired[angle])
        command[axis] -= gravity / w * k[3] * (measured[angle + 1] - desired[angle + 1])
    pole = w * parameters[ROPE_POLE]
    command[Z] = inputs[Z] - pole * pole * (measured[ROPE] - desired[ROPE])
    command[Z] -= 2.0 * pole * (measured[ROPE + 1] - desired[ROPE + 1])
    return 0


@lru_cache
def gains(decay, radius, damping, effort):
    """(k, gamma): k (4,) and the bound of its norm; raises InputError where no k has its poles there."""
    sine = sqrt(1.0 - damping * damping)
    weight = np.array([[0.0], [effort]])

    def inequalities(gamma, x, y):
        m, z, bound = A @ x + B @ y, SEEN @ x + weight @ y, gamma[0, 0]
        both, turn = m + m.T, damping * (m - m.T)
        norm = np.block(
            [
                [both, PUSH, z.T],
                [PUSH.T, -gamma, np.zeros((1, 2))],
                [z, np.zeros((2, 1)), -bound * np.eye(2)],
            ]
        )
        disk = np.block([[-radius * x, m], [m.T, -radius * x]])
        sector = np.block([[sine * both, turn], [turn.T, sine * both]])
        return [norm, both + 2.0 * decay * x, disk, sector, 1e-6 * np.eye(4) - x]

    gamma, x, y = minimise(lambda gamma, *_: gamma[0, 0], inequalities, (1, 1), 4, (1, 4))
    k = -np.linalg.solve(x, y[0])
    poles = np.linalg.eigvals(A - B @ k[np.newaxis])
    ratios = -poles.real / np.abs(poles)
    if (
        poles.real.max() > -decay + NEAR
        or np.abs(poles).max() > radius + NEAR
        or ratios.min() < damping - NEAR
    ):
        raise InputError(
            f"lmi-regions with the poles {poles_text(A - B @ k[np.newaxis])} in units of sqrt(g/l)",
            allowed=f"real parts below {-decay:g}, moduli below {radius:g}, damping ratios above {damping:g}",
            remedy="widen the region in [controller.lmi-regions]: all inequalities share one X",
        )
    return k, float(gamma[0, 0])


def prepare(nominal):
    """Parameters and memory."""
    names = ("decay", "radius", "damping", "effort")
    k, _ = gains(*(float(nominal.parameters[name]) for name in names))
    gravity = nominal.rig.gravity
    period = nominal.period * sqrt(gravity / nominal.rig.rope_range[0])  # the longest that any rope finds it
    phi, hold = zero_order_hold(A, B, period)
    check_sampled("lmi-regions", phi - hold @ k[np.newaxis], period, remedy="lower radius")
    return np.array([gravity, float(nominal.parameters["rope_pole"]), *k]), np.zeros(MEMORY)


LMI_REGIONS = Controller(
    name="lmi-regions",
    title="state feedback of least H-infinity norm, poles in an LMI region, flat path as feed-forward",
    step=step,
    prepare=prepare,
    parameters=(
        Parameter("decay", 0.5, "sqrt(g/l)", "least decay of a pole", 0.0, 10.0, search=(0.2, 1.5)),
        Parameter("radius", 3.0, "sqrt(g/l)", "largest modulus of a pole", 0.1, 1e3, search=(2.0, 10.0)),
        Parameter("damping", 0.6, "1", "least damping ratio of a pole", 0.0, 0.999, search=(0.2, 0.95)),
        Parameter(
            "effort", 1.0, "1", "rho on the drive's acceleration over g", 1e-3, 1e3, search=(0.1, 10.0)
        ),
        Parameter("rope_pole", 1.0, "sqrt(g/l)", "double pole of the rope", 0.0, 1e3, search=(0.3, 6.0)),
    ),
)

"""`lmi-regions`: state feedback with the least H-infinity norm and with its poles in a region of the plane.

    cranectl run fast-diagonal --controller validation/benchmark/lmi_regions.py:LMI_REGIONS

With times in units of sqrt(l/g) and lengths of l, all cranes are equal. For each horizontal axis near plumb,
the deviations e of the drive and b of the angle refer to the state that the flat map gives for the path. u_d
is the input for the path, and w is a disturbance, an angular acceleration:

    e'' = u    b'' = -b - u + w    z = (e + b, rho u)    u = -k x, x = (e, e', b, b')

k = -Y X⁻¹ with a symmetric X > 0 and M = A X + B Y. With the sine s and the cosine c of the sector's half
angle, the requirements are:

    [M + M' , B_w, (C X + D Y)'; ., -gamma, 0; ., ., -gamma] < 0    the norm from w to z is below gamma
    M + M' + 2 decay X < 0    [-radius X, M; M', -radius X] < 0     poles left of -decay, within the disk
    [s (M + M'), c (M - M'); c (M' - M), s (M + M')] < 0            damping ratios above c

The least gamma does not determine k. So gamma is 1.01 times the least one, and X, Y are the analytic centre
of the solutions, which is unique. One k serves every rope length, with w² = g/l:

    u = u_d - (w² k_1 e + w k_2 e' + g k_3 b + (g/w) k_4 b')

The length of the rope has a double pole.

- Measured: the full state.
- Assumed: constant or slowly changing rope length; masses are not used.
- Certain: the method. The motor model, the output z and the region of the paper were not accessible.
- Limits: one X for all requirements makes them convex, so gamma is only an upper bound of the norm. There is
  no integral: a constant disturbance that leans the rope by b leaves the drive off by e = -b l k_3/k_1.

References
----------
Tumari, Saealal, Ghazali and Abdul Wahab (2013), for a gantry crane. The regions: Chilali and Gahinet, IEEE
TAC 41 (1996).
"""

from functools import lru_cache
from math import ceil, floor, log10, sqrt

import numpy as np
from numba import carray
from semidefinite import analytic_centre, minimise

from cranectl.controllers.common import rope_acceleration, state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots
from cranectl.design.discretisation import check_sampled, zero_order_hold
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, X, Z
from cranectl.status import RunStatus
from cranectl.support.arrays import round_digits

PARAMETERS = Slots(gravity=1, rope_pole=1, gain=4)
MEMORY = Slots(desired=10, inputs=3)

BACK_OFF = 1.01  # gamma over the least gamma
DIGITS = 4  # gamma is rounded up to these digits, so that k does not depend on rounding errors in it

# The crane with rope length 1 and gravity 1.
A = np.array([[0.0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]])
B = np.array([[0.0], [1], [0], [-1]])
PUSH = np.array([[0.0], [0], [0], [1]])
SEEN = np.array([[1.0, 0, 1, 0], [0, 0, 0, 0]])


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations (3,) [m/s²] of one sample from state and path."""
    stored, k = carray(memory, (MEMORY.size,)), carray(parameters, (PARAMETERS.size,))[PARAMETERS.gain :]
    desired, inputs = stored[: MEMORY.inputs], stored[MEMORY.inputs :]
    gravity = parameters[PARAMETERS.gravity]
    if not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    w = sqrt(gravity / measured[ROPE])
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        command[axis] = inputs[axis] - w * w * k[0] * (measured[joint] - desired[joint])
        command[axis] -= w * k[1] * (measured[joint + 1] - desired[joint + 1])
        command[axis] -= gravity * k[2] * (measured[angle] - desired[angle])
        command[axis] -= gravity / w * k[3] * (measured[angle + 1] - desired[angle + 1])
    command[Z] = rope_acceleration(w * parameters[PARAMETERS.rope_pole], measured, desired, inputs[Z])
    return 0


@lru_cache
def gains(decay, radius, damping, effort):
    """Return k (4,) and the bound gamma of its norm; lengths in l, times in sqrt(l/g).

    Raises InputError if no k has its poles in the region.
    """
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

    least, _, _ = minimise(lambda gamma, *_: gamma[0, 0], inequalities, (1, 1), 4, (1, 4))
    bound = rounded_up(BACK_OFF * float(least[0, 0]))
    x, y = analytic_centre(lambda x, y: inequalities(np.array([[bound]]), x, y), 4, (1, 4))
    return round_digits(-np.linalg.solve(x, y[0])), bound


def rounded_up(number):
    """Round a positive number up to `DIGITS` digits."""
    unit = 10.0 ** (floor(log10(number)) + 1 - DIGITS)
    return ceil(number / unit) * unit


def prepare(nominal):
    """Return the arrays of parameters and initial memory.

    Raises InputError if the sampled loop is unstable on the shortest rope.
    """
    names = ("decay", "radius", "damping", "effort")
    k, _ = gains(*(float(nominal.parameters[name]) for name in names))
    gravity = nominal.rig.gravity
    period = nominal.period * sqrt(gravity / nominal.rig.rope_range[0])  # on the shortest rope
    phi, hold = zero_order_hold(A, B, period)
    check_sampled("lmi-regions", phi - hold @ k[np.newaxis], period, remedy="lower radius")
    return PARAMETERS.array(
        gravity=gravity, rope_pole=nominal.parameters["rope_pole"], gain=k
    ), MEMORY.array()


LMI_REGIONS = Controller(
    name="lmi-regions",
    title="state feedback of least H-infinity norm, poles in an LMI region, flat path as feed-forward",
    step=step,
    prepare=prepare,
    reads=("gravity", "rope_range"),
    parameters=(
        Parameter("decay", 0.5, "sqrt(g/l)", "least decay of a pole", 0.0, 10.0, search=(0.06, 1.5)),
        Parameter("radius", 3.0, "sqrt(g/l)", "largest modulus of a pole", 0.1, 1e3, search=(0.7, 10.0)),
        Parameter("damping", 0.6, "1", "least damping ratio of a pole", 0.0, 0.999, search=(0.2, 0.95)),
        Parameter(
            "effort", 1.0, "1", "rho on the drive's acceleration over g", 1e-3, 1e3, search=(0.1, 10.0)
        ),
        Parameter("rope_pole", 1.0, "sqrt(g/l)", "double pole of the rope", 0.0, 1e3, search=(0.3, 6.0)),
    ),
)

"""`lqr-offset-free`: LQR about the path of a crane that leans against a disturbance of its load.

A rope pulls its load along itself, for any motion of the drives. So with z₃'' of the path

    z₁'' = -(tan β / cos α)(z₃'' + g) + d₁,    z₂'' = -tan α (z₃'' + g) + d₂.

An observer estimates z, z' and the disturbance d, an acceleration, from the measured joints. It does not use
the commands of the drives. So lags, delays and limits of drives cause no error in it, and nothing winds up
when drives saturate. From the path's acceleration minus d, the flat map gives the state in which the crane
leans so that its load is on the path. This compensates a constant force or a tilted rail; an angle sensor
with an offset b leaves an error of l b. It is the target of offset-free control (Pannocchia and Rawlings,
AIChE J. 49, 2003).

For each horizontal axis, with the drive x and the error e of the observed load, scaled by the length l and
the time 1/p = sqrt(l/g):

    u/g = u_d/g - k₁ (x - x_d)/l - k₂ (x - x_d)'/lp - k₃ e/l - k₄ e'/lp

K minimises the integral of ρ (q_e (e/l)² + q_v (e'/lp)²) + (u/g)². With this scaling one K serves every rope
length and every size of crane. ρ is 1 near the path and smaller where the drive's acceleration is limited.
The path uses a part of that limit, and u_max is the rest. The loop does not leave the ellipsoid through the
present x. ρ is the largest value for which K x stays within u_max on that ellipsoid:
(x·P x)(B·P B) <= u_max², where x·P x is the cost of a state (Megretski, L2 BIBO output feedback stabilization
with saturated control, IFAC 1996). The rope follows its own length, with two equal poles.
"""

from math import inf, sqrt

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from cranectl.controllers.controller import (
    CRANE_STATES,
    Controller,
    LinearController,
    Logged,
    Nominal,
    Parameter,
)
from cranectl.controllers.observer import make_observer
from cranectl.controllers.slots import Slots, per_axis
from cranectl.design import check_sampled, zero_order_hold
from cranectl.model import flat_output, slopes_from_angles, state_and_input
from cranectl.signals import (
    ACCELERATION,
    ALPHA,
    ALPHA_RATE,
    BETA,
    BETA_RATE,
    BRIDGE,
    ROPE,
    ROPE_RATE,
    TROLLEY,
    VELOCITY,
    X,
    Z,
)
from cranectl.status import RunStatus
from cranectl.support import Array, jit

LEVELS = 17  # values of ρ, the smallest first
STATES = 4
PARAMETERS = Slots(period=1, gravity=1, rope_pole=1, observer=3, limit=2, levels=0)
LEVEL = Slots(gain=STATES, ellipsoid=STATES * STATES)  # K, then (B·P B) P
MEMORY = Slots(estimate=6, leaning=15, desired=10, inputs=3, load=12, state=STATES, begun=1)
PUSH = 2  # index of d in the estimate z, z', d of an axis
MIN_FEEDBACK_SHARE = 0.2  # least share of the limit that is left for feedback


@jit
def expect(estimate, specific_force, period):
    """Predict the `estimate` (3,) of an axis one period ahead; `specific_force` is the rope's [m/s²]."""
    acceleration = specific_force + estimate[PUSH]
    estimate[0] += period * (estimate[1] + 0.5 * period * acceleration)
    estimate[1] += period * acceleration


@jit
def reached(parameters, level, state):
    """Return the largest acceleration over g that a level commands on its ellipsoid through `state` (4,)."""
    start = PARAMETERS.levels + LEVEL.size * level + LEVEL.ellipsoid
    total = 0.0
    for i in range(STATES):
        for k in range(STATES):
            total += parameters[start + STATES * i + k] * state[i] * state[k]
    return sqrt(max(total, 0.0))


@jit
def feedback(parameters, state, limit):
    """Return the scaled K x of an axis for `state` (4,) and `limit`, an acceleration over g."""
    level, share = LEVELS - 2, 1.0
    high = reached(parameters, LEVELS - 1, state)
    # From the fullest level down to the two between which the limit is reached.
    while high > limit:
        low = reached(parameters, level, state)
        share = 0.0 if low >= high else min(max((limit - low) / (high - low), 0.0), 1.0)
        if low <= limit or level == 0:
            break
        level, high = level - 1, low
    total = 0.0
    for i in range(STATES):
        first = PARAMETERS.levels + LEVEL.size * level + LEVEL.gain + i
        last = first + LEVEL.size
        total += (parameters[first] + share * (parameters[last] - parameters[first])) * state[i]
    return total


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations of one sample from state and path; see `controller` for the arguments."""
    buffer = carray(memory, (MEMORY.size,))
    leaning, desired = buffer[MEMORY.leaning : MEMORY.desired], buffer[MEMORY.desired : MEMORY.inputs]
    inputs, load = buffer[MEMORY.inputs : MEMORY.load], buffer[MEMORY.load : MEMORY.state]
    state = buffer[MEMORY.state : MEMORY.begun]
    gravity, period, length = parameters[PARAMETERS.gravity], parameters[PARAMETERS.period], measured[ROPE]
    lift = reference[ACCELERATION + Z] + gravity
    if lift <= 0.0 or reference[Z] >= 0.0 or length <= 0.0:
        return RunStatus.SLACK_ROPE
    flat_output(measured, 0.0, 0.0, gravity, load)  # position and velocity need no zeta
    slope_x, slope_y, _, _ = slopes_from_angles(
        measured[ALPHA], measured[ALPHA_RATE], measured[BETA], measured[BETA_RATE]
    )
    for i in range(15):
        leaning[i] = reference[i]
    for axis in range(2):
        estimate = buffer[3 * axis : 3 * axis + 3]
        if buffer[MEMORY.begun] == 0.0:
            estimate[0], estimate[1] = load[axis], load[VELOCITY + axis]
        innovation = load[axis] - estimate[0]
        for i in range(3):
            estimate[i] += parameters[PARAMETERS.observer + i] * innovation
        leaning[ACCELERATION + axis] -= estimate[PUSH]
    buffer[MEMORY.begun] = 1.0
    state_and_input(leaning, gravity, desired, inputs)
    speed = sqrt(gravity * length)
    for axis in range(2):
        estimate, joint = buffer[3 * axis : 3 * axis + 3], BRIDGE if axis == X else TROLLEY
        # The drive follows the path, without d: x_c'' = z'' - (p h)'', with the rope's slope p and drop h.
        command[axis] = inputs[axis] + estimate[PUSH]
        state[0] = (measured[joint] - desired[joint]) / length
        state[1] = (measured[joint + 1] - desired[joint + 1]) / speed
        state[2] = (estimate[0] - reference[axis]) / length
        state[3] = (estimate[1] - reference[VELOCITY + axis]) / speed
        left = max(
            parameters[PARAMETERS.limit + axis] - abs(command[axis]),
            MIN_FEEDBACK_SHARE * parameters[PARAMETERS.limit + axis],
        )
        command[axis] -= gravity * feedback(parameters, state, left / gravity)
        expect(estimate, -lift * (slope_x if axis == X else slope_y), period)
    pole = parameters[PARAMETERS.rope_pole]
    command[Z] = inputs[Z] - pole * (
        pole * (length - desired[ROPE]) + 2.0 * (measured[ROPE_RATE] - desired[ROPE_RATE])
    )
    return 0


# The model of x, x', e, e' near plumb, scaled by l and 1/p: l e'' = g (x - e).
A = np.array([[0.0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [1, 0, -1, 0]])
B = np.array([[0.0], [1], [0], [0]])


def regulator(error_weight: float, rate_weight: float) -> tuple[Array, Array]:
    """Return K (4,) on (x, x', e, e'), and P (4, 4) of the cost of a state.

    Since x = e + e'', the poles are roots of p = s⁴ + k₂ s³ + (1 + k₁) s² + (k₂ + k₄) s + k₁ + k₃, and
    p(s) p(-s) = s⁴ (s² + 1)² - q_v s² + q_e. Its powers give k₂, k₃, k₄ as functions of k₁. The equation that
    remains for k₁ is convex, and its larger root makes p stable. The Riccati equation then gives P. A solver
    of Riccati equations has other last digits on another processor, and fewer that are right.
    """
    root = sqrt(error_weight)
    following = 8.0 * (1.0 + root) + 4.0 * sqrt(rate_weight)  # beyond both roots
    k_1 = inf
    while 0.0 < following < k_1:  # Newton's method descends to the root, until rounding stops it
        k_1 = following
        square = rate_weight + 2.0 * root * (1.0 + k_1)  # (k₂ + k₄)²
        product = 2.0 * sqrt(2.0 * k_1 * square)
        excess = k_1 * k_1 + 2.0 * (k_1 + root) - product
        following = k_1 - excess / (2.0 * (k_1 + 1.0) - 4.0 * (square + 2.0 * root * k_1) / product)
    k_2, k_3 = sqrt(2.0 * k_1), root - k_1
    k_4 = sqrt(rate_weight + 2.0 * root * (1.0 + k_1)) - k_2
    p_14, p_13 = 0.5 * k_1 * k_1, k_2 * k_3 + k_4
    p_34, p_44 = k_1 * k_3 + p_14, k_1 * k_4 - p_13
    gain = np.array([k_1, k_2, k_3, k_4])
    first, third = [k_1 * k_2 - k_4, k_1, p_13, p_14], [p_13, k_3, k_3 * k_4 + p_44, p_34]
    return gain, np.array([first, gain, third, [p_14, k_4, p_34, p_44]])


def frequencies(nominal: Nominal) -> tuple[float, float]:
    """Return the poles of the observer and of the rope [rad/s], on a rope of middle length."""
    middle = 0.5 * sum(nominal.rig.rope_range)
    pendulum = sqrt(nominal.rig.gravity / middle)
    observer_pole, rope_pole = (float(nominal.parameters[name]) for name in ("observer_pole", "rope_pole"))
    return pendulum * observer_pole, pendulum * rope_pole


def levels(nominal: Nominal) -> Array:
    """Return the levels, a row each, for weights from MIN_SCALE times their values up to the full ones."""
    error_weight, rate_weight = (float(nominal.parameters[name]) for name in ("error_weight", "rate_weight"))
    rows = []
    for share in np.geomspace(MIN_SCALE, 1.0, LEVELS):
        gain, cost = regulator(share * error_weight, share * rate_weight)
        rows.append([*gain, *(gain[1] * cost).ravel()])  # B·P B is the second number of K
    return np.array(rows)


def prepare(nominal: Nominal) -> tuple[Array, Array]:
    """Return parameters and memory; raise InputError if the sampled loop would be unstable."""
    table, gravity = levels(nominal), nominal.rig.gravity
    observer_pole, rope_pole = frequencies(nominal)
    # In units of 1/p, in which it is longest on the shortest rope.
    period = nominal.period * sqrt(gravity / nominal.rig.rope_range[0])
    phi, hold = zero_order_hold(A, B, period)
    remedy = "lower error_weight and rate_weight in [controller.lqr-offset-free]"
    check_sampled("lqr-offset-free", phi - hold @ table[-1:, :STATES], nominal.period, remedy=remedy)
    observer = make_observer(observer_pole, period=nominal.period, gravity=gravity)
    limits = nominal.rig.effects.limits.acceleration[:2]
    parameters = PARAMETERS.array(
        period=nominal.period,
        gravity=gravity,
        rope_pole=rope_pole,
        observer=observer[:3],
        limit=limits,
        levels=table,
    )
    return parameters, MEMORY.array()


def linearise(nominal: Nominal, rope_length: float) -> LinearController:
    """Return the linear controller of one horizontal axis at rest, ρ = 1, with the observer's z, z' and d."""
    gravity, period = nominal.rig.gravity, nominal.period
    observer_pole, _ = frequencies(nominal)
    observer = make_observer(observer_pole, period=period, gravity=gravity)
    a = np.zeros((CRANE_STATES + 3, CRANE_STATES + 3))
    a[0, 1] = a[2, 3] = a[4, 5] = a[5, 6] = 1.0
    a[3, 2], a[5, 2] = -gravity / rope_length, -gravity
    # Corrections come once a period, here spread evenly over it.
    for i, correction in enumerate(observer[:3]):
        a[CRANE_STATES + i, [0, 2, 4]] += np.array([1.0, rope_length, -1.0]) * correction / period
    b = np.zeros((len(a), 1))
    b[1], b[3] = 1.0, -1.0 / rope_length
    to_drive, to_rate, to_load, to_load_rate = levels(nominal)[-1, :STATES]
    scale = sqrt(gravity / rope_length)
    position, rate = scale**2 * to_drive, scale * to_rate
    # d moves the drive's desired place by -l d / g: the last is k₁ g / l times l / g.
    gain = [position, rate, 0.0, 0.0, scale**2 * to_load, scale * to_load_rate, to_drive]
    return LinearController(rope_length, a, b, np.array(gain))


MIN_SCALE = 1e-6  # smallest ρ
WEIGHT, POLE = (1e-6, 1e6), (0.01, 100.0)

LQR_OFFSET_FREE = Controller(
    name="lqr-offset-free",
    title="LQR about the path of a crane that leans against observed pushes: no offset, no wind-up",
    step=step,
    prepare=prepare,
    reads=("gravity", "limits", "rope_range"),
    linearise=linearise,
    parameters=(
        Parameter("error_weight", 5.0, "1", "q_e on the load's error over l", *WEIGHT, search=(0.5, 30.0)),
        Parameter("rate_weight", 1.0, "1", "q_v on its rate over sqrt(g l)", *WEIGHT, search=(0.1, 12.0)),
        # A fast observer takes the swing of a load about its hook for a disturbance, and excites it.
        Parameter("observer_pole", 1.5, "1", "three, over sqrt(g/l)", *POLE, search=(0.2, 6.0)),
        Parameter("rope_pole", 1.5, "1", "two, over sqrt(g/l)", *POLE, search=(0.3, 6.0)),
    ),
    logged=tuple(
        Logged(MEMORY.estimate + 3 * k + PUSH, signal)
        for k, signal in enumerate(per_axis("push", "d", "m/s²", "on the load, as observed"))
    ),
)

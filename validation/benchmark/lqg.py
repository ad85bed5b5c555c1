"""`lqg`: LQR on the estimates of a Kalman filter, whose model contains constant disturbances.

    cranectl run fast-diagonal --controller validation/benchmark/lqg.py:LQG

For each horizontal axis near plumb, x is the drive, b the angle, l the rope length and u the commanded
acceleration. The encoders read x and b with noise:

    x'' = u + d_x    l b'' = -g b - (u + d_x) + l d_b    d_x' = w_x    d_b' = w_b

In units of l and 1/p, p = sqrt(g/l), these equations contain no numbers. So one Riccati equation each for
filter and regulator serves every rope length. The noise is chosen such that x and b, each alone and without
gravity, would have three poles of modulus f_x p and f_b p. The filter predicts with the equations of motion,
as the observer of the loop does. With the deviations dx, db from the path and e = dx + l db, K minimises the
integral of q_e (e/l)² + q_v (e'/lp)² + (u/g)²:

    u = u_d - K (dx, dx', db, db') - d_x

A disturbance d of the angles would accelerate the load by f = l n_d, which the rope need not do. So the flat
map of z'' - f gives the state and the input u_d of a crane that leans against the disturbance. Therefore a
constant disturbance leaves no error. The rope is a drive of its own. u is limited as the drives are:
otherwise the filter would take their limits for a disturbance.

- Measured: encoders.
- Assumed: slow hoisting; masses are not used.
- Certain: all; it is a textbook controller.
- Limits: a filter that is much faster than the pendulum takes a load that turns about its hook for a
  disturbance, and excites it.

References
----------
Disturbances as states of the filter: Pannocchia and Rawlings, AIChE J. 49 (2003).
"""

from math import sqrt

import numpy as np
from numba import carray
from scipy.linalg import solve_continuous_are

from cranectl.controllers.common import saturate, state_on_path
from cranectl.controllers.controller import Controller, Logged, Parameter
from cranectl.controllers.observer import EXPECTED, JOINTS, Observer, initial_estimate, predict
from cranectl.controllers.slots import Slots
from cranectl.design.discretisation import check_sampled, zero_order_hold
from cranectl.model.dynamics import rope_direction_rate
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, ROPE, TROLLEY, Signal, X, Z
from cranectl.status import RunStatus
from cranectl.support.arrays import round_digits
from cranectl.support.jit import jit

# The filter's states of an axis: x, x', d_x, b, b', d_b.
PARAMETERS = Slots(period=1, gravity=1, rope_gain=2, gain=4, rope_filter=3, filter=12, limit=3)
MEMORY = Slots(estimate=EXPECTED.size, flat=15, desired=10, inputs=3, begun=1)


@jit
def correct_all(parameters, measured, estimate):
    """Correct the estimate by the readings (5,) of all encoders."""
    length = estimate[EXPECTED.position + 2]
    pole = sqrt(parameters[PARAMETERS.gravity] / length)
    rope = measured[2] - length
    x, y = measured[0] - estimate[EXPECTED.position], measured[1] - estimate[EXPECTED.position + 1]
    alpha, beta = measured[3] - estimate[EXPECTED.position + 3], measured[4] - estimate[EXPECTED.position + 4]
    scale = parameters[PARAMETERS.period]
    for order in range(3):
        scale *= pole
        place = JOINTS * order  # index of positions, velocities, disturbances
        row, angle_row = PARAMETERS.filter + 2 * order, PARAMETERS.filter + 6 + 2 * order
        to_drive, cross = parameters[row], length * parameters[row + 1]
        to_angle, back = parameters[angle_row + 1], parameters[angle_row] / length
        estimate[place] += scale * (to_drive * x + cross * beta)
        estimate[place + 1] += scale * (to_drive * y + cross * alpha)
        estimate[place + 2] += scale * parameters[PARAMETERS.rope_filter + order] * rope
        estimate[place + 3] += scale * (back * y + to_angle * alpha)
        estimate[place + 4] += scale * (back * x + to_angle * beta)


@jit
def feedback(parameters, estimate, desired, drive, angle):
    """Return K (dx, dx', db, db') of one axis [m/s²]; `drive` and `angle` are indices of joints."""
    length = estimate[EXPECTED.position + 2]
    pole = sqrt(parameters[PARAMETERS.gravity] / length)
    total = parameters[PARAMETERS.gain] / length * (estimate[EXPECTED.position + drive] - desired[2 * drive])
    total += (
        parameters[PARAMETERS.gain + 1]
        / (pole * length)
        * (estimate[EXPECTED.velocity + drive] - desired[2 * drive + 1])
    )
    total += parameters[PARAMETERS.gain + 2] * (estimate[EXPECTED.position + angle] - desired[2 * angle])
    total += (
        parameters[PARAMETERS.gain + 3]
        / pole
        * (estimate[EXPECTED.velocity + angle] - desired[2 * angle + 1])
    )
    return parameters[PARAMETERS.gravity] * total


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations (3,) [m/s²] of one sample from encoders and path."""
    stored = carray(memory, (MEMORY.size,))
    estimate, flat = stored[: MEMORY.flat], stored[MEMORY.flat : MEMORY.desired]
    desired, inputs = stored[MEMORY.desired : MEMORY.inputs], stored[MEMORY.inputs : MEMORY.begun]
    gravity = parameters[PARAMETERS.gravity]
    if stored[MEMORY.begun] == 0.0:
        for joint in range(JOINTS):
            estimate[EXPECTED.position + joint] = measured[joint]
        stored[MEMORY.begun] = 1.0
    correct_all(parameters, measured, estimate)
    length, alpha, beta = (
        estimate[EXPECTED.position + 2],
        estimate[EXPECTED.position + 3],
        estimate[EXPECTED.position + 4],
    )
    for i in range(15):
        flat[i] = reference[i]
    # Angular accelerations accelerate the load in the directions in which angular rates move it.
    push = rope_direction_rate(
        alpha, estimate[EXPECTED.disturbance + 3], beta, estimate[EXPECTED.disturbance + 4]
    )
    for axis in range(3):
        flat[ACCELERATION + axis] -= length * push[axis]
    if length <= 0.0 or not state_on_path(flat, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    # The drives follow the path itself: x_c'' = z'' - (p h)'', with the rope's slope p and vertical drop h.
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        slope = (desired[joint] - reference[axis]) / reference[Z]
        inputs[axis] += length * (push[axis] + slope * push[Z])
        inputs[axis] -= feedback(parameters, estimate, desired, joint // 2, angle // 2)
    inputs[Z] += length * push[Z] * desired[ROPE] / reference[Z]
    rope = parameters[PARAMETERS.rope_gain] / length * (length - desired[ROPE])
    rope += (
        parameters[PARAMETERS.rope_gain + 1]
        / sqrt(gravity * length)
        * (estimate[EXPECTED.velocity + 2] - desired[ROPE + 1])
    )
    inputs[Z] -= gravity * rope
    for axis in range(3):
        inputs[axis] -= estimate[EXPECTED.disturbance + axis]
        inputs[axis] = saturate(inputs[axis], parameters[PARAMETERS.limit + axis])
        command[axis] = inputs[axis]
    predict(Observer(0.0, 0.0, 0.0, parameters[PARAMETERS.period], gravity), inputs, estimate)
    return 0


def regulator(error_weight, rate_weight):
    """Return the gains K (4,) of (x, x', b, b') and (2,) of the rope, in units of l and sqrt(l/g)."""
    a = np.array([[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]], float)
    b = np.array([[0.0], [1.0], [0.0], [-1.0]])
    c = np.array([[1, 0, 1, 0], [0, 1, 0, 1]], float)
    weights = np.diag([error_weight, rate_weight])
    gain = (b.T @ solve_continuous_are(a, b, c.T @ weights @ c, [[1.0]]))[0]
    return round_digits(gain), np.array([sqrt(error_weight), sqrt(rate_weight + 2.0 * sqrt(error_weight))])


def kalman(drive_filter, sway_filter):
    """Return the filter's model and gains, in units of l and sqrt(l/g).

    They are A (6, 6) and C (2, 6) of (x, x', d_x, b, b', d_b), the gain (6, 2), and the gain (3,) of the
    rope.
    """
    a = np.diag([1.0, 1.0, 0.0, 1.0, 1.0], 1)
    a[4, 2], a[4, 3] = -1.0, -1.0
    c = np.zeros((2, 6))
    c[0, 0] = c[1, 3] = 1.0
    drift = np.diag([0.0, 0.0, drive_filter**6, 0.0, 0.0, sway_filter**6])
    gain = solve_continuous_are(a.T, c.T, drift, np.eye(2)) @ c.T
    rope = np.array([2.0 * drive_filter, 2.0 * drive_filter**2, drive_filter**3])
    return a, c, round_digits(gain), rope


def prepare(nominal):
    """Return the arrays of parameters and initial memory.

    Raises InputError if the filter is unstable on the shortest rope.
    """
    names = ("error_weight", "rate_weight", "drive_filter", "sway_filter")
    error_weight, rate_weight, drive_filter, sway_filter = (float(nominal.parameters[name]) for name in names)
    gain, rope_gain = regulator(error_weight, rate_weight)
    a, c, kalman_gain, rope_filter = kalman(drive_filter, sway_filter)
    gravity = nominal.rig.gravity
    period = nominal.period * sqrt(gravity / nominal.rig.rope_range[0])
    transition, _ = zero_order_hold(a, np.zeros((6, 1)), period)
    loop = (np.eye(6) - period * kalman_gain @ c) @ transition
    check_sampled("lqg", loop, nominal.period, remedy="lower drive_filter, sway_filter")
    parameters = PARAMETERS.array(
        period=nominal.period,
        gravity=gravity,
        rope_gain=rope_gain,
        gain=gain,
        rope_filter=rope_filter,
        filter=kalman_gain,
        limit=nominal.rig.effects.limits.acceleration,
    )
    return parameters, MEMORY.array(estimate=initial_estimate(nominal.state))


WEIGHT = (1e-6, 1e6)
FASTEST = 1e3

LQG = Controller(
    name="lqg",
    title="LQR and Kalman filter on encoders, constant pushes estimated, flat path as feed-forward",
    step=step,
    prepare=prepare,
    reads=("gravity", "limits", "rope_range"),
    measures="encoders",
    parameters=(
        Parameter("error_weight", 5.0, "1", "q_e on the load's error over l", *WEIGHT, search=(0.5, 50.0)),
        Parameter("rate_weight", 0.7, "1", "q_v on its rate over sqrt(g l)", *WEIGHT, search=(0.07, 7.0)),
        Parameter("drive_filter", 5.0, "1", "f_x, over sqrt(g/l)", 0.1, FASTEST, search=(1.0, 20.0)),
        Parameter("sway_filter", 2.0, "1", "f_b, over sqrt(g/l)", 0.1, FASTEST, search=(0.5, 15.0)),
    ),
    logged=tuple(
        Logged(
            EXPECTED.disturbance + joint,
            Signal(f"push_{axis}", f"d_{axis}", "rad/s²", f"on the {angle}, as the filter has it"),
        )
        for joint, axis, angle in ((4, "x", "angle beta"), (3, "y", "angle alpha"))
    ),
)

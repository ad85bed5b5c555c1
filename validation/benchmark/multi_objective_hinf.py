"""`multi-objective-hinf`: one controller of low order with a separate H-infinity bound for each closed loop.

    cranectl run fast-diagonal --controller validation/benchmark/multi_objective_hinf.py:MULTI_OBJECTIVE_HINF

Times are in units of sqrt(l/g) and lengths of l. For each horizontal axis near plumb, x is the load, x_c the
drive, d a disturbance and r the reference:

    x'' = x_c - x + d    x_c' = v    e = r - x    v = K(s) e    S = de/dr

    minimise gamma    |S| < gamma    |S/s| < gamma slowness    |K S| < gamma effort    |dx/dd| < gamma swing

|S/s| is the error on a path of unit speed. One Lyapunov function for all bounds makes the problem convex, so
gamma is an upper bound of the norms. At the least gamma the third state of K decays at once: it is replaced
by a gain, which leaves order 2. K is sampled by Tustin's method. On a path, K e is added to the feed-forward
x_cd' + T u_d from the flat map, with the time constant T of the drive. The rope has one pole.

- Measured: the full state, from which x follows.
- Assumed: velocity drives, and one rope length, that in the middle of the path; masses are not used.
- Certain: method and inequalities. The weights of the source, and how it reduces the order, were not
  accessible.
- Limits: hoisting detunes it. A constant disturbance leaves no error, because the drive integrates.

References
----------
Zavari, Pipeleers and Swevers (CCA 2012); Hilhorst, Pipeleers and Swevers (2013), on an overhead crane with
the trolley's velocity as input. The inequalities: Scherer, Gahinet and Chilali, IEEE TAC 42 (1997).
"""

from functools import lru_cache
from math import sqrt

import control
import numpy as np
from numba import carray
from scipy.linalg import svd
from semidefinite import minimise

from cranectl.controllers.common import middle_depth, state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots
from cranectl.design.linear_systems import closed_loop_norm, rounded_system, slowed_and_sampled
from cranectl.model.dynamics import rope_direction
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, X, Z
from cranectl.status import RunStatus
from cranectl.support.errors import InputError

ORDER = 2  # of the controller
K_DIGITS = 6  # of K, since the least gamma is accurate to about eight
BACK_OFF = 1.01  # allowed norm over gamma, after the order is reduced

# States of the crane: e, x', r - x_c; the reference r moves with the speed r'.
A = np.array([[0.0, -1, 0], [1, 0, -1], [0, 0, 0]])
B = np.array([[0.0], [0], [-1]])
C = np.array([[1.0, 0, 0]])  # e
SPEED, PUSH, NOTHING = np.array([[1.0], [0], [1]]), np.array([[0.0], [1], [0]]), np.zeros((3, 1))
# For S, S/s, K S, dx/dd: the input's columns to states and e, and the output's rows of states, input and v.
LOOPS = (
    (NOTHING, 1.0, C, 1.0, 0.0),
    (SPEED, 0.0, C, 0.0, 0.0),
    (NOTHING, 1.0, NOTHING.T, 0.0, 1.0),
    (PUSH, 0.0, C, 0.0, 0.0),
)

# a, b, c, d: the sampled K.
PARAMETERS = Slots(gravity=1, rope_pole=1, lag=3, a=ORDER * ORDER, b=ORDER, c=ORDER, d=1)
MEMORY = Slots(desired=10, inputs=3, state=2 * ORDER)


def step(parameters, measured, reference, memory, command):
    """Compute the velocity set-points (3,) [m/s] of one sample from state and path."""
    numbers, stored = carray(parameters, (PARAMETERS.size,)), carray(memory, (MEMORY.size,))
    a = numbers[PARAMETERS.a : PARAMETERS.b].reshape((ORDER, ORDER))
    b, c = numbers[PARAMETERS.b : PARAMETERS.c], numbers[PARAMETERS.c : PARAMETERS.d]
    desired, inputs = stored[: MEMORY.inputs], stored[MEMORY.inputs : MEMORY.state]
    if not state_on_path(reference, numbers[PARAMETERS.gravity], desired, inputs):
        return RunStatus.SLACK_ROPE
    direction = rope_direction(measured[ALPHA], measured[BETA])
    for axis in range(2):
        joint = BRIDGE if axis == X else TROLLEY
        error = reference[axis] - measured[joint] - measured[ROPE] * direction[axis]
        state = stored[MEMORY.state + ORDER * axis :][:ORDER]
        command[axis] = (
            desired[joint + 1] + numbers[PARAMETERS.lag + axis] * inputs[axis] + numbers[PARAMETERS.d] * error
        )
        following = np.empty(ORDER)
        for i in range(ORDER):
            command[axis] += c[i] * state[i]
            following[i] = b[i] * error
            for j in range(ORDER):
                following[i] += a[i, j] * state[j]
        state[:] = following
    command[Z] = desired[ROPE + 1] + numbers[PARAMETERS.lag + Z] * inputs[Z]
    command[Z] -= numbers[PARAMETERS.rope_pole] * (measured[ROPE] - desired[ROPE])
    return 0


def generalised_plants():
    """Return the plant of each of the four norms, from (disturbance, v) to (weighted output, e)."""
    return [
        control.ss(A, np.hstack([enters, B]), np.vstack([leaves, C]), [[past, driven], [direct, 0.0]])
        for enters, direct, leaves, past, driven in LOOPS
    ]


@lru_cache
def controller(slowness, effort, swing):
    """Return K and gamma, in units of sqrt(l/g) and l.

    Raises InputError if K exceeds one of its bounds.
    """
    bounds, one = (1.0, slowness, effort, swing), np.eye(3)

    def inequalities(gamma, x, y, a, b, c):
        found = [1e-6 * np.eye(6) - np.block([[x, one], [one, y]])]
        left, right = A @ x + B @ c, y @ A + b @ C
        for bound, (enters, direct, leaves, past, driven) in zip(bounds, LOOPS, strict=True):
            input_block, output_block, direct_block = (
                y @ enters + b * direct,
                leaves @ x + driven * c,
                np.array([[past]]),
            )
            found.append(
                np.block(
                    [
                        [left + left.T, A + a.T, enters, output_block.T],
                        [A.T + a, right + right.T, input_block, leaves.T],
                        [enters.T, input_block.T, -bound * gamma, direct_block],
                        [output_block, leaves, direct_block, -bound * gamma],
                    ]
                )
            )
        return found

    shapes = ((1, 1), 3, 3, (3, 3), (3, 1), (1, 3))
    gamma, x, y, a, b, c = minimise(lambda gamma, *_: gamma[0, 0], inequalities, *shapes)
    left, values, right = svd(one - x @ y)  # M N' = 1 - X Y, whose last singular value is near zero
    m, n = left * np.sqrt(values), right.T * np.sqrt(values)
    b_k, c_k = np.linalg.solve(n, b), np.linalg.solve(m, c.T).T
    a_k = np.linalg.solve(n, a - n @ b_k @ C @ x - y @ B @ c_k @ m.T - y @ A @ x)
    k = rounded_system(without_last(np.linalg.solve(m, a_k.T).T, b_k, c_k), K_DIGITS)
    least = float(gamma[0, 0])
    for plant, bound in zip(generalised_plants(), bounds, strict=True):
        if not (norm := closed_loop_norm(plant, k)) <= BACK_OFF * bound * least:
            raise InputError(
                f"multi-objective-hinf of order {ORDER} has the norm {norm:.4g}",
                allowed=f"at most {BACK_OFF * bound * least:.4g}",
                remedy="choose less extreme bounds in [controller.multi-objective-hinf]",
            )
    return k, least


def without_last(a, b, c):
    """Return the system with its last state replaced by a gain (singular perturbation)."""
    share = a[:-1, -1:] / a[-1, -1]
    into, at_rest = b[-1:], a[-1:, :-1]
    return control.ss(
        a[:-1, :-1] - share @ at_rest,
        b[:-1] - share @ into,
        c[:, :-1] - c[:, -1:] @ at_rest / a[-1, -1],
        -c[:, -1:] @ into / a[-1, -1],
    )


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    settings = nominal.parameters
    k, _ = controller(*(float(settings[name]) for name in ("slowness", "effort", "swing")))
    w = sqrt(nominal.rig.gravity / middle_depth(nominal.reference))
    sampled = slowed_and_sampled(k, w, nominal.period)
    parameters = PARAMETERS.array(
        gravity=nominal.rig.gravity,
        rope_pole=w * settings["rope_pole"],
        lag=nominal.rig.time_constants,
        a=sampled.A,
        b=sampled.B,
        c=sampled.C,
        d=sampled.D,
    )
    return parameters, MEMORY.array()


MULTI_OBJECTIVE_HINF = Controller(
    name="multi-objective-hinf",
    title="one controller of order 2 for four H-infinity bounds, flat path as feed-forward",
    step=step,
    prepare=prepare,
    reads=("gravity", "path", "time_constants"),
    command="velocity",
    parameters=(
        Parameter("slowness", 4.0, "sqrt(l/g)", "bound of error by speed", 1e-2, 1e3, search=(0.3, 10.0)),
        Parameter("effort", 1.0, "sqrt(g/l)", "bound of velocity by error", 1e-2, 1e3, search=(0.2, 15.0)),
        Parameter("swing", 2.0, "1", "bound of the load's error by a push", 1e-2, 1e3, search=(0.5, 5.0)),
        Parameter("rope_pole", 1.0, "sqrt(g/l)", "of the rope's length", 0.0, 1e3, search=(0.3, 6.0)),
    ),
)

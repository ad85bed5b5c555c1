"""`lqr-integral`: linear-quadratic feedback with integral action on the linearised crane, on the flat path.

For each horizontal axis, near plumb, with drive x, angle b, rope length l and u = x'' (thesis (2.12)):

    l b'' = -g b - u,    load error e = dx + l db,    s' = e,    u = u_d - K(l) (dx, dx', db, db', s)

Here d is the deviation from the state that the flat map gives for the path, and u_d is its input. K minimises
the integral of q_e e² + q_v e'² + q_i s² + r u². It is computed for 33 lengths and interpolated between them.
Their steps are equal up to a range of 1 : 30, and their ratios beyond, where K changes too much between short
lengths of equal steps. The rope has the same weights, with its length in place of e. Source: textbooks.
Assumes: full state, slow hoisting; masses are not used. Certain. When drives are at their limits the integral
winds up.
"""

from math import log

import numpy as np
from numba import carray  # type: ignore[attr-defined]
from scipy.linalg import solve_continuous_are

from cranectl.controllers.common import state_on_path
from cranectl.controllers.controller import Controller, LinearController, Nominal, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.design import check_sampled, zero_order_hold
from cranectl.model import flat_output
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, ROPE_RATE, TROLLEY, X, Y, Z
from cranectl.status import RunStatus
from cranectl.support import Array, InputError, jit, round_digits

GRID = 33  # rope lengths
WIDE_RANGE = 30.0  # longest over shortest rope, beyond which the ratios of lengths are equal
STATES = 5  # dx, dx', db, db', s

PARAMETERS = Slots(period=1, gravity=1, shortest=1, length_step=1, log_step=1, rope_gain=3, gain=0)
MEMORY = Slots(integral=3, desired=10, inputs=3, load=12)


@jit
def place_on_grid(parameters, length):
    """Return where a rope length [m] lies among the rows of gains, and its share of the way to the next."""
    shortest, log_step = parameters[PARAMETERS.shortest], parameters[PARAMETERS.log_step]
    if log_step > 0.0:
        grid = log(max(length, shortest) / shortest) / log_step
    else:
        grid = (length - shortest) / parameters[PARAMETERS.length_step]
    row = min(max(int(grid), 0), GRID - 2)
    return row, min(max(grid - row, 0.0), 1.0)


@jit
def feedback(parameters, measured, desired, integral, joint, angle, row, share):
    """Return K(l) (dx, dx', db, db', s) of one axis; K is interpolated by `share` between two rows."""
    total = 0.0
    for i in range(STATES):
        first = parameters[PARAMETERS.gain + STATES * row + i]
        gain = first + share * (parameters[PARAMETERS.gain + STATES * (row + 1) + i] - first)
        column = joint + i if i < 2 else angle + i - 2
        total += gain * (integral if i == 4 else measured[column] - desired[column])
    return total


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations of one sample from state and path; see `controller` for the arguments."""
    buffer = carray(memory, (MEMORY.size,))
    integral, desired = buffer[: MEMORY.desired], buffer[MEMORY.desired : MEMORY.inputs]
    inputs, load = buffer[MEMORY.inputs : MEMORY.load], buffer[MEMORY.load :]
    gravity, period = parameters[PARAMETERS.gravity], parameters[PARAMETERS.period]
    if not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    flat_output(measured, 0.0, 0.0, gravity, load)  # only the position is read, which needs no zeta
    row, share = place_on_grid(parameters, measured[ROPE])
    x = feedback(parameters, measured, desired, integral[X], BRIDGE, BETA, row, share)
    y = feedback(parameters, measured, desired, integral[Y], TROLLEY, ALPHA, row, share)
    command[X], command[Y] = inputs[X] - x, inputs[Y] - y
    command[Z] = (
        inputs[Z]
        - parameters[PARAMETERS.rope_gain] * (measured[ROPE] - desired[ROPE])
        - parameters[PARAMETERS.rope_gain + 1] * (measured[ROPE_RATE] - desired[ROPE_RATE])
        + parameters[PARAMETERS.rope_gain + 2] * integral[Z]  # a load too high means a rope too short
    )
    for axis in range(3):
        integral[axis] += period * (load[axis] - reference[axis])
    return 0


def matrices(rope_length: float, gravity: float) -> tuple[Array, Array, Array]:
    """Return A, B of x' = A x + B u for x = (dx, dx', db, db', s), and C of (e, e', s)."""
    stiffness = -gravity / rope_length
    a = [
        [0, 1, 0, 0, 0],
        [0, 0, 0, 0, 0],
        [0, 0, 0, 1, 0],
        [0, 0, stiffness, 0, 0],
        [1, 0, rope_length, 0, 0],
    ]
    b = [[0], [1], [0], [-1 / rope_length], [0]]
    c = [[1, 0, rope_length, 0, 0], [0, 1, 0, rope_length, 0], [0, 0, 0, 0, 1]]
    return np.array(a, float), np.array(b, float), np.array(c, float)


def gain_at(rope_length: float, nominal: Nominal) -> Array:
    """Return K (5,) at a rope length [m]; raise InputError if the sampled loop would be unstable."""
    return _gain(nominal, *matrices(rope_length, nominal.rig.gravity))


def rope_gain(nominal: Nominal) -> Array:
    """Return K (3,) of the rope, on the errors of its length, its rate and the integral of its length."""
    return _gain(nominal, *(np.array(m) for m in _ROPE))


_ROPE = ([[0, 1.0, 0], [0, 0, 0], [1.0, 0, 0]], [[0], [1.0], [0]], np.eye(3))


def _gain(nominal: Nominal, a: Array, b: Array, c: Array) -> Array:
    numbers = nominal.parameters
    weights = [float(numbers[f"{name}_weight"]) for name in ("error", "rate", "integral")]
    r = float(numbers["input_weight"])
    try:
        cost = solve_continuous_are(a, b, c.T @ np.diag(weights) @ c, [[r]])
    except np.linalg.LinAlgError as error:
        raise InputError(
            f"the Riccati equation of lqr-integral: {error}",
            allowed="weights of less extreme ratio",
            remedy="scale the weights in [controller.lqr-integral] towards each other",
        ) from error
    gain = round_digits((b.T @ cost / r)[0])
    phi, hold = zero_order_hold(a, b, nominal.period)
    closed = phi - hold @ gain[np.newaxis]
    remedy = "raise input_weight in [controller.lqr-integral]"
    check_sampled("lqr-integral", closed, nominal.period, remedy=remedy)
    return gain


def prepare(nominal: Nominal) -> tuple[Array, Array]:
    """Return parameters and memory, with gains for all rope lengths of the rig."""
    shortest, longest = nominal.rig.rope_range
    is_wide = longest > WIDE_RANGE * shortest
    lengths = (np.geomspace if is_wide else np.linspace)(shortest, longest, GRID)
    gains = np.array([gain_at(length, nominal) for length in lengths])
    parameters = PARAMETERS.array(
        period=nominal.period,
        gravity=nominal.rig.gravity,
        shortest=shortest,
        length_step=lengths[1] - shortest,
        log_step=log(longest / shortest) / (GRID - 1) if is_wide else 0.0,
        rope_gain=rope_gain(nominal),
        gain=gains,
    )
    return parameters, MEMORY.array()


def linearise(nominal: Nominal, rope_length: float) -> LinearController:
    """Return the linear controller of one horizontal axis at rest, with the gain that a run interpolates."""
    a, b, _ = matrices(rope_length, nominal.rig.gravity)
    parameters, _ = prepare(nominal)
    row, share = place_on_grid(parameters, rope_length)
    table = parameters[PARAMETERS.gain :].reshape(GRID, STATES)
    return LinearController(rope_length, a, b, table[row] + share * (table[row + 1] - table[row]))


WEIGHT = (1e-9, 1e9)

LQR_INTEGRAL = Controller(
    name="lqr-integral",
    title="LQR with integral action on the linearised crane, flat path as feed-forward",
    step=step,
    prepare=prepare,
    reads=("gravity", "rope_range"),
    parameters=(
        Parameter("error_weight", 100.0, "1/m²", "q_e on the load's error", *WEIGHT,
                  search=(1.0, 1e4), length_power=-2.0),
        Parameter("rate_weight", 1.0, "s²/m²", "q_v on the rate of the error", *WEIGHT,
                  search=(1e-2, 1e2), length_power=-1.0),
        Parameter("integral_weight", 400.0, "1/(m s)²", "q_i on the integral of the error", *WEIGHT,
                  search=(4.0, 4e4), length_power=-3.0),
        Parameter("input_weight", 0.1, "s⁴/m²", "r on the drive's acceleration", *WEIGHT),
    ),
    logged=MEMORY.logged(integral=per_axis("error_integral", "s", "m s", "of the load's error", "xyz")),
    linearise=linearise,
)  # fmt: skip

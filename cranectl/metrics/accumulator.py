"""Measure a run block by block: one compiled pass over its samples into an accumulator that stays small.

A run gives the same bits whether it comes in one block or in many: every sum goes sample by sample, and what
an interval needs of the sample before it is kept in the accumulator.
"""

from math import acos, cos, inf, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.metrics.setup import MetricsSetup
from cranectl.signals import DISTURBANCE_COLUMN, INPUT_COLUMN, LOAD_COLUMN, STATE_COLUMN, TENSION_COLUMN
from cranectl.support.jit import jit

Array = NDArray[np.float64]
Accumulator = NDArray[np.void]  # (1,) of TOTALS

SETTLING_TOLERANCE = 0.005  # [m]; assumed: where a laboratory crane's hook counts as in its place
_SCALAR, _TRIPLE = (np.float64,), (np.float64, (3,))

# Sums run over samples, "time" and "work" over the intervals between them; extremes start infinite.
_PLACES = np.dtype(
    [
        ("samples", *_SCALAR),
        ("error_squares", *_SCALAR),
        ("error_max", *_SCALAR),
        ("error_last", *_SCALAR),
        ("input_highest", *_TRIPLE),
        ("input_lowest", *_TRIPLE),
        ("input_squares", *_TRIPLE),
        ("alpha_max", *_SCALAR),
        ("beta_max", *_SCALAR),
        ("sway_squares", *_SCALAR),
        ("sway_max", *_SCALAR),
        ("tension_least", *_SCALAR),
        ("drive_path", *_TRIPLE),
        ("load_path", *_SCALAR),
        ("work", *_TRIPLE),  # [J] of the drives, signed
        ("energy", *_TRIPLE),  # [J] the work of the intervals in which it is positive
        ("saturated_time", *_SCALAR),  # [s]
        ("outside_first", *_TRIPLE),  # [ns]
        ("outside_excess", *_TRIPLE),
        ("outside_time", *_TRIPLE),  # [s]
        # Samples at which the reference rests.
        ("rest_samples", *_SCALAR),
        ("rest_error_max", *_SCALAR),
        ("overshoot", *_SCALAR),
        ("rest_sway_max", *_SCALAR),
        ("rest_load_highest", *_TRIPLE),
        ("rest_load_lowest", *_TRIPLE),
        ("settled_since", *_SCALAR),  # [ns]; infinite while the load is outside the tolerance
        # The sample before.
        ("time", *_SCALAR),  # [ns]
        ("position", *_TRIPLE),  # of bridge, trolley, rope
        ("velocity", *_TRIPLE),
        ("power", *_TRIPLE),  # [W] of the drives, less what accelerates their own masses
        ("load", *_TRIPLE),
        ("saturated", *_SCALAR),  # 1 or 0
        ("outside", *_TRIPLE),
    ]
)
TOTALS = np.dtype((np.record, _PLACES))  # a record: its places are attributes, compiled or not
_LOWEST = ("input_lowest", "tension_least", "rest_load_lowest", "outside_first", "settled_since")
_HIGHEST = ("input_highest", "overshoot", "rest_load_highest")


def empty_accumulator() -> Accumulator:
    """Without a sample, shape (1,). Assign it to `accumulator[:]` to use another one again."""
    accumulator = np.zeros(1, dtype=TOTALS)
    for names, start in ((_LOWEST, inf), (_HIGHEST, -inf)):
        for name in names:
            accumulator[name] = start
    return accumulator


@jit
def accumulate(
    setup: MetricsSetup,
    accumulator: Any,
    time_ns: NDArray[np.int64],
    record: Array,
    reference: Array,
    commands: Array,
) -> None:
    """Add consecutive samples to `accumulator` (1,).

    `time_ns` (n,); `record` (n, BASE_WIDTH or more), columns as in `signals`; `reference` (n, 15); `commands`
    (n, any) with the flags of saturation from `setup.flag_column` on: the record of the stages, or of the
    whole run. Without stages anything will do, e.g. `record`.
    """
    total = accumulator[0]
    for k in range(len(time_ns)):
        row, time = record[k], float(time_ns[k])
        if total.samples == 0.0:
            start(total, row, time)
        elapsed = 1e-9 * (time - total.time)
        alpha, beta = row[STATE_COLUMN + 6], row[STATE_COLUMN + 8]
        sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
        add_inputs(total, row)
        sway = add_sway(total, alpha, beta, ca * cb)
        error = add_error(total, row, reference[k])
        add_drives(setup, total, row, (sa, ca, sb, cb), elapsed)
        add_load_path(total, row)
        add_outside(setup, total, row, time, elapsed)
        add_saturation(setup, total, commands[k], elapsed)
        if time >= setup.rest_ns:
            add_rest(setup, total, row, reference[k], time, error, sway)
        total.samples += 1.0
        total.time = time


@jit
def start(total: Any, row: Array, time: float) -> None:
    """Let the first sample be its own sample before: the interval between them has no length and no work."""
    total.time = time
    for i in range(3):
        total.position[i], total.velocity[i] = row[STATE_COLUMN + 2 * i], row[STATE_COLUMN + 2 * i + 1]
        total.load[i] = row[LOAD_COLUMN + i]


@jit
def add_inputs(total: Any, row: Array) -> None:
    """Commanded accelerations and rope tension."""
    for i in range(3):
        u = row[INPUT_COLUMN + i]
        total.input_squares[i] += u * u
        total.input_highest[i] = max(total.input_highest[i], u)
        total.input_lowest[i] = min(total.input_lowest[i], u)
    total.tension_least = min(total.tension_least, row[TENSION_COLUMN])


@jit
def add_sway(total: Any, alpha: float, beta: float, cosine: float) -> float:
    """Cardan angles; returns the angle between rope and plumb line [rad], which has this `cosine`."""
    total.alpha_max = max(total.alpha_max, abs(alpha))
    total.beta_max = max(total.beta_max, abs(beta))
    sway = acos(cosine)
    total.sway_squares += sway * sway
    total.sway_max = max(total.sway_max, sway)
    return sway


@jit
def add_error(total: Any, row: Array, reference: Array) -> float:
    """Tracking error of the load; returns its Euclidean norm [m]."""
    square = 0.0
    for i in range(3):
        e = reference[i] - row[LOAD_COLUMN + i]
        square += e * e
    error = sqrt(square)
    total.error_squares += square
    total.error_max = max(total.error_max, error)
    total.error_last = error
    return error


@jit
def add_drives(
    setup: MetricsSetup, total: Any, row: Array, angles: tuple[float, float, float, float], elapsed: float
) -> None:
    """Paths and work of the drives over the interval that ends here.

    The force of a drive is F = m v' - S n + R + friction for bridge and trolley, with n the rope's direction,
    S its tension and R the reaction to the disturbance, which turns the load about the trolley; F = m v' - S
    + friction for the winch, positive when paying out. The work of m v' is the change of m v² / 2, exactly;
    the rest is integrated with the trapezoidal rule.
    """
    sa, ca, sb, cb = angles
    tension, arm = row[TENSION_COLUMN], setup.load_mass * row[STATE_COLUMN + 4]
    along_alpha, along_beta = arm * cb * row[DISTURBANCE_COLUMN], arm * row[DISTURBANCE_COLUMN + 1]
    forces = (
        cb * along_beta - tension * sb,
        ca * along_alpha - sb * sa * along_beta - tension * cb * sa,
        -tension,
    )
    for i in range(3):
        position, velocity = row[STATE_COLUMN + 2 * i], row[STATE_COLUMN + 2 * i + 1]
        speed, before = abs(velocity), total.velocity[i]
        power = forces[i] * velocity + (setup.coulomb[i] + setup.viscous[i] * speed) * speed
        work = 0.5 * setup.driven_mass[i] * (velocity * velocity - before * before)
        work += 0.5 * elapsed * (power + total.power[i])
        total.work[i] += work
        total.energy[i] += max(work, 0.0)
        total.drive_path[i] += abs(position - total.position[i])
        total.position[i], total.velocity[i], total.power[i] = position, velocity, power


@jit
def add_load_path(total: Any, row: Array) -> None:
    """Distance between the load and where it was at the sample before."""
    square = 0.0
    for i in range(3):
        moved = row[LOAD_COLUMN + i] - total.load[i]
        square += moved * moved
        total.load[i] = row[LOAD_COLUMN + i]
    total.load_path += sqrt(square)


@jit
def add_outside(setup: MetricsSetup, total: Any, row: Array, time: float, elapsed: float) -> None:
    """Ranges of bridge, trolley and rope; outside at a sample counts until the next."""
    for i in range(3):
        if total.outside[i] > 0.0:
            total.outside_time[i] += elapsed
        position = row[STATE_COLUMN + 2 * i]
        excess = max(setup.workspace[i, 0] - position, position - setup.workspace[i, 1])
        total.outside[i] = 1.0 if excess > 0.0 else 0.0
        if excess > 0.0:
            total.outside_first[i] = min(total.outside_first[i], time)
            total.outside_excess[i] = max(total.outside_excess[i], excess)


@jit
def add_saturation(setup: MetricsSetup, total: Any, command: Array, elapsed: float) -> None:
    """Flags of saturation; a command is held until the next sample."""
    if setup.flag_column < 0:
        return
    if total.saturated > 0.0:
        total.saturated_time += elapsed
    total.saturated = 0.0
    for i in range(3):
        if command[setup.flag_column + i] > 0.0:
            total.saturated = 1.0


@jit
def add_rest(
    setup: MetricsSetup, total: Any, row: Array, reference: Array, time: float, error: float, sway: float
) -> None:
    """A sample at which the reference rests in its end point."""
    beyond = 0.0
    for i in range(3):
        load = row[LOAD_COLUMN + i]
        beyond += setup.direction[i] * (load - reference[i])
        total.rest_load_highest[i] = max(total.rest_load_highest[i], load)
        total.rest_load_lowest[i] = min(total.rest_load_lowest[i], load)
    total.rest_samples += 1.0
    total.overshoot = max(total.overshoot, beyond)
    total.rest_error_max = max(total.rest_error_max, error)
    total.rest_sway_max = max(total.rest_sway_max, sway)
    if error > SETTLING_TOLERANCE:
        total.settled_since = inf
    else:
        total.settled_since = min(total.settled_since, time)

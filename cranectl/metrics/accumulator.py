"""Measure a run block by block: a compiled pass adds all samples to an accumulator of fixed size.

The result has the same bits for one block as for many. Every sum is built sample by sample, and the
accumulator holds the values of the last sample that the next interval needs.
"""

from math import acos, cos, inf, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.metrics.setup import FLAG_COLUMN, NO_FLAGS, MetricsSetup, metrics_setup
from cranectl.metrics.summary import RunMetrics
from cranectl.metrics.table import Measured, Metric, Value
from cranectl.plants import Drive
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import ALPHA, BETA, COLUMN, ROPE
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import Array, jit

# Sums are over samples, and those of time and work over the intervals between them. Extremes start infinite.
_SCALARS = (
    "samples", "error_squares", "error_max", "error_last", "alpha_max", "beta_max", "sway_squares",
    "sway_max", "tension_least", "load_path", "saturated_time",  # [s]
    "rest_samples", "rest_error_max", "overshoot", "rest_sway_max",  # samples at which the reference rests
    "settled_since",  # [ns]; infinite while the load is outside the tolerance
    "time", "saturated",  # the sample before: [ns]; 1 or 0
)  # fmt: skip
_TRIPLES = (
    "input_highest", "input_lowest", "input_squares", "input_variation", "drive_path",
    "work", "energy",  # [J] of the drives, signed; of the intervals in which it is positive
    "outside_first", "outside_excess", "outside_time",  # [ns], [m], [s]
    "rest_load_highest", "rest_load_lowest",  # samples at which the reference rests
    "position", "velocity", "load", "outside",  # the sample before: of bridge, trolley, rope; x, y, z; 1 or 0
    "input",  # the same: commanded accelerations
    "power",  # the same, [W] of the drives, less what accelerates their own masses
)  # fmt: skip
_PAIRS = "rest_angle_highest", "rest_angle_lowest"  # of alpha, beta, at samples at which the reference rests
_SIZES = (_SCALARS, ()), (_TRIPLES, (3,)), (_PAIRS, (2,))
_PLACES = np.dtype([(name, np.float64, size) for names, size in _SIZES for name in names])
TOTALS = np.dtype((np.record, _PLACES))  # a record, whose fields are attributes in compiled code too
_LOWEST = (
    "input_lowest", "tension_least", "rest_load_lowest", "rest_angle_lowest",
    "outside_first", "settled_since",
)  # fmt: skip
_HIGHEST = ("input_highest", "overshoot", "rest_load_highest", "rest_angle_highest")


class Accumulator:
    """Measure a run of `scenario` with drives of one kind: add its samples block by block, then finish."""

    def __init__(self, scenario: Scenario, drive: Drive, *, flag_column: int = FLAG_COLUMN) -> None:
        """Start without samples; `flag_column` is that of `metrics_setup`."""
        self.setup = metrics_setup(scenario, drive, flag_column=flag_column)
        self.total: NDArray[np.void] = np.zeros(1, dtype=TOTALS)
        for names, start in ((_LOWEST, inf), (_HIGHEST, -inf)):
            for name in names:
                self.total[name] = start
        self.own = {m.name: np.array(m.start) for m in Metric.all() if m.kernel is not None}

    @classmethod
    def of(cls, run: Run) -> "Accumulator":
        """Return an accumulator without samples for the record of a whole run."""
        names = [name for group in run.groups for name in group.names]
        flags = names.index("bridge_limited") if "bridge_limited" in names else NO_FLAGS
        return cls(run.scenario, run.drive, flag_column=flags)

    def add(self, time_ns: NDArray[np.int64], record: Array, reference: Array, commands: Array) -> None:
        """Add consecutive samples.

        Parameters
        ----------
        time_ns : (n,) array
            Times [ns].
        record : (n, BASE_WIDTH or more) array
            Columns as in `signals`.
        reference : (n, 15) array
            The reference.
        commands : (n, any) array
            The record of the signal path, or of the whole run. It has the flags of saturation from
            `setup.flag_column` on. Without a signal path it is not read.
        """
        samples = time_ns, record, reference, commands
        add_samples(self.setup, self.total, *samples)
        for metric in Metric.all():
            if metric.kernel is not None:
                metric.kernel(self.setup, self.own[metric.name], *samples)

    def measured(self, status: RunStatus, end_ns: int) -> Measured:
        """Return the totals of a run that ended like this with the last sample added."""
        return Measured(self.setup, self.total[0], self.own, status, end_ns)

    def finish(self, status: RunStatus, end_ns: int) -> RunMetrics | None:
        """Return the metrics of the run whose samples have all been added; None if it has none."""
        if not self.total["samples"][0]:
            return None
        measured = self.measured(status, end_ns)
        values = {metric.name: _plain(metric.value(measured)) for metric in Metric.all()}
        return RunMetrics(status.label, end_ns / NANOSECONDS, values)


def _plain(value: Any) -> Value:
    plain: Any = np.asarray(value).tolist()
    return tuple(plain) if isinstance(plain, list) else plain


@jit
def add_samples(
    setup: MetricsSetup, totals: Any, time_ns: Any, record: Array, reference: Array, commands: Array
) -> None:
    """Add samples, the arrays of `Accumulator.add`, to `totals` (1,)."""
    total = totals[0]
    for k in range(len(time_ns)):
        row, time = record[k], float(time_ns[k])
        if total.samples == 0.0:
            start(total, row, time)
        elapsed = 1e-9 * (time - total.time)
        alpha, beta = row[COLUMN.state + ALPHA], row[COLUMN.state + BETA]
        sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
        add_inputs(total, row)
        total.alpha_max = max(total.alpha_max, abs(alpha))
        total.beta_max = max(total.beta_max, abs(beta))
        sway = acos(ca * cb)  # angle between rope and plumb line
        total.sway_squares += sway * sway
        total.sway_max = max(total.sway_max, sway)
        error = add_load(total, row, reference[k])
        add_drives(setup, total, row, (sa, ca, sb, cb), elapsed)
        add_outside(setup, total, row, time, elapsed)
        add_saturation(setup, total, commands[k], elapsed)
        if time >= setup.rest_ns:
            add_rest(setup, total, row, reference[k], time, error, sway)
        total.samples += 1.0
        total.time = time


@jit
def start(total: Any, row: Array, time: float) -> None:
    """Use the first sample as the one before it: this interval has no length and no work."""
    total.time = time
    for i in range(3):
        total.position[i], total.velocity[i] = row[COLUMN.state + 2 * i], row[COLUMN.state + 2 * i + 1]
        total.load[i], total.input[i] = row[COLUMN.load + i], row[COLUMN.input + i]


@jit
def add_inputs(total: Any, row: Array) -> None:
    """Add commanded accelerations and rope tension of a sample."""
    for i in range(3):
        u = row[COLUMN.input + i]
        total.input_squares[i] += u * u
        total.input_variation[i] += abs(u - total.input[i])
        total.input[i] = u
        total.input_highest[i] = max(total.input_highest[i], u)
        total.input_lowest[i] = min(total.input_lowest[i], u)
    total.tension_least = min(total.tension_least, row[COLUMN.tension])


@jit
def add_load(total: Any, row: Array, reference: Array) -> float:
    """Add path and tracking error of the load; return the error's Euclidean norm [m]."""
    square, moved = 0.0, 0.0
    for i in range(3):
        load = row[COLUMN.load + i]
        e, way = reference[i] - load, load - total.load[i]
        square += e * e
        moved += way * way
        total.load[i] = load
    total.load_path += sqrt(moved)
    error = sqrt(square)
    total.error_squares += square
    total.error_max = max(total.error_max, error)
    total.error_last = error
    return error


@jit
def add_drives(
    setup: MetricsSetup, total: Any, row: Array, angles: tuple[float, float, float, float], elapsed: float
) -> None:
    """Add path and work of each drive over the interval that ends with this sample.

    The force on bridge and trolley is F = m v' - S n + R + friction. Here n is the rope's direction, S its
    tension, and R the reaction to a disturbance that turns the load about the trolley. The force of the winch
    is F = m v' - S + friction, positive when paying out. The work of m v' is exactly the change of m v² / 2;
    all other work is integrated by the trapezoidal rule.
    """
    sa, ca, sb, cb = angles
    tension, arm = row[COLUMN.tension], setup.load_mass * row[COLUMN.state + ROPE]
    along_alpha, along_beta = arm * cb * row[COLUMN.disturbance], arm * row[COLUMN.disturbance + 1]
    forces = (
        cb * along_beta - tension * sb,
        ca * along_alpha - sb * sa * along_beta - tension * cb * sa,
        -tension,
    )
    for i in range(3):
        position, velocity = row[COLUMN.state + 2 * i], row[COLUMN.state + 2 * i + 1]
        speed, before = abs(velocity), total.velocity[i]
        power = forces[i] * velocity + (setup.coulomb[i] + setup.viscous[i] * speed) * speed
        work = 0.5 * setup.driven_mass[i] * (velocity * velocity - before * before)
        work += 0.5 * elapsed * (power + total.power[i])
        total.work[i] += work
        total.energy[i] += max(work, 0.0)
        total.drive_path[i] += abs(position - total.position[i])
        total.position[i], total.velocity[i], total.power[i] = position, velocity, power


@jit
def add_outside(setup: MetricsSetup, total: Any, row: Array, time: float, elapsed: float) -> None:
    """Add how far and how long bridge, trolley and rope are outside their ranges.

    An axis that is outside at a sample counts as outside until the next one.
    """
    for i in range(3):
        if total.outside[i] > 0.0:
            total.outside_time[i] += elapsed
        position = row[COLUMN.state + 2 * i]
        excess = max(setup.workspace[i, 0] - position, position - setup.workspace[i, 1])
        total.outside[i] = 1.0 if excess > 0.0 else 0.0
        if excess > 0.0:
            total.outside_first[i] = min(total.outside_first[i], time)
            total.outside_excess[i] = max(total.outside_excess[i], excess)


@jit
def add_saturation(setup: MetricsSetup, total: Any, command: Array, elapsed: float) -> None:
    """Add the time of saturation; a limited command acts until the next sample."""
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
    """Add a sample at which the reference rests at its end point."""
    beyond = 0.0
    for i in range(3):
        load = row[COLUMN.load + i]
        beyond += setup.direction[i] * (load - reference[i])
        total.rest_load_highest[i] = max(total.rest_load_highest[i], load)
        total.rest_load_lowest[i] = min(total.rest_load_lowest[i], load)
    for i, angle in enumerate((row[COLUMN.state + ALPHA], row[COLUMN.state + BETA])):
        total.rest_angle_highest[i] = max(total.rest_angle_highest[i], angle)
        total.rest_angle_lowest[i] = min(total.rest_angle_lowest[i], angle)
    total.rest_samples += 1.0
    total.overshoot = max(total.overshoot, beyond)
    total.rest_error_max = max(total.rest_error_max, error)
    total.rest_sway_max = max(total.rest_sway_max, sway)
    if error > setup.settling_tolerance:
        total.settled_since = inf
    else:
        total.settled_since = min(total.settled_since, time)

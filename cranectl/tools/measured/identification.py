"""Identify a crane: fit numbers of its drives, friction, rope and load to measured runs.

The sum of squared differences between measured and predicted readings is minimised by Gauss-Newton steps
within a trust region. Readings are predicted with the plant `elastic`, from the measured commands, or from
the measured motion of bridge, trolley and rope. Each number has a 95 % interval with two parts:

- steps and noise of the encoders, from drawn readings that are rounded as encoders do; this part grows if
  the model misses the readings by more than noise
- what the runs spread beyond that (delete-one jackknife with one Gauss-Newton step for each run)

Viscous friction of a drive with velocity set-points cannot be told from a shorter time constant and a
smaller gain. So these two are effective numbers, and viscous friction is zero.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.stats import t as student

from cranectl.scenario import NANOSECONDS, RigParameters
from cranectl.simulate import Run
from cranectl.support import Array, InputError
from cranectl.tools.measured.comparison import (
    LoadDifference,
    ReadingsComparison,
    compare_readings,
    load_difference,
)
from cranectl.tools.measured.experiment import Experiment, reading_noise
from cranectl.tools.measured.identity import check_all_differ
from cranectl.tools.measured.least_squares import (
    CLOSE_ENOUGH,
    FITTING_STEP,
    ROUGHLY_ENOUGH,
    LeastSquares,
    reduced_equations,
)
from cranectl.tools.measured.replay import Replay, default_replay, first_samples
from cranectl.tools.measured.unknowns import assumed_value, movable_friction, rig_with, unknowns_of

MAX_READINGS = 40_000  # of a channel that are compared, of all runs together
MANY_SWINGS = 16.0  # of a run, from which its first part is fitted first
PARTS = 4  # into which it is cut
SLOW_ROWS = 0.5  # times the shortest lag of a drive: periods from which set-points may change in between
CLEARLY_LESS = 0.5  # of the misfit, which lines between set-points must leave
MAX_MISFIT = 1.5  # mean square of the residuals, in units of the readings' noise
STRONG_CORRELATION = 0.99  # correlation above which two numbers replace one another
AT_BOUND = "at its bound"  # in place of the interval of a number that ended there
NORMAL = 1.96  # half-widths of a 95 % interval in standard deviations

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Estimate:
    """A fitted number with its 95 % interval."""

    name: str
    unit: str
    value: float
    half_width: float
    spread: float  # standard deviation from what the runs spread beyond errors of encoders
    encoders: float  # standard deviation from steps and noise of encoders
    at_bound: bool = False  # of its range, so that the interval means nothing


@dataclass(frozen=True)
class OpenNumber:
    """A number that was not identified, and by how much the others change if it is off by its scale."""

    name: str
    scale: float
    compensation: Mapping[str, float]  # of the estimates, by their names


@dataclass(frozen=True)
class Identification:
    """What measured runs say of a crane."""

    rig: RigParameters  # with the fitted numbers
    replay: Replay
    estimates: tuple[Estimate, ...]
    left_open: tuple["OpenNumber", ...]  # numbers of which these runs say nothing
    correlated: tuple[tuple[str, str, float], ...]  # pairs whose errors go together, with their correlation
    spread: (
        Array  # covariance of the estimates from a spread between runs that encoders do not explain (P, P)
    )
    known: Array  # the same from noise and steps of the encoders (P, P)
    misfits: Mapping[str, float]  # mean square of each channel's residuals in units of noise, 1 without error
    converged: bool  # whether the optimiser finished, with predictions of whole runs
    lowered: Mapping[str, float]  # friction that held the crane at the recorded commands, as the fit began
    comparisons: tuple[ReadingsComparison, ...]  # of the fitted runs
    loads: tuple[LoadDifference, ...]  # of the fitted runs

    @property
    def runs(self) -> int:
        """Number of fitted runs."""
        return len(self.comparisons)

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Names of the numbers of which the runs say nothing."""
        return tuple(number.name for number in self.left_open)

    @property
    def misfit(self) -> float:
        """Misfit of the channel that fits worst."""
        return max(self.misfits.values())


def identify(
    runs: Sequence[Run],
    rig: RigParameters,
    *,
    replay: Replay | None = None,
    progress: Progress = lambda _: None,
) -> Identification:
    """Fit the numbers of a crane to at least three measured runs of it.

    `rig` is what is known of the crane: masses of its axes, gravity, encoders, and first values. `replay`
    says what drives the prediction; by default the commands, if all runs have them, and of slow logs the
    lines between them, if these leave clearly less misfit. `progress` is called
    with a sentence at each stage. Raises InputError for fewer than three runs, for two with the same
    readings, for runs without commands or angles, and if no reading tells a number of the crane.
    """
    if len(runs) < 3:
        raise InputError(
            f"{len(runs)} measured runs",
            allowed="at least 3, whose spread tells how exact the numbers are",
            remedy="cut a long log where the crane rests, by from and to in its map, and import each part",
        )
    check_all_differ(runs)
    has_commands = all(default_replay(run) == "commands" for run in runs)
    chosen: Replay = replay or ("commands" if has_commands else "motion")
    lowered = {} if chosen == "motion" else movable_friction(rig, runs, progress)
    rig = rig_with(rig, lowered)
    fit = _fitted(runs, rig, chosen, progress)
    if replay is None and has_commands and any(_rows_are_slow(run, rig) for run in runs):
        progress("again, with set-points that change between the rows")
        other = _fitted(runs, rig, "lines", progress)
        if other.done and other.unknowns and other.misfit < CLEARLY_LESS * fit.misfit:
            fit, chosen = other, "lines"
    check_something_moves(fit)
    return _result(fit, rig, chosen, lowered)


def _rows_are_slow(run: Run, rig: RigParameters) -> bool:
    """Return whether a drive shows if it gets further set-points between the rows of a log."""
    period = run.scenario.period_ns / NANOSECONDS
    return run.drive == "velocity" and period > SLOW_ROWS * float(min(rig.time_constants))


def _fitted(
    runs: Sequence[Run],
    rig: RigParameters,
    replay: Replay,
    progress: Progress,
    part: str = "",
) -> LeastSquares:
    """Return the least squares of the runs; no number is left if nothing moves.

    Over many swings a small error of the rope's length turns the load's phase by whole swings, and the sum of
    squares has many minima. So the first parts of long runs are fitted first.
    """
    experiments = [Experiment(run, rig, replay, MAX_READINGS // len(runs)) for run in runs]
    fit = LeastSquares(experiments, unknowns_of(rig, replay))
    long = [experiment.swings > MANY_SWINGS for experiment in experiments]
    if any(long):
        pairs = zip(runs, long, strict=True)
        parts = [first_samples(run, len(run.time_ns) // PARTS) if is_long else run for run, is_long in pairs]
        fit.begin_at(_fitted(parts, rig, replay, progress, "the first part of "))
    fit.drop_without_effect()
    while fit.unknowns:
        progress(f"fitting {len(fit.unknowns)} numbers to {part}{len(runs)} runs")
        fit.solve(ROUGHLY_ENOUGH if part else CLOSE_ENOUGH)
        if not fit.drop_unidentifiable():
            break
    return fit


def check_something_moves(fit: LeastSquares) -> None:
    """Raise InputError if no number of the crane is left to be fitted."""
    if not fit.unknowns:
        raise InputError(
            f"nothing is identified: no reading tells any of {', '.join(u.name for u in fit.dropped)}",
            allowed="logs in which the axes move and the load swings",
            remedy="play the set-points of 'cranectl new experiment RIG', and record these runs",
        )


def estimates_of(fit: LeastSquares, further: Array, of_encoders: Array) -> tuple[Estimate, ...]:
    """Return the numbers with their intervals, given two covariances in scales (P, P).

    One is of what the runs spread beyond the encoders' errors, the other of these errors. A misfit widens
    the intervals: residuals that are larger than noise move the numbers more than noise does.
    """
    estimates = []
    factor = float(student.ppf(0.975, len(fit.experiments) - 1))
    values, widening = fit.values(fit.common), max(fit.misfit, 1.0)
    for k, unknown in enumerate(fit.unknowns):
        spread, encoders = (unknown.scale * sqrt(matrix[k, k]) for matrix in (further, of_encoders))
        half = sqrt((factor * spread) ** 2 + widening * (NORMAL * encoders) ** 2)
        value, at_bound = values[unknown.name], fit.at_bound(k)
        estimates.append(Estimate(unknown.name, unknown.unit, value, half, spread, encoders, at_bound))
    return tuple(estimates)


def _open_numbers(fit: LeastSquares) -> tuple[OpenNumber, ...]:
    """Return the numbers that were left out, and how the others make up for them."""
    numbers, scales = [], [unknown.scale for unknown in fit.unknowns]
    for dropped in fit.dropped:
        pull = np.zeros(len(fit.unknowns))
        for (experiment, (base, by_common, by_own)), own in zip(fit.runs(), fit.own, strict=True):
            assumed = assumed_value(experiment.rig, dropped.name)
            values = fit.values(fit.common) | {dropped.name: assumed + FITTING_STEP * dropped.scale}
            moved = experiment.residuals(values, own * experiment.own_scale)
            pull += reduced_equations((moved - base) / FITTING_STEP, by_common, by_own)[1]
        others = (-fit.inverse @ pull * scales).tolist()
        compensation = {u.name: change for u, change in zip(fit.unknowns, others, strict=True)}
        numbers.append(OpenNumber(dropped.name, dropped.scale, compensation))
    return tuple(numbers)


def _result(
    fit: LeastSquares, rig: RigParameters, replay: Replay, lowered: Mapping[str, float]
) -> Identification:
    of_encoders = fit.encoder_covariance()
    further = fit.further_spread(fit.jackknife(), of_encoders)
    values = fit.values(fit.common)
    scales = np.array([unknown.scale for unknown in fit.unknowns])
    deviations = np.sqrt(np.diag(fit.inverse))
    products = np.outer(deviations, deviations)
    correlation = np.divide(fit.inverse, products, out=np.zeros_like(products), where=products > 0.0)
    pairs = [
        (fit.unknowns[i].name, fit.unknowns[j].name, float(correlation[i, j]))
        for i in range(len(scales))
        for j in range(i)
        if abs(correlation[i, j]) > STRONG_CORRELATION
    ]
    owns = [own * e.own_scale for e, own in zip(fit.experiments, fit.own, strict=True)]
    fitted = [(e, e.predicted(values, own), own) for e, own in zip(fit.experiments, owns, strict=True)]
    loads = tuple(
        load_difference(e, readings, own, values, band=np.zeros(len(readings)), noise=0.0)
        for e, readings, own in fitted
    )
    is_whole = all(np.isfinite(load.distance).all() for load in loads)
    return Identification(
        rig=rig_with(rig, values),
        replay=replay,
        estimates=estimates_of(fit, further, of_encoders),
        left_open=_open_numbers(fit),
        correlated=tuple(pairs),
        spread=further * np.outer(scales, scales),
        known=of_encoders * np.outer(scales, scales),
        misfits=fit.misfits(),
        converged=fit.done and is_whole and fit.misfit <= max(fit.first_misfit, MAX_MISFIT),
        lowered=lowered,
        comparisons=tuple(
            compare_readings(e, readings, reading_noise(rig, e.block), values) for e, readings, _ in fitted
        ),
        loads=loads,
    )

"""Judge whether a model covers a measured crane: predict runs that were not used to identify it.

The statistic of a run is the largest difference between reading and prediction over all channels and times,
in units of the standard deviation that the identified numbers, the noise and the start of the run leave
open. The same statistic of cranes that are drawn from what the identification leaves open tells how often
such a difference occurs without any error of the model. This is the comparison error against the validation
uncertainty of ASME V&V 20, at all times of a run at once. A tolerance is compared with the load's position.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np

from cranectl.simulate import Run
from cranectl.support import Array, InputError, Quantity
from cranectl.tools.measured.comparison import (
    LoadDifference,
    ReadingsComparison,
    block_means,
    compare_readings,
    load_difference,
)
from cranectl.tools.measured.experiment import MIN_SAMPLES_IN_SWING, Experiment
from cranectl.tools.measured.fit import Fit
from cranectl.tools.measured.identity import Trace
from cranectl.tools.measured.uncertainty import BAND_DEVIATIONS, UncertainPrediction, predict_with_errors

ENOUGH_LARGER = 20  # draws with a larger statistic, from which their share is known well enough
SEED = 0  # of the draws
FALSE_ALARMS = 0.05  # probability that a model without error is called not covered, of all runs together
MIN_TESTED_MOTION = 5.0  # times its band, by which a channel must move to be tested
SURE_DEVIATIONS = 3.0  # standard deviations from which a swing at the start is no noise
MIN_JUDGED_SAMPLES = 10  # of a run that is judged
MIN_OPEN_EFFECT = 5.0  # standard deviations by which a number that was never identified may move readings

COVERED = "covered"
WITHIN_TOLERANCE = "not covered, but within your tolerance"
NOT_COVERED = "not covered"
NOT_DECIDED = "not decided"


@dataclass(frozen=True)
class RunVerdict:
    """The answer for one run, and where the largest differences are."""

    name: str
    answer: str
    reason: str  # why it is not decided, else empty
    is_covered: bool  # whether a model without error explains the run
    probability: float  # that a model without error has a statistic as large
    limit: float  # statistic that a model without error exceeds with the allowed probability
    comparison: ReadingsComparison
    load: LoadDifference
    swing: float  # amplitude of the load's swing at the start [rad], 0 if it may hang still
    tested: tuple[str, ...]  # channels whose predicted motion is several times its band
    widest_by: str  # what adds most to the band
    needs: tuple[str, ...]  # numbers that were never identified, and move the readings of this run
    obstacle: str  # why no tolerance can decide this run, or an empty text

    @property
    def statistic(self) -> float:
        """Largest difference over its standard deviation."""
        return float(self.comparison.ratio.max())

    @property
    def worst(self) -> tuple[int, int]:
        """Block and channel of the statistic."""
        block, channel = np.unravel_index(int(np.argmax(self.comparison.ratio)), self.comparison.ratio.shape)
        return int(block), int(channel)

    @property
    def channel(self) -> str:
        """Name of the channel of the statistic."""
        return self.comparison.channels[self.worst[1]]

    @property
    def left_at(self) -> float | None:
        """Time at which a difference first exceeds what the model allows [s], or None."""
        outside = (self.comparison.ratio > self.limit).any(axis=1)
        return float(self.comparison.time[int(np.argmax(outside))]) if outside.any() else None

    @property
    def largest(self) -> float:
        """Largest distance between measured and predicted load [m]."""
        return float(self.load.distance[self.load.largest])

    @property
    def largest_at(self) -> float:
        """Time of the largest distance [s]."""
        return float(self.load.time[self.load.largest])

    @property
    def band(self) -> float:
        """Widest band around the predicted load [m]."""
        return float(self.load.band.max())

    @property
    def met_tolerance(self) -> float:
        """Smallest tolerance that this run meets [m]."""
        return smallest_tolerance(self.load, self.comparison.block)

    def to_json(self) -> dict[str, Any]:
        """Return plain data; a prediction that ended early has no largest difference."""
        numbers = {
            "largest_m": self.largest,
            "difference_m": float(self.comparison.difference[self.worst]),
            "met_tolerance_m": self.met_tolerance,
            "statistic": self.statistic,
        }
        return {
            "name": self.name,
            "answer": self.answer,
            "reason": self.reason,
            "probability": self.probability,
            "limit": self.limit,
            "channel": self.channel,
            "time_s": float(self.comparison.time[self.worst[0]]),
            "left_band_s": self.left_at,
            "largest_s": self.largest_at,
            "band_m": self.band,
            "noise_m": self.load.noise,
            "swing_at_start_rad": self.swing,
            "tested": list(self.tested),
            "never_identified": list(self.needs),
        } | {name: value if np.isfinite(value) else None for name, value in numbers.items()}


def judge(runs: Mapping[str, Run], fit: Fit, *, tolerance: float | None = None) -> tuple[RunVerdict, ...]:
    """Judge measured runs, by name, by an identified crane; return an answer for each run.

    `tolerance` is the largest difference that its user accepts [m]. Raises InputError for a run whose
    readings were used to identify the crane, whatever its file is called and however it was imported.
    """
    for name, run in runs.items():
        trace = Trace.of(run)
        for number, used in enumerate(fit.used, 1):
            if (common := Trace.overlap(trace, used)).seconds > 0.0:
                raise InputError(
                    f"{common.seconds:.3g} s of {name} were used to identify the crane (log {number})",
                    allowed="runs that were not used",
                    remedy="record further runs, or identify from the others and judge these",
                )
    return tuple(_judge_run(name, run, fit, len(runs), tolerance) for name, run in runs.items())


def _judge_run(name: str, run: Run, fit: Fit, judged: int, tolerance: float | None) -> RunVerdict:
    experiment = Experiment(run, fit.rig, fit.replay, len(run.time_ns))
    if len(run.time_ns) < MIN_JUDGED_SAMPLES:
        raise InputError(
            f"{name} has {len(run.time_ns)} samples",
            allowed=f"at least {MIN_JUDGED_SAMPLES}",
            remedy="record a longer run",
        )
    if not experiment.at_rest:
        raise InputError(
            f"{name} begins in motion: {experiment.motion}",
            allowed="runs that begin with axes at rest, from where the prediction starts",
            remedy="import a part that begins at rest, by from in its map",
        )
    prediction = predict_with_errors(experiment, fit.values, fit.errors)
    comparison = compare_readings(
        experiment, prediction.readings, _all_channels(experiment, prediction), fit.values
    )
    load = load_difference(
        experiment,
        prediction.readings,
        prediction.own,
        fit.values,
        band=prediction.load_band,
        noise=prediction.load_noise,
    )
    allowed = FALSE_ALARMS / judged
    probability, limit = _probability(prediction, float(comparison.ratio.max()), fit.runs - 1, allowed)
    swing = _swing_at_start(experiment, prediction)
    tested = _tested_channels(comparison)
    verdict = RunVerdict(
        name=name,
        answer=NOT_DECIDED,
        reason="",
        obstacle=_undecidable(experiment, fit),
        needs=_never_identified(experiment, prediction, fit),
        is_covered=probability >= allowed,
        probability=probability,
        limit=limit,
        comparison=comparison,
        load=load,
        swing=swing,
        tested=tested,
        widest_by=prediction.widest_by,
    )
    answer, reason = answer_for(verdict, tolerance)
    return replace(verdict, answer=answer, reason=reason)


def _undecidable(experiment: Experiment, fit: Fit) -> str:
    """Return why no run, or not this one, can be judged, or an empty text."""
    if not fit.converged:
        return "the optimiser that fitted the crane did not finish"
    if experiment.samples_in_swing < MIN_SAMPLES_IN_SWING:
        return (
            f"the log is too slow: {experiment.samples_in_swing:.3g} samples in the shortest swing, and "
            f"{MIN_SAMPLES_IN_SWING:g} show one"
        )
    return ""


def _never_identified(experiment: Experiment, prediction: UncertainPrediction, fit: Fit) -> tuple[str, ...]:
    """Return the names of numbers that were not identified, and move the readings of this run."""
    means = [
        block_means(change, experiment.block)[:, experiment.channels] for change in prediction.open_changes
    ]
    others = np.square(prediction.deviation) - np.square(means).sum(axis=0)
    deviation = np.sqrt(np.maximum(others, np.square(prediction.least)))
    names = zip(fit.errors.left_open, means, strict=True)
    return tuple(name for name, mean in names if float((np.abs(mean) / deviation).max()) > MIN_OPEN_EFFECT)


def answer_for(verdict: RunVerdict, tolerance: float | None) -> tuple[str, str]:
    """Return the answer for a run, and the reason if it is not decided."""
    if verdict.obstacle:
        return NOT_DECIDED, verdict.obstacle
    is_covered = verdict.is_covered
    is_met = tolerance is not None and verdict.met_tolerance <= tolerance
    needed = Quantity(verdict.met_tolerance, "m").text()
    if verdict.needs and not is_met:  # the band has what they leave open
        why = f"this run needs numbers that were never identified: {', '.join(verdict.needs)}"
        return NOT_DECIDED, f"{why}; a tolerance of {needed} would be met"
    if is_covered and not verdict.tested:
        return NOT_DECIDED, f"nothing moved by more than {MIN_TESTED_MOTION:g} times its band"
    if tolerance is None:
        return (COVERED if is_covered else NOT_COVERED), ""
    if is_met:
        return (COVERED if is_covered else WITHIN_TOLERANCE), ""
    if is_covered or verdict.largest <= tolerance:
        size, band = Quantity(verdict.largest, "m").text(), Quantity(verdict.band, "m").text()
        why = f"the band of ± {band} is wider than your tolerance"
        if verdict.band <= tolerance:
            why = f"the difference of {size} and the band of ± {band} together exceed your tolerance"
        return NOT_DECIDED, f"{why}; {needed} would be met"
    return NOT_COVERED, ""


def smallest_tolerance(load: LoadDifference, block: int) -> float:
    """Return the tolerance [m] within which a run surely is.

    At each sample it contains the distance, less what the readings' noise explains, and the band. The mean
    distance over a block, from which noise has gone, and the band lie within it too.
    """
    single = float((load.distance + load.band).max()) - load.noise
    means = block_means(load.measured - load.predicted, block)
    bands = block_means(load.band[:, None], block)[:, 0]
    return max(single, float(np.nan_to_num(np.linalg.norm(means, axis=1) + bands, nan=np.inf).max()))


def _all_channels(experiment: Experiment, prediction: UncertainPrediction) -> Array:
    """Return the standard deviations of means with columns for all five channels (B, 5)."""
    deviation = np.ones((len(prediction.deviation), 5))
    deviation[:, experiment.channels] = prediction.deviation
    return deviation


def _swing_at_start(experiment: Experiment, prediction: UncertainPrediction) -> float:
    """Return the amplitude of a swing that the readings show at the start [rad], else 0."""
    swing, deviations = (v[experiment.compared :] for v in (prediction.own, prediction.own_deviations))
    if (np.abs(swing) <= SURE_DEVIATIONS * deviations).all():
        return 0.0
    return float(np.hypot(swing[0::2], swing[1::2] / experiment.frequency).max())


def _tested_channels(comparison: ReadingsComparison) -> tuple[str, ...]:
    """Return the channels whose predicted motion is several times its band."""
    motion = np.nanmax(comparison.predicted, axis=0) - np.nanmin(comparison.predicted, axis=0)
    band = BAND_DEVIATIONS * np.nanmax(comparison.deviation, axis=0)
    return tuple(
        name
        for name, moves in zip(comparison.channels, motion > MIN_TESTED_MOTION * band, strict=True)
        if moves
    )


def _probability(
    prediction: UncertainPrediction, statistic: float, freedom: int, allowed: float
) -> tuple[float, float]:
    """Return how often cranes without an error of the model have a larger statistic, and its allowed limit.

    The errors of numbers that are known from few runs have a t-distribution with `freedom` degrees. Draws
    end when enough of them are larger, or when they are enough for the probability `allowed`.
    """
    rng, draws = np.random.default_rng(SEED), ceil(ENOUGH_LARGER / allowed)
    modes, deviation = prediction.modes, prediction.deviation
    first_spread = len(modes) - prediction.spread_modes
    drawn: list[float] = []
    while len(drawn) < draws and sum(value >= statistic for value in drawn) < ENOUGH_LARGER:
        size = len(prediction.noise)
        errors = rng.standard_normal((size, len(modes)))
        errors[:, first_spread:] *= np.sqrt(freedom / rng.chisquare(freedom, size))[:, None]
        for error, noise in zip(errors, prediction.noise, strict=True):
            difference = np.tensordot(error, modes, axes=1) + noise
            drawn.append(float(np.max(np.abs(difference) / deviation)))
    larger = sum(value >= statistic for value in drawn)
    return (1 + larger) / (1 + len(drawn)), float(np.quantile(drawn, 1.0 - allowed))

"""Judge whether a model covers a measured crane: predict runs that were not used to identify it.

Nothing is fitted to a judged run. Its statistic is the largest difference between reading and prediction over
all channels and times, in units of the standard deviation that the identified numbers, the noise and the
resting place leave open. The same statistic of DRAWS cranes, drawn from what the identification leaves
open, tells how often such a difference occurs without any error of the model. This is the comparison error
against the validation uncertainty of ASME V&V 20, at all times of a run at once.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from cranectl.measured.comparison import BLOCK_SAMPLES, ReadingsComparison, block_means, compare_readings
from cranectl.measured.experiment import Experiment, encoders_of, reading_noise, rig_with
from cranectl.measured.identification import Identification
from cranectl.measured.identity import readings_digest
from cranectl.measured.replay import Replay
from cranectl.scenario.load import load_rig
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.support.documents import parse_json
from cranectl.support.errors import InputError

DRAWS = 400  # cranes that are drawn for up to RUNS_PER_DRAWS runs, and again as many for each more
RUNS_PER_DRAWS = 10
SEED = 0  # of the draws
FALSE_ALARMS = 0.05  # probability that a model without error is called not covered, of all runs together
BAND_DEVIATIONS = 2.0  # standard deviations of the band around a prediction
FIT_ENDING = "-fit.json"

COVERED = "covered"
WITHIN_TOLERANCE = "not covered, but within your tolerance"
NOT_COVERED = "not covered"
NOT_DECIDED = "not decided"


@dataclass(frozen=True)
class Fit:
    """What a verdict needs of an identification."""

    rig: RigParameters
    replay: Replay
    values: Mapping[str, float]
    covariance: Array  # (P, P)
    runs: int
    converged: bool
    used: frozenset[str]  # `readings_digest` of the runs to which it was fitted

    @property
    def deviations(self) -> Array:
        """Standard deviations of the numbers (P,)."""
        deviations: Array = np.sqrt(np.diag(self.covariance).clip(min=0.0))
        return deviations


@dataclass(frozen=True)
class RunVerdict:
    """The answer for one run, and where the largest difference is."""

    name: str
    answer: str
    probability: float  # that a model without error has a statistic as large
    comparison: ReadingsComparison

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
    def time(self) -> float:
        """Time of the statistic [s]."""
        return float(self.comparison.time[self.worst[0]])

    @property
    def band(self) -> float:
        """Widest half of the band around the prediction [m]."""
        return float(np.nanmax(BAND_DEVIATIONS * self.comparison.deviation))

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "name": self.name,
            "answer": self.answer,
            "probability": self.probability,
            "statistic": self.statistic,
            "channel": self.channel,
            "time_s": self.time,
            "difference_m": float(self.comparison.difference[self.worst]),
            "largest_m": self.comparison.largest,
            "band_m": self.band,
        }


def fit_text(result: Identification, runs: Sequence[Run]) -> str:
    """Return the file that keeps an identification for verdicts."""
    kept = {
        "replay": result.replay,
        "values": {estimate.name: estimate.value for estimate in result.estimates},
        "covariance": result.covariance.tolist(),
        "runs": result.runs,
        "converged": result.converged,
        "misfit": result.misfit,
        "used_readings": sorted(map(readings_digest, runs)),
    }
    return json.dumps(kept, indent=1) + "\n"


def fit_path(rig: Path) -> Path:
    """Return the file of the identification that belongs to a rig file."""
    return rig.with_name(rig.stem + FIT_ENDING)


def read_fit(rig: Path) -> Fit:
    """Return the identification of the rig in the file `rig`; raise InputError if there is none."""
    path = fit_path(rig)
    try:
        kept = parse_json(path.read_text(encoding="utf-8"), str(path))
        values, covariance = dict(kept["values"]), np.array(kept["covariance"], dtype=np.float64)
        if covariance.shape != (len(values),) * 2:
            raise ValueError("covariance of another size")
        return Fit(
            rig=rig_with(load_rig(rig), values),
            replay=kept["replay"],
            values=values,
            covariance=covariance,
            runs=int(kept["runs"]),
            converged=bool(kept["converged"]),
            used=frozenset(kept["used_readings"]),
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise InputError(
            f"cannot read {path}, what is known of how exact {rig} is: {error}",
            allowed="a rig of `cranectl identify`, with the files beside it",
            remedy=f"identify the crane again, with --out {rig}",
        ) from None


def judge(runs: Mapping[str, Run], fit: Fit, *, tolerance: float | None = None) -> tuple[RunVerdict, ...]:
    """Judge measured runs, by name, by an identified crane; return an answer for each run.

    `tolerance` is the largest difference that its user accepts [m]. Raises InputError for a run whose
    readings were used to identify the crane, whatever its file is called and however it was imported.
    """
    if used := [name for name, run in runs.items() if readings_digest(run) in fit.used]:
        raise InputError(
            f"{', '.join(used)} was used to identify the crane",
            allowed="runs that were not used",
            remedy="record further runs, or identify from the others and judge these",
        )
    return tuple(_judge_run(name, run, fit, len(runs), tolerance) for name, run in runs.items())


def _judge_run(name: str, run: Run, fit: Fit, judged: int, tolerance: float | None) -> RunVerdict:
    experiment = Experiment(run, fit.rig, fit.replay, len(run.time_ns))
    if len(run.time_ns) < BLOCK_SAMPLES:
        raise InputError(
            f"{name} has {len(run.time_ns)} samples",
            allowed=f"at least {BLOCK_SAMPLES}, whose means are compared",
            remedy="record a longer run",
        )
    if not experiment.at_rest:
        raise InputError(
            f"{name} begins in motion: {experiment.motion}",
            allowed="runs that begin with axes and load at rest, from where the prediction starts",
            remedy="import a part that begins at rest, by from in its map",
        )
    rest, rest_deviations = _resting_place(experiment)
    predicted = experiment.predicted(fit.values, rest)
    changes = [
        experiment.predicted({**fit.values, number: value + deviation}, rest) - predicted
        for (number, value), deviation in zip(fit.values.items(), fit.deviations, strict=True)
    ]
    changes += [
        experiment.predicted(fit.values, rest + change) - predicted for change in np.diag(rest_deviations)
    ]
    deviations = np.concatenate([fit.deviations, rest_deviations])
    slopes = np.array(changes) / deviations[:, None, None]  # (P, N, 5)
    covariance = block_diag(fit.covariance, np.diag(rest_deviations**2))
    mean_slopes = np.array([block_means(slope) for slope in slopes])  # (P, B, 5)
    variance = np.einsum("pbc,pq,qbc->bc", mean_slopes, covariance, mean_slopes)
    variance += reading_noise(fit.rig, BLOCK_SAMPLES) ** 2
    draws = DRAWS * ceil(judged / RUNS_PER_DRAWS)
    drawn = _drawn_differences(predicted, slopes, rest_deviations, fit, draws)[:, :, experiment.channels]
    comparison = compare_readings(experiment, predicted, np.sqrt(variance), fit.values)
    statistics = np.abs(drawn / np.sqrt(variance)[:, experiment.channels]).max(axis=(1, 2))
    probability = float(1 + np.sum(statistics >= comparison.ratio.max())) / (1 + draws)
    answer = _answer(comparison, probability >= FALSE_ALARMS / judged, fit.converged, tolerance)
    return RunVerdict(name, answer, probability, comparison)


def _answer(
    comparison: ReadingsComparison, is_covered: bool, converged: bool, tolerance: float | None
) -> str:
    bands = BAND_DEVIATIONS * comparison.deviation
    if not converged or (is_covered and tolerance is not None and float(bands.max()) > tolerance):
        return NOT_DECIDED
    if is_covered:
        return COVERED
    within = tolerance is not None and float((np.abs(comparison.difference) + bands).max()) <= tolerance
    return WITHIN_TOLERANCE if within else NOT_COVERED


def _resting_place(experiment: Experiment) -> tuple[Array, Array]:
    """Return where the compared channels (C,) rest before the axes move, and standard deviations."""
    still, rig = experiment.still_samples(), experiment.rig
    readings = experiment.readings[:still].mean(axis=0)
    rest = np.concatenate([readings[:3] - experiment.readings[0, :3], readings[3:]])
    deviation = reading_noise(rig, min(still, BLOCK_SAMPLES))
    # A pivot that sticks holds the rope anywhere within the angle at which its friction carries the weight.
    stuck = rig.effects.friction.pivot_coulomb / (rig.load_mass * rig.gravity * readings[2])
    deviation[3:] = np.hypot(deviation[3:], stuck / np.sqrt(3.0))
    return rest[experiment.channels], deviation[experiment.channels]


def _drawn_differences(
    predicted: Array, slopes: Array, rest_deviations: Array, fit: Fit, draws: int
) -> Array:
    """Return measured minus predicted (draws, B, 5) of cranes that the identification leaves open."""
    rng, freedom = np.random.default_rng(SEED), fit.runs - 1
    steps, noise = encoders_of(fit.rig)
    values, vectors = np.linalg.eigh(fit.covariance)
    root = vectors * np.sqrt(values.clip(min=0.0))
    differences = []
    for _ in range(draws):
        spread = np.sqrt(freedom / rng.chisquare(freedom))
        errors = spread * root @ rng.standard_normal(len(root))
        rest_errors = rest_deviations * rng.standard_normal(len(rest_deviations))
        readings = predicted + np.tensordot(np.concatenate([errors, rest_errors]), slopes, axes=1)
        readings += noise * rng.standard_normal(predicted.shape)
        differences.append(block_means(np.round(readings / steps) * steps - predicted))
    return np.array(differences)

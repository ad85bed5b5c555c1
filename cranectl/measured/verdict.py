"""Judge whether a model covers a measured crane: predict runs that were not used to identify it.

Nothing is fitted to a judged run. Its statistic is the largest difference between reading and prediction over
all channels and times, in units of the standard deviation that the identified numbers, the noise and the
resting place leave open. The same statistic of DRAWS cranes, drawn from what the identification leaves
open, tells how often such a difference occurs without any error of the model. This is the comparison error
against the validation uncertainty of ASME V&V 20, at all times of a run at once.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.measured.experiment import CHANNELS, Experiment, rig_with
from cranectl.measured.identification import Identification
from cranectl.measured.replay import Replay
from cranectl.scenario.load import load_rig
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.support.documents import parse_json
from cranectl.support.errors import InputError

BLOCK_SAMPLES = 25  # samples whose mean is compared
DRAWS = 400  # cranes that are drawn
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
    used: frozenset[str]  # digests of the runs to which it was fitted


@dataclass(frozen=True)
class RunVerdict:
    """The answer for one run, and where the largest difference is."""

    name: str
    answer: str
    probability: float  # that a model without error has a statistic as large
    statistic: float
    channel: str
    time: float  # [s]
    difference: float  # measured minus predicted there [m]; angles times the rope's length
    largest: float  # difference anywhere [m]
    band: float  # widest half of the band [m]

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return dict(vars(self))


def run_digest(run: Run) -> str:
    """Return a digest of where a measured run is from: its files and the map."""
    return hashlib.sha256(run.model.encode()).hexdigest()


def fit_text(result: Identification, runs: Sequence[Run]) -> str:
    """Return the file that keeps an identification for verdicts."""
    kept = {
        "replay": result.replay,
        "values": {estimate.name: estimate.value for estimate in result.estimates},
        "covariance": result.covariance.tolist(),
        "runs": result.runs,
        "converged": result.converged,
        "misfit": result.misfit,
        "used": sorted(map(run_digest, runs)),
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
            used=frozenset(kept["used"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"cannot read {path}, what is known of how exact {rig} is: {error}",
            allowed="a rig of `cranectl identify`, with the files beside it",
            remedy=f"identify the crane again, with --out {rig}",
        ) from None


def judge(runs: Mapping[str, Run], fit: Fit, *, tolerance: float | None = None) -> tuple[RunVerdict, ...]:
    """Judge measured runs by an identified crane.

    Parameters
    ----------
    runs : Mapping
        Measured runs by name, none of them used for the identification.
    fit : Fit
        The identified crane.
    tolerance : float, optional
        Largest difference that its user accepts [m].

    Returns
    -------
    tuple of RunVerdict
        An answer for each run.

    Raises
    ------
    InputError
        For a run that was used to identify the crane.
    """
    if used := [name for name, run in runs.items() if run_digest(run) in fit.used]:
        raise InputError(
            f"{', '.join(used)} was used to identify the crane",
            allowed="runs that were not used",
            remedy="record further runs, or identify from the others and judge these",
        )
    return tuple(_judge_run(name, run, fit, len(runs), tolerance) for name, run in runs.items())


def _judge_run(name: str, run: Run, fit: Fit, judged: int, tolerance: float | None) -> RunVerdict:
    experiment = Experiment(run, fit.rig, fit.replay, len(run.time_ns))
    if not experiment.at_rest:
        raise InputError(
            f"{name} begins in motion",
            allowed="runs that begin with axes and load at rest, from where the prediction starts",
            remedy="import a part that begins at rest, by from in its map",
        )
    own, own_deviation = _resting_place(experiment, fit.rig)
    predicted = experiment.predicted(fit.values, own)
    deviations = np.sqrt(np.diag(fit.covariance).clip(min=0.0))
    slopes = [
        _blocks((experiment.predicted({**fit.values, n: v + d}, own) - predicted) / d, experiment)
        if d > 0.0
        else np.zeros_like(_blocks(predicted, experiment))
        for (n, v), d in zip(fit.values.items(), deviations, strict=True)
    ]
    slope = np.array(slopes)  # (P, B, C)
    errors = _blocks(experiment.readings - predicted, experiment)
    noise = experiment.noise[experiment.channels] / np.sqrt(BLOCK_SAMPLES)
    fixed = np.square(noise) + np.square(own_deviation)
    variance = np.einsum("pbc,pq,qbc->bc", slope, fit.covariance, slope) + fixed
    statistic, draws = _statistic(errors, variance), _draws(slope, fit, noise, own_deviation, variance)
    probability = float(np.mean(draws >= statistic))
    lengths = _in_metres(predicted, experiment)
    sizes, bands = np.abs(errors) * lengths, BAND_DEVIATIONS * np.sqrt(variance) * lengths
    block, column = np.unravel_index(int(np.nanargmax(errors**2 / variance)), errors.shape)
    return RunVerdict(
        name=name,
        answer=_answer(probability >= FALSE_ALARMS / judged, fit.converged, sizes, bands, tolerance),
        probability=probability,
        statistic=statistic,
        channel=CHANNELS[experiment.channels][int(column)],
        time=float(run.time[int(block) * BLOCK_SAMPLES]),
        difference=float((errors * lengths)[block, column]),
        largest=float(np.nanmax(sizes)),
        band=float(np.nanmax(bands)),
    )


def _answer(is_covered: bool, converged: bool, sizes: Array, bands: Array, tolerance: float | None) -> str:
    if not converged or (is_covered and tolerance is not None and float(bands.max()) > tolerance):
        return NOT_DECIDED
    if is_covered:
        return COVERED
    within = tolerance is not None and float((sizes + bands).max()) <= tolerance
    return WITHIN_TOLERANCE if within else NOT_COVERED


def _resting_place(experiment: Experiment, rig: RigParameters) -> tuple[Array, Array]:
    """Return where a run rests before it moves, from its first readings, with its standard deviations."""
    still = experiment.still_samples()
    readings = experiment.readings[:still].mean(axis=0)
    zeros = np.concatenate([readings[:3] - experiment.readings[0, :3], readings[3:]])
    deviation = experiment.noise.copy()
    # A pivot that sticks holds the rope as far off the vertical as its friction carries the load's weight.
    stuck = rig.effects.friction.pivot_coulomb / (rig.load_mass * rig.gravity * readings[2])
    deviation[3:] = np.hypot(deviation[3:] / np.sqrt(min(still, BLOCK_SAMPLES)), stuck)
    return zeros[experiment.channels], deviation[experiment.channels]


def _blocks(values: Array, experiment: Experiment) -> Array:
    """Return the means over BLOCK_SAMPLES samples of the compared channels (B, C)."""
    compared = values[:, experiment.channels]
    whole = len(compared) // BLOCK_SAMPLES * BLOCK_SAMPLES
    means: Array = compared[:whole].reshape(-1, BLOCK_SAMPLES, compared.shape[1]).mean(axis=1)
    return means


def _in_metres(predicted: Array, experiment: Experiment) -> Array:
    """Return factors of the channels (B, C) from m or rad to m at the load."""
    rope = _blocks(np.tile(predicted[:, 2:3], len(CHANNELS)), experiment)
    is_angle = np.array([name in ("alpha", "beta") for name in CHANNELS[experiment.channels]])
    return np.where(is_angle, rope, 1.0)


def _statistic(errors: Array, variance: Array) -> float:
    return float(np.sqrt(np.nan_to_num(errors**2 / variance, nan=np.inf).max()))


def _draws(slope: Array, fit: Fit, noise: Array, own_deviation: Array, variance: Array) -> Array:
    """Return the statistic of DRAWS runs of cranes that the identification leaves open."""
    rng, freedom = np.random.default_rng(SEED), fit.runs - 1
    values, vectors = np.linalg.eigh(fit.covariance)
    root = vectors * np.sqrt(values.clip(min=0.0))
    blocks, channels = variance.shape
    statistics = np.empty(DRAWS)
    for k in range(DRAWS):
        scale = np.sqrt(freedom / rng.chisquare(freedom))
        shift = np.tensordot(scale * root @ rng.standard_normal(len(root)), slope, axes=1)
        shift += own_deviation * rng.standard_normal(channels)
        shift += noise * rng.standard_normal((blocks, channels))
        statistics[k] = _statistic(shift, variance)
    return statistics

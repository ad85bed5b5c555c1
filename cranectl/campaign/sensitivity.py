"""Which uncertain parameters decide how runs go: rank correlations, Sobol indices, tornado, failures.

First-order and total Sobol indices are of a Saltelli design, with bootstrap intervals, by the estimators of
Saltelli et al. (2010), table 2 (b) and (f), as `scipy.stats.sobol_indices` has them. SciPy takes a power of
two of base points only, which is not what is left where runs have failed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Campaign
from cranectl.campaign.results import Results
from cranectl.campaign.sampling import saltelli_blocks
from cranectl.campaign.statistics import (
    BINS,
    between_bins,
    complete_rows,
    equal_bins,
    kolmogorov_smirnov,
    noise_floor,
    quantiles,
    rank_correlations,
)
from cranectl.campaign.summary import CONFIDENCE, MAIN_METRICS, Group, compared_parameters
from cranectl.support.arrays import Array, Mask

RESAMPLES = 1000
MIN_BASE_POINTS = 16  # base points; resampling fewer tells little
IMPORTANT = 0.05  # share of the variance; below it a parameter may be fixed (Sarrazin et al. 2016)
MAX_DRAWN_NUMBERS = 2**22  # numbers drawn at a time


@dataclass(frozen=True)
class SobolIndices:
    """Indices (d,) of one output, for the parameters that vary; intervals (2, d) at the level CONFIDENCE."""

    first: Array
    total: Array
    first_interval: Array
    total_interval: Array
    base_points: int  # used
    left_out: int  # base points of which a run is missing, failed, or has no such output

    @property
    def important(self) -> Mask:
        """Whether a parameter's whole interval of the total index lies above IMPORTANT."""
        above: Mask = self.total_interval[0] > IMPORTANT
        return above


def sobol_indices(campaign: Campaign, outputs: Array) -> SobolIndices | None:
    """Compute Sobol indices from the outputs (runs,) of a Saltelli design, or return None.

    That is so with fewer than LEAST whole base points, or a constant output.
    """
    blocks = saltelli_blocks(campaign, outputs[:, np.newaxis])
    a, b, ab = blocks["f_A"][0], blocks["f_B"][0], blocks["f_AB"][:, 0]  # (n,), (n,), (d, n)
    whole = np.isfinite(a) & np.isfinite(b) & np.isfinite(ab).all(axis=0)
    n = int(whole.sum())
    if n < MIN_BASE_POINTS or np.ptp(np.concatenate((a[whole], b[whole]))) == 0.0:
        return None
    terms = _terms(a[whole], b[whole], ab[:, whole])
    first, total = _indices(terms.mean(axis=1)[np.newaxis])
    ends = (0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE)
    resampled = [_indices(means) for means in _bootstrap(terms)]
    first_interval, total_interval = (
        np.nanquantile(np.concatenate(parts), ends, axis=0) for parts in zip(*resampled, strict=True)
    )
    return SobolIndices(first[0], total[0], first_interval, total_interval, n, len(whole) - n)


def _terms(a: Array, b: Array, ab: Array) -> Array:
    """Return the terms whose means are the estimators, a column for each base point: (2 + 2 d, n)."""
    centre = 0.5 * (a.mean() + b.mean())
    a, b, ab = a - centre, b - centre, ab - centre
    return np.vstack((0.5 * (a + b), 0.5 * (a**2 + b**2), b * (ab - a), 0.5 * (a - ab) ** 2))


def _indices(means: Array) -> tuple[Array, Array]:
    """First-order and total indices (r, d) from means (r, 2 + 2 d) of the terms; NaN without variance."""
    variance = means[:, 1:2] - means[:, :1] ** 2
    d = means.shape[1] // 2 - 1
    shares = np.divide(means[:, 2:], variance, out=np.full(means[:, 2:].shape, np.nan), where=variance > 0.0)
    return shares[:, :d], shares[:, d:]


def _bootstrap(terms: Array) -> list[Array]:
    """Means of the terms over base points drawn with replacement, RESAMPLES rows in all."""
    n = terms.shape[1]
    random = np.random.default_rng(0)
    chunk = max(1, min(RESAMPLES, MAX_DRAWN_NUMBERS // n))
    indices = []
    for first in range(0, RESAMPLES, chunk):
        rows = min(chunk, RESAMPLES - first)
        counts = random.multinomial(n, np.full(n, 1.0 / n), size=rows)
        indices.append(counts @ terms.T / n)
    return indices


@dataclass(frozen=True)
class Correlations:
    """How metrics go with parameters over the completed runs of one group.

    ρ is Spearman's, which sees what rises or falls throughout; η what differs between ranges in any way.
    """

    plant: str
    controller: str
    parameters: tuple[str, ...]
    metrics: tuple[str, ...]
    rho: Array  # (parameters, metrics); NaN where one is constant
    runs: NDArray[np.intp]  # (metrics,) that have the metric
    floors: Array  # (metrics,) |ρ| up to which chance alone may be the reason
    eta: Array  # (parameters, metrics), of `between_bins`
    p: Array  # of η, before any correction

    @property
    def significant(self) -> Mask:
        """Which |ρ| are above the floor, (parameters, metrics); NaN is not."""
        above: Mask = np.abs(np.nan_to_num(self.rho)) > self.floors
        return above

    @property
    def bent(self) -> Mask:
        """Where η is beyond chance and larger than |ρ| explains: a minimum, a maximum, a step."""
        beyond = self.p * 2 * self.p.size < 1.0 - CONFIDENCE
        bent: Mask = beyond & (np.nan_to_num(self.eta) ** 2 > 2.0 * np.nan_to_num(self.rho) ** 2)
        return bent

    @property
    def strength(self) -> Array:
        """The larger of |ρ| and η where it is beyond chance, else 0: (parameters, metrics)."""
        rho = np.where(self.significant, np.abs(np.nan_to_num(self.rho)), 0.0)
        return np.where(self.bent, np.maximum(np.nan_to_num(self.eta), rho), rho)


@dataclass(frozen=True)
class Separation:
    """How one parameter differs between the runs of a group that failed and the others."""

    parameter: str
    distance: float  # Kolmogorov-Smirnov, 0 to 1; NaN where a side is empty
    significant: bool  # at CONFIDENCE, for all parameters together
    failed_median: float
    other_median: float


@dataclass(frozen=True)
class OneAtATimeEffect:
    """One step of a one-at-a-time design; metrics as in MAIN_METRICS, NaN of runs that did not complete."""

    sample: int
    parameter: str
    value: float
    metrics: Array


def correlations(results: Results, group: Group, values: Array) -> Correlations:
    """Compute all correlations of a group; `values` (samples, d) are those of the parameters.

    Of a Saltelli design only the rows of A and B count, the others repeat them but for one coordinate.
    """
    columns = compared_parameters(results)
    rows = independent_rows(results)
    x = values[rows][:, columns]
    bins = [equal_bins(column, BINS) for column in x.T]
    rho, eta, p = (np.full((len(columns), len(MAIN_METRICS)), np.nan) for _ in range(3))
    runs = np.zeros(len(MAIN_METRICS), dtype=np.intp)
    for k, metric in enumerate(MAIN_METRICS):
        y = group.metrics[metric][rows]
        runs[k] = complete_rows(x, y).sum()
        rho[:, k] = rank_correlations(x, y)
        eta[:, k], p[:, k] = between_bins(bins, y)
    floors = np.array([noise_floor(int(n), 2 * rho.size) for n in runs])  # ρ and η of each
    names = tuple(results.campaign.names[k] for k in columns)
    return Correlations(group.plant, group.controller, names, MAIN_METRICS, rho, runs, floors, eta, p)


def independent_rows(results: Results) -> NDArray[np.intp]:
    """Return the samples that were drawn independently of each other."""
    campaign = results.campaign
    rows = np.arange(campaign.runs)
    if campaign.settings.sampling == "saltelli":
        rows = rows[rows % (len(campaign.varied) + 2) < 2]
    return rows


def sobol_of(results: Results, group: Group) -> dict[str, SobolIndices]:
    """Sobol indices by metric, of those that have any."""
    by_metric = {name: sobol_indices(results.campaign, group.metrics[name]) for name in MAIN_METRICS}
    return {name: indices for name, indices in by_metric.items() if indices is not None}


def separations(results: Results, group: Group, values: Array) -> tuple[Separation, ...]:
    """Return one separation for each parameter, the largest first; none unless some runs failed."""
    rows = independent_rows(results)
    bad = group.failed[rows]
    good = group.there[rows] & ~bad
    if not (bad.any() and good.any()):
        return ()
    columns = compared_parameters(results)
    result = []
    for column in columns:
        x = values[rows, column]
        distance, p = kolmogorov_smirnov(x[bad], x[good])
        result.append(
            Separation(
                parameter=results.campaign.names[column],
                distance=distance,
                significant=bool(p * len(columns) < 1.0 - CONFIDENCE),
                failed_median=float(quantiles(x[bad], (0.5,))[0]),
                other_median=float(quantiles(x[good], (0.5,))[0]),
            )
        )
    return tuple(sorted(result, key=lambda separation: -separation.distance))


def one_at_a_time_effects(results: Results, group: Group, values: Array) -> tuple[OneAtATimeEffect, ...]:
    """Return the steps of a one-at-a-time design in order; sample 0 has the nominal values."""
    campaign = results.campaign
    columns = [k for k, p in enumerate(campaign.parameters) for _ in p.distribution.end_points()]
    return tuple(
        OneAtATimeEffect(
            sample=sample,
            parameter=campaign.names[column],
            value=float(values[sample, column]),
            metrics=np.array([group.metrics[name][sample] for name in MAIN_METRICS]),
        )
        for sample, column in enumerate(columns, 1)
    )

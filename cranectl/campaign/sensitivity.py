"""Find the uncertain parameters that decide the outcome of runs.

The methods are rank correlations, Sobol indices, one-at-a-time steps, and a comparison of failed runs with
the others. Sobol indices come from a Saltelli design, with bootstrap intervals. The estimators are those of
Saltelli et al. (2010), table 2 (b) and (f), as in `scipy.stats.sobol_indices`. SciPy's function takes only a
power of two of base points, but failed runs may leave any number.
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
from cranectl.support import Array, Mask

RESAMPLES = 1000  # of the bootstrap
MIN_BASE_POINTS = 16  # for Sobol indices; the bootstrap of fewer is not reliable
IMPORTANT_SHARE = 0.05  # of the variance; below it a parameter may be fixed (Sarrazin et al. 2016)
MAX_DRAWN_NUMBERS = 2**22  # numbers drawn at a time, which limits memory


@dataclass(frozen=True)
class SobolIndices:
    """Sobol indices (d,) of one output for the d parameters that vary, with their confidence intervals.

    The intervals (2, d) have the level CONFIDENCE.
    """

    first: Array
    total: Array
    first_interval: Array
    total_interval: Array
    base_points: int  # number of base points used
    left_out: int  # base points not used: one of their runs is missing, failed, or has no such output

    @property
    def important(self) -> Mask:
        """Whether the whole interval of a parameter's total index lies above IMPORTANT_SHARE, (d,)."""
        above: Mask = self.total_interval[0] > IMPORTANT_SHARE
        return above

    @staticmethod
    def of(results: Results, group: Group) -> "dict[str, SobolIndices]":
        """Return the Sobol indices of all metrics that have any, by metric."""
        by_metric = {name: sobol_indices(results.campaign, group.metrics[name]) for name in MAIN_METRICS}
        return {name: indices for name, indices in by_metric.items() if indices is not None}


def sobol_indices(campaign: Campaign, outputs: Array) -> SobolIndices | None:
    """Compute Sobol indices from the outputs (runs,) of a Saltelli design.

    Returns None with fewer than MIN_BASE_POINTS complete base points, or if the output is constant.
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
    """Return the terms (2 + 2 d, n) whose means over the n base points are the estimators."""
    centre = 0.5 * (a.mean() + b.mean())
    a, b, ab = a - centre, b - centre, ab - centre
    return np.vstack((0.5 * (a + b), 0.5 * (a**2 + b**2), b * (ab - a), 0.5 * (a - ab) ** 2))


def _indices(means: Array) -> tuple[Array, Array]:
    """Return first-order and total indices (r, d) from means (r, 2 + 2 d); NaN without variance."""
    variance = means[:, 1:2] - means[:, :1] ** 2
    d = means.shape[1] // 2 - 1
    shares = np.divide(means[:, 2:], variance, out=np.full(means[:, 2:].shape, np.nan), where=variance > 0.0)
    return shares[:, :d], shares[:, d:]


def _bootstrap(terms: Array) -> list[Array]:
    """Return means of the terms over base points drawn with replacement, RESAMPLES rows in all."""
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
    """Correlations between parameters and metrics over the completed runs of one group.

    Spearman's ρ finds metrics that always rise or always fall with a parameter. The ratio η finds any
    difference of a metric between ranges of the parameter.
    """

    plant: str
    controller: str
    parameters: tuple[str, ...]
    metrics: tuple[str, ...]
    rho: Array  # (parameters, metrics); NaN if one is constant
    runs: NDArray[np.intp]  # (metrics,) number of runs that have the metric
    floors: Array  # (metrics,) the largest |ρ| that chance alone may explain
    eta: Array  # (parameters, metrics), from `between_bins`
    p: Array  # p-values of η, not corrected for the number of tests

    @property
    def significant(self) -> Mask:
        """Whether |ρ| is above the floor, (parameters, metrics); False for NaN."""
        above: Mask = np.abs(np.nan_to_num(self.rho)) > self.floors
        return above

    @property
    def bent(self) -> Mask:
        """Whether η is significant and ρ² is less than half of η², as at a minimum, a maximum or a step."""
        significant = self.p * 2 * self.p.size < 1.0 - CONFIDENCE
        bent: Mask = significant & (np.nan_to_num(self.eta) ** 2 > 2.0 * np.nan_to_num(self.rho) ** 2)
        return bent

    @property
    def strength(self) -> Array:
        """The larger of |ρ| and η if it is significant, else 0: (parameters, metrics)."""
        rho = np.where(self.significant, np.abs(np.nan_to_num(self.rho)), 0.0)
        return np.where(self.bent, np.maximum(np.nan_to_num(self.eta), rho), rho)

    @staticmethod
    def of(results: Results, group: Group, values: Array) -> "Correlations":
        """Compute all correlations of a group; `values` (samples, d) are those of the parameters.

        Only samples that were drawn independently count.
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


@dataclass(frozen=True)
class Separation:
    """Difference of one parameter between the failed runs of a group and the others."""

    parameter: str
    distance: float  # Kolmogorov-Smirnov statistic, 0 to 1; NaN if either side is empty
    significant: bool  # at the level CONFIDENCE for all parameters together
    failed_median: float
    other_median: float

    @staticmethod
    def all(results: Results, group: Group, values: Array) -> "tuple[Separation, ...]":
        """Return one separation for each parameter, the largest first; none unless only some runs failed."""
        rows = independent_rows(results)
        failed = group.failed[rows]
        good = group.has_run[rows] & ~failed
        if not (failed.any() and good.any()):
            return ()
        columns = compared_parameters(results)
        result = []
        for column in columns:
            x = values[rows, column]
            distance, p = kolmogorov_smirnov(x[failed], x[good])
            result.append(
                Separation(
                    parameter=results.campaign.names[column],
                    distance=distance,
                    significant=bool(p * len(columns) < 1.0 - CONFIDENCE),
                    failed_median=float(quantiles(x[failed], (0.5,))[0]),
                    other_median=float(quantiles(x[good], (0.5,))[0]),
                )
            )
        return tuple(sorted(result, key=lambda separation: -separation.distance))


@dataclass(frozen=True)
class OneAtATimeEffect:
    """One run of a one-at-a-time design; metrics as in MAIN_METRICS, NaN if it did not complete."""

    sample: int
    parameter: str
    value: float
    metrics: Array

    @staticmethod
    def all(results: Results, group: Group, values: Array) -> "tuple[OneAtATimeEffect, ...]":
        """Return the runs of a one-at-a-time design from sample 1 on; sample 0 has the nominal values."""
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


def independent_rows(results: Results) -> NDArray[np.intp]:
    """Return the samples that were drawn independently; in a Saltelli design the rows of A and B."""
    campaign = results.campaign
    rows = np.arange(campaign.runs)
    if campaign.settings.sampling == "saltelli":
        rows = rows[rows % (len(campaign.varied) + 2) < 2]
    return rows

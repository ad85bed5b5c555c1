"""Compute statistics of arrays that may be short, constant or have gaps.

Where there is no answer, the result is NaN, without a warning.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.summary import CONFIDENCE, QUANTILE_ROUNDING
from cranectl.support import Array, InconsistentError, Mask

Bins = list[NDArray[np.intp]]  # indices of the rows in each bin

MIN_RANKED_VALUES = 3  # values for a rank correlation
BINS = 6  # number of ranges that the values of a parameter are divided into
MIN_BIN_ROWS = 8  # rows in a bin
LEVELS = (0.05, 0.5, 0.95)  # of the quantiles in reports


def quantiles(values: Array, at: tuple[float, ...] = LEVELS) -> Array:
    """Return quantiles of the finite values of (n,), linear between order statistics; NaN without any."""
    finite = values[np.isfinite(values)]
    values_at = np.quantile(finite, at) if finite.size else np.full(len(at), np.nan)
    named = [(f"the {level:g} quantile", float(value)) for level, value in zip(at, values_at, strict=True)]
    InconsistentError.check_ascending(*named, rounding=QUANTILE_ROUNDING)
    return values_at


def empirical_distribution(values: Array, max_points: int = 400) -> tuple[Array, Array]:
    """Return the steps (x, F(x)) of the empirical distribution function of (n,) values.

    NaN counts as larger than all numbers, so F then ends below 1. If there are more than `max_points` steps,
    it returns `max_points` evenly spaced ones.
    """
    finite = np.sort(values[~np.isnan(values)])
    steps = np.arange(1, finite.size + 1)
    if finite.size > max_points:
        chosen = np.unique(np.linspace(0, finite.size - 1, max_points).round().astype(np.intp))
        finite, steps = finite[chosen], steps[chosen]
    return finite, steps / max(1, values.size)


def rank_correlations(parameters: Array, outputs: Array) -> Array:
    """Return Spearman's ρ (d,) of each column of `parameters` (n, d) with `outputs` (n,).

    Rows with any NaN are left out. ρ is NaN if a column or the output is constant, or with fewer than
    MIN_RANKED_VALUES rows.
    """
    from scipy.stats import rankdata

    complete = complete_rows(parameters, outputs)
    if complete.sum() < MIN_RANKED_VALUES:
        return np.full(parameters.shape[1], np.nan)
    x, y = rankdata(parameters[complete], axis=0), rankdata(outputs[complete])
    x, y = x - x.mean(axis=0), y - y.mean()
    scale = np.sqrt((x**2).sum(axis=0) * (y**2).sum())
    rho: Array = np.divide(y @ x, scale, out=np.full(x.shape[1], np.nan), where=scale > 0.0)
    return rho


def complete_rows(parameters: Array, outputs: Array) -> Mask:
    """Return a mask (n,) of the rows in which all parameters and the output are finite."""
    rows: Mask = np.isfinite(outputs) & np.isfinite(parameters).all(axis=1)
    return rows


def noise_floor(n: int, tests: int) -> float:
    """Return the |ρ| of n pairs that chance exceeds with a probability of at most 1 - CONFIDENCE.

    The probability is that of any of `tests` tests (Bonferroni). The distribution is Student's t with n - 2
    degrees of freedom, as for SciPy's p-values. The result is 1 if n is too small for any conclusion.
    """
    from scipy.stats import t

    level = (1.0 - CONFIDENCE) / max(1, tests)
    perfect_order = 2.0 / math.factorial(min(n, 20))  # p-value of n ranks in perfect order
    if n < MIN_RANKED_VALUES or perfect_order > level:
        return 1.0
    quantile = float(t.isf(0.5 * level, n - 2))
    return quantile / math.sqrt(n - 2 + quantile**2)


def between_bins(bins_by_parameter: Sequence[Bins], y: Array) -> tuple[Array, Array]:
    """Return how much the ranks of `y` (n,) differ between bins of each parameter: η and p, shape (d,) each.

    η² is the share of the ranks' variance between the bins, and p the p-value of the Kruskal-Wallis test.
    Unlike ρ, η detects a relation that is not monotonic, such as an error that grows with a disturbance in
    either direction. Rows without `y` are left out. η is NaN and p is 1 if fewer than two bins have
    MIN_BIN_ROWS rows.
    """
    from scipy.stats import chi2, rankdata

    eta, p = np.full(len(bins_by_parameter), np.nan), np.ones(len(bins_by_parameter))
    finite = np.isfinite(y)
    ranks = np.full(y.size, np.nan)
    ranks[finite] = rankdata(y[finite])
    for k, bins in enumerate(bins_by_parameter):
        ranks_by_bin = [ranks[rows] for rows in bins]
        parts = [part[~np.isnan(part)] for part in ranks_by_bin]
        parts = [part for part in parts if part.size >= MIN_BIN_ROWS]
        if len(parts) < 2:
            continue
        together = np.concatenate(parts)
        variation = float(((together - together.mean()) ** 2).sum())
        if variation:
            between = sum(part.size * float(part.mean() - together.mean()) ** 2 for part in parts)
            eta[k] = math.sqrt(between / variation)
            # Its first argument is H of Kruskal and Wallis.
            p[k] = chi2.sf(between / variation * (together.size - 1), len(parts) - 1)
    return eta, p


def kolmogorov_smirnov(a: Array, b: Array) -> tuple[float, float]:
    """Return the largest distance of two empirical distribution functions, and its asymptotic p-value."""
    from scipy.stats import ks_2samp

    a, b = a[np.isfinite(a)], b[np.isfinite(b)]
    if not (a.size and b.size):
        return math.nan, math.nan
    test = ks_2samp(a, b, method="asymp")
    return float(test.statistic), float(test.pvalue)


def sign_test(first: int, second: int) -> float:
    """Return the two-sided p-value of two counts under the hypothesis that both cases are equally likely.

    For differences this is the sign test without ties, and for failures McNemar's exact test.
    """
    from scipy.stats import binomtest

    return float(binomtest(min(first, second), first + second).pvalue) if first + second else 1.0


def equal_bins(values: Array, max_bins: int) -> Bins:
    """Divide the indices of (n,) values into up to `max_bins` bins of equal size, in the order of the values.

    Equal values share a bin, so bins of discrete values may differ in size. NaN is left out.
    """
    order = np.argsort(values, kind="stable")
    order = order[~np.isnan(values[order])]
    if not order.size:
        return []
    sorted_values = values[order]
    count = max(1, min(max_bins, order.size // MIN_BIN_ROWS))
    levels = np.unique(sorted_values)
    if levels.size <= max_bins:
        cuts = np.searchsorted(sorted_values, levels[1:])
    else:
        ideal_cuts = np.arange(1, count) * order.size // count
        cuts = np.unique(np.searchsorted(sorted_values, sorted_values[ideal_cuts]))
    return [part for part in np.split(order, cuts) if part.size]

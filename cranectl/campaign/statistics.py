"""Statistics of arrays that may be short, constant or have gaps: NaN where there is no answer, no warning."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.summary import CONFIDENCE, QUANTILE_ROUNDING
from cranectl.support.arrays import Array, Mask
from cranectl.support.consistency import check_ascending

Bins = list[NDArray[np.intp]]  # rows in each

MIN_RANKED_VALUES = 3  # values for a rank correlation
BINS = 6  # ranges of a parameter
LEAST_IN_BIN = 8  # rows
LEVELS = (0.05, 0.5, 0.95)  # of the quantiles that are told


def quantiles(values: Array, at: tuple[float, ...] = LEVELS) -> Array:
    """Quantiles of the values that are there (n,), linear between order statistics; NaN without any."""
    finite = values[np.isfinite(values)]
    values_at = np.quantile(finite, at) if finite.size else np.full(len(at), np.nan)
    named = [(f"the {level:g} quantile", float(value)) for level, value in zip(at, values_at, strict=True)]
    check_ascending(*named, rounding=QUANTILE_ROUNDING)
    return values_at


def empirical_distribution(values: Array, most: int = 400) -> tuple[Array, Array]:
    """Return the steps (x, F(x)) of the empirical distribution function of (n,) values.

    NaN counts as larger than any: F then ends below 1. Beyond `most` steps, every so many-th is left.
    """
    finite = np.sort(values[~np.isnan(values)])
    steps = np.arange(1, finite.size + 1)
    if finite.size > most:
        chosen = np.unique(np.linspace(0, finite.size - 1, most).round().astype(np.intp))
        finite, steps = finite[chosen], steps[chosen]
    return finite, steps / max(1, values.size)


def rank_correlations(parameters: Array, outputs: Array) -> Array:
    """Spearman's ρ of each column of `parameters` (n, d) with `outputs` (n,): (d,).

    Rows in which anything is NaN are left out. NaN where a side is constant or has fewer than 3 rows.
    """
    from scipy.stats import rankdata

    keep = complete_rows(parameters, outputs)
    if keep.sum() < MIN_RANKED_VALUES:
        return np.full(parameters.shape[1], np.nan)
    x, y = rankdata(parameters[keep], axis=0), rankdata(outputs[keep])
    x, y = x - x.mean(axis=0), y - y.mean()
    scale = np.sqrt((x**2).sum(axis=0) * (y**2).sum())
    rho: Array = np.divide(y @ x, scale, out=np.full(x.shape[1], np.nan), where=scale > 0.0)
    return rho


def complete_rows(parameters: Array, outputs: Array) -> Mask:
    """Rows without NaN."""
    rows: Mask = np.isfinite(outputs) & np.isfinite(parameters).all(axis=1)
    return rows


def noise_floor(n: int, tests: int) -> float:
    """Return the size of ρ of n pairs that chance exceeds with probability 1 - CONFIDENCE at most.

    It is valid for `tests` tests at once, and 1 for too small n.

    Student's t with n - 2 degrees of freedom, as SciPy's p-values, at Bonferroni's level.
    """
    from scipy.stats import t

    level = (1.0 - CONFIDENCE) / max(1, tests)
    if (
        n < MIN_RANKED_VALUES or 2.0 / math.factorial(min(n, 20)) > level
    ):  # the p-value of n ranks in perfect order
        return 1.0
    quantile = float(t.isf(0.5 * level, n - 2))
    return quantile / math.sqrt(n - 2 + quantile**2)


def between_bins(bins_by_parameter: Sequence[Bins], y: Array) -> tuple[Array, Array]:
    """Return how much ranks of `y` (n,) differ between bins of each parameter: η and p, each (d,).

    η² is the share of the ranks' variance that lies between the bins, p is of the test by Kruskal and
    Wallis. Sees an error that grows with a disturbance to either side, which ρ does not. Rows without `y` are
    left out; NaN and 1 where fewer than two bins with LEAST_IN_BIN rows remain.
    """
    from scipy.stats import chi2, rankdata

    eta, p = np.full(len(bins_by_parameter), np.nan), np.ones(len(bins_by_parameter))
    there = np.isfinite(y)
    ranks = np.full(y.size, np.nan)
    ranks[there] = rankdata(y[there])
    for k, bins in enumerate(bins_by_parameter):
        ranks_by_bin = [ranks[rows] for rows in bins]
        parts = [part[~np.isnan(part)] for part in ranks_by_bin]
        parts = [part for part in parts if part.size >= LEAST_IN_BIN]
        if len(parts) < 2:
            continue
        together = np.concatenate(parts)
        variation = float(((together - together.mean()) ** 2).sum())
        if variation:
            between = sum(part.size * float(part.mean() - together.mean()) ** 2 for part in parts)
            eta[k] = math.sqrt(between / variation)
            p[k] = chi2.sf(between / variation * (together.size - 1), len(parts) - 1)
    return eta, p


def kolmogorov_smirnov(a: Array, b: Array) -> tuple[float, float]:
    """Largest distance of two empirical distribution functions, and its asymptotic p-value."""
    from scipy.stats import ks_2samp

    a, b = a[np.isfinite(a)], b[np.isfinite(b)]
    if not (a.size and b.size):
        return math.nan, math.nan
    test = ks_2samp(a, b, method="asymp")
    return float(test.statistic), float(test.pvalue)


def sign_test(fewer: int, more: int) -> float:
    """Probability of a split as uneven as this, or more, where both sides are equally likely.

    For differences it is the sign test without ties, for failures McNemar's exact test.
    """
    from scipy.stats import binomtest

    return float(binomtest(min(fewer, more), fewer + more).pvalue) if fewer + more else 1.0


def equal_bins(values: Array, most: int) -> Bins:
    """Return indices of (n,) values in order, cut into up to `most` parts of equal size.

    Equal values stay together, so parts of discrete values may differ in size; NaN is left out.
    """
    order = np.argsort(values, kind="stable")
    order = order[~np.isnan(values[order])]
    if not order.size:
        return []
    sorted_values = values[order]
    count = max(1, min(most, order.size // LEAST_IN_BIN))
    levels = np.unique(sorted_values)
    if levels.size <= most:
        cuts = np.searchsorted(sorted_values, levels[1:])
    else:
        wanted = np.arange(1, count) * order.size // count
        cuts = np.unique(np.searchsorted(sorted_values, sorted_values[wanted]))
    return [part for part in np.split(order, cuts) if part.size]

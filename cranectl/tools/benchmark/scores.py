"""Compute the scores of a benchmark from arrays (n,) with one value for each crane.

A failed run counts as worse than all others, and a run that does not settle as longer than all that do. So a
controller gains nothing by failing on difficult cranes.
"""

from typing import NamedTuple

import numpy as np

from cranectl.support import Array, InconsistentError, Mask

SCORE_RESAMPLES = 2000  # number of bootstrap samples
LEVEL = 0.95  # confidence level of the interval of a median
MIN_INTERVAL_VALUES = 6  # the range of fewer values has a confidence level below LEVEL for the median
ACCEPTED_FAILURES = 0.05  # share of failures at the robustness radius


class PairedDifference(NamedTuple):
    """Differences between a controller and the baseline, over the cranes on which both have a value."""

    cranes: int
    median: float
    low: float  # ends of the bootstrap interval of the median
    high: float
    larger_less_smaller: float  # share of cranes with a larger value, minus the share with a smaller one


def paired_difference(values: Array, baseline: Array, seed: int) -> PairedDifference:
    """Compare values (n,) with those (n,) of the baseline on the same cranes; NaN means no value."""
    difference = (values - baseline)[np.isfinite(values) & np.isfinite(baseline)]
    if not difference.size:
        return PairedDifference(0, *[float("nan")] * 4)
    generator = np.random.Generator(np.random.Philox(seed))
    samples = generator.integers(difference.size, size=(SCORE_RESAMPLES, difference.size))
    tails = [50.0 * (1.0 - LEVEL), 50.0 * (1.0 + LEVEL)]
    low, high = np.percentile(np.median(difference[samples], axis=1), tails)
    effect = float(np.sign(difference).mean())
    InconsistentError.check_ascending(("the interval's low end", float(low)), ("its high end", float(high)))
    return PairedDifference(difference.size, float(np.median(difference)), float(low), float(high), effect)


def unsettled_time(settling: Array, failed: Mask, horizon: float) -> Array:
    """Return how long (n,) [s] the load is unsettled during the rest phase of `horizon` [s].

    It is the whole rest phase for runs that failed or did not settle; `settling` (n,) is NaN for the latter.
    """
    return np.where(failed | np.isnan(settling), horizon, np.minimum(settling, horizon))


def unsettled_share(settling: Array, failed: Mask, horizon: float) -> float:
    """Return the mean unsettled share of the rest phase of `horizon` [s].

    This is the restricted mean of censored settling times.
    """
    return float(unsettled_time(settling, failed, horizon).mean() / horizon)


def median_with_failures(values: Array, failed: Mask) -> float:
    """Return the median, where failed runs count as inf and missing values of other runs are left out.

    It is NaN if nothing is left.
    """
    with_failures = np.where(failed, np.inf, values)
    return float("nan") if np.isnan(with_failures).all() else float(np.nanmedian(with_failures))


def settled_share(settling: Array, failed: Mask) -> float:
    """Return the share of runs that settle and do not fail."""
    return float((~failed & np.isfinite(settling)).mean())


def settling_quantile(settling: Array, failed: Mask, at: float) -> float:
    """Return the quantile `at` (above 0, up to 1) of the settling times [s].

    Runs that fail or do not settle count as inf. All runs are censored at the same time, so this is the
    quantile of the Kaplan-Meier estimator.
    """
    times = np.sort(np.where(failed | np.isnan(settling), np.inf, settling))
    return float(times[min(int(np.ceil(at * times.size)) - 1, times.size - 1)])


def performance_ratios(costs: Array) -> Array:
    """Divide costs (controllers, problems) by the least cost of each problem (Dolan and Moré 2002).

    Costs are not negative, and NaN means a failure. The ratio of a failure is inf.
    """
    costs = np.where(np.isnan(costs), np.inf, costs)
    best = costs.min(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios: Array = np.where(costs == best, 1.0, costs / best)
    ratios[np.isinf(costs)] = np.inf
    return ratios


def performance_profile(ratios: Array, at: Array) -> Array:
    """Return the share (controllers, k) of problems that a controller solves within the ratios `at` (k,)."""
    shares: Array = (ratios[:, :, np.newaxis] <= at).mean(axis=1)
    return shares


def dominates(points: Array) -> Mask:
    """Return a matrix (n, n) for (n, d) points, where lower is better.

    Element [i, j] is True if point i is nowhere worse than point j and somewhere better.
    """
    no_worse = (points[:, np.newaxis] <= points[np.newaxis]).all(axis=2)
    better = (points[:, np.newaxis] < points[np.newaxis]).any(axis=2)
    return np.asarray(no_worse & better)


def undominated(points: Array) -> Mask:
    """Return which of (n, d) points no other point dominates, (n,); lower is better."""
    return np.asarray(~dominates(points).any(axis=0))


def robustness_radius(factors: Array, failure_shares: Array) -> float:
    """Return the factor on all spreads above which the share of failures exceeds ACCEPTED_FAILURES.

    The share is interpolated linearly between the increasing `factors` (k,). The radius is 0 if the first
    share already exceeds it, and inf if none does.
    """
    above = np.flatnonzero(failure_shares > ACCEPTED_FAILURES)
    if not above.size:
        return float("inf")
    k = int(above[0])
    if k == 0:
        return 0.0
    low, high = failure_shares[k - 1], failure_shares[k]
    fraction = (ACCEPTED_FAILURES - low) / (high - low)
    return float(factors[k - 1] + fraction * (factors[k] - factors[k - 1]))

"""What a benchmark's runs amount to: pure functions of arrays, a row for each crane.

A run that failed counts as worse than any that did not; one that never settles as settling after its end. So
no controller gains by losing its hard cranes.
"""

from typing import NamedTuple

import numpy as np

from cranectl.support.arrays import Array, Mask
from cranectl.support.consistency import check_ascending

SCORE_RESAMPLES = 2000  # of the bootstrap
LEVEL = 0.95
MIN_INTERVAL_VALUES = 6  # values of which even the range is an interval of the median at that level
ACCEPTED = 0.05  # share of failures at the robustness radius


class PairedDifference(NamedTuple):
    """A controller less the baseline over the cranes on which both come to an end."""

    cranes: int
    median: float
    low: float  # ends of the interval of the median, by bootstrap
    high: float
    effect: float  # share of cranes on which it is larger, less that on which it is smaller


def paired_difference(values: Array, baseline: Array, seed: int) -> PairedDifference:
    """Compare (n,) values with those of the baseline on the same cranes; NaN where a run has none."""
    difference = (values - baseline)[np.isfinite(values) & np.isfinite(baseline)]
    if not difference.size:
        return PairedDifference(0, *[float("nan")] * 4)
    generator = np.random.Generator(np.random.Philox(seed))
    drawn = generator.integers(difference.size, size=(SCORE_RESAMPLES, difference.size))
    tails = [50.0 * (1.0 - LEVEL), 50.0 * (1.0 + LEVEL)]
    low, high = np.percentile(np.median(difference[drawn], axis=1), tails)
    effect = float(np.sign(difference).mean())
    check_ascending(("the interval's low end", float(low)), ("its high end", float(high)))
    return PairedDifference(difference.size, float(np.median(difference)), float(low), float(high), effect)


def unsettled_time(settling: Array, failed: Mask, horizon: float) -> Array:
    """Return the time (n,) [s] of the rest phase, `horizon` [s] long, before the load has settled.

    It is all of it where a run fails.

    `settling` (n,) is NaN where a run did not settle.
    """
    return np.where(failed | np.isnan(settling), horizon, np.minimum(settling, horizon))


def unsettled_share(settling: Array, failed: Mask, horizon: float) -> float:
    """Mean share of the rest, `horizon` [s], that passes unsettled: the restricted mean of censored times."""
    return float(unsettled_time(settling, failed, horizon).mean() / horizon)


def median_with_failures(values: Array, failed: Mask) -> float:
    """Median in which runs that failed are worse than any: inf among them; NaN where no run has a value."""
    counted = np.where(failed, np.inf, values)
    return float(np.nanmedian(counted)) if not np.isnan(counted).all() else float("nan")


def settled_share(settling: Array, failed: Mask) -> float:
    """Share of runs that settle and do not fail."""
    return float((~failed & np.isfinite(settling)).mean())


def settling_quantile(settling: Array, failed: Mask, at: float) -> float:
    """Quantile of settling times [s] in which runs that do not settle are longer than any: inf among them.

    All runs are censored at the same time, so it is that of Kaplan and Meier.
    """
    times = np.sort(np.where(failed | np.isnan(settling), np.inf, settling))
    return float(times[min(int(np.ceil(at * times.size)) - 1, times.size - 1)])


def performance_ratios(costs: Array) -> Array:
    """Costs (controllers, problems) over the least of each problem; inf for failures (Dolan and Moré 2002).

    Costs are not negative; NaN is a failure. A problem that every controller fails has inf for all.
    """
    costs = np.where(np.isnan(costs), np.inf, costs)
    best = costs.min(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios: Array = np.where(costs == best, 1.0, costs / best)
    ratios[np.isinf(costs)] = np.inf
    return ratios


def profile(ratios: Array, at: Array) -> Array:
    """Return the share of problems that each controller solves within a ratio of the best one."""
    shares: Array = (ratios[:, :, np.newaxis] <= at).mean(axis=1)
    return shares


def dominates(points: Array) -> Mask:
    """Return (n, n) for (n, d) points, lower is better: True where i is as good as j, and better in one."""
    no_worse = (points[:, np.newaxis] <= points[np.newaxis]).all(axis=2)
    better = (points[:, np.newaxis] < points[np.newaxis]).any(axis=2)
    return np.asarray(no_worse & better)


def undominated(points: Array) -> Mask:
    """Return which of (n, d) points no other point dominates; lower is better."""
    return np.asarray(~dominates(points).any(axis=0))


def radius(spreads: Array, shares: Array) -> float:
    """Return the factor on all spreads at which the share of failures exceeds ACCEPTED.

    Between the given factors the share is interpolated linearly.

    `spreads` increase; 0 where it is passed at the first one already, inf where it is not passed at all.
    """
    above = np.flatnonzero(shares > ACCEPTED)
    if not above.size:
        return float("inf")
    k = int(above[0])
    if k == 0:
        return 0.0
    part = (ACCEPTED - shares[k - 1]) / (shares[k] - shares[k - 1])
    return float(spreads[k - 1] + part * (spreads[k] - spreads[k - 1]))

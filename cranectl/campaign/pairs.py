"""Two groups of runs on the same samples: one controller against another, one plant against the other."""

from dataclasses import dataclass

import numpy as np

from cranectl.campaign.groups import MAIN_METRICS, Group
from cranectl.campaign.limits import low_is_bad
from cranectl.campaign.statistics import quantiles, rank_correlations, sign_test

DIFFERENCE_QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Failures:
    """How many samples fail in which of two groups; both have been run."""

    neither: int
    both: int
    first_only: tuple[int, ...]  # samples
    second_only: tuple[int, ...]

    @property
    def p(self) -> float:
        """Of McNemar's exact test: whether one fails more often than the other."""
        return sign_test(len(self.first_only), len(self.second_only))


@dataclass(frozen=True)
class Difference:
    """Second minus first of one metric over the samples that both completed."""

    metric: str
    samples: int
    quantiles: tuple[float, ...]  # DIFFERENCE_QUANTILES; NaN without samples
    first_better: int
    second_better: int
    p: float  # of the sign test

    @property
    def better_share(self) -> float:
        """Share of samples in which the second is better; NaN without samples."""
        return self.second_better / self.samples if self.samples else float("nan")


@dataclass(frozen=True)
class Agreement:
    """How alike two groups are in one metric over the samples that both completed."""

    metric: str
    samples: int
    rho: float  # Spearman's; NaN where one is constant
    quantiles: tuple[float, ...]  # of the absolute difference, DIFFERENCE_QUANTILES
    largest: tuple[tuple[int, float], ...]  # sample and difference, second minus first


def failures(first: Group, second: Group) -> Failures:
    """Whether two groups fail on the same samples."""
    there = first.there & second.there
    a, b = first.failed & there, second.failed & there
    return Failures(
        neither=int((there & ~a & ~b).sum()),
        both=int((a & b).sum()),
        first_only=tuple(np.flatnonzero(a & ~b).tolist()),
        second_only=tuple(np.flatnonzero(b & ~a).tolist()),
    )


def differences(first: Group, second: Group) -> tuple[Difference, ...]:
    """All of MAIN_METRICS."""
    return tuple(_difference(first, second, metric) for metric in MAIN_METRICS)


def agreement(first: Group, second: Group, metric: str, *, listed: int = 5) -> Agreement:
    """Of `metric`, with the `listed` samples that are farthest apart."""
    a, b = first.metrics[metric], second.metrics[metric]
    apart = b - a
    order = np.argsort(-np.abs(apart), kind="stable")
    order = order[~np.isnan(apart[order])]
    return Agreement(
        metric=metric,
        samples=order.size,
        rho=float(rank_correlations(a[:, np.newaxis], b)[0]),
        quantiles=tuple(quantiles(np.abs(apart), DIFFERENCE_QUANTILES).tolist()),
        largest=tuple((int(k), float(apart[k])) for k in order[:listed] if apart[k]),
    )


def _difference(first: Group, second: Group, metric: str) -> Difference:
    apart = second.metrics[metric] - first.metrics[metric]
    apart = apart[~np.isnan(apart)]
    up, down = int((apart > 0.0).sum()), int((apart < 0.0).sum())
    better, worse = (up, down) if low_is_bad(metric) else (down, up)
    return Difference(
        metric=metric,
        samples=apart.size,
        quantiles=tuple(quantiles(apart, DIFFERENCE_QUANTILES).tolist()),
        first_better=worse,
        second_better=better,
        p=sign_test(better, worse),
    )

"""Evaluate a finished campaign: all numbers of its report and of its JSON output.

A group is all runs with one controller on one plant. Groups are compared sample by sample: two controllers
on one plant, or one controller on two plants.
"""

import itertools
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cranectl.campaign.results import Results
from cranectl.campaign.sensitivity import Correlations, OneAtATimeEffect, Separation, SobolIndices
from cranectl.campaign.statistics import quantiles, rank_correlations, sign_test
from cranectl.campaign.summary import (
    MAIN_METRICS,
    MEASURE,
    Example,
    Group,
    GroupSummary,
    examples,
    groups_of,
    parameter_values,
    summarize,
)
from cranectl.metrics import Metric
from cranectl.plants import PLANTS
from cranectl.support import Array, JSONRecord, Tree

LISTED_RUNS = 3  # runs listed for each plant and controller
ONE_AT_A_TIME = "one-at-a-time"  # its samples do not spread over the distribution: no correlations
LISTED_SAMPLES = 5  # samples listed with the largest differences between two groups


@dataclass(frozen=True)
class Failures:
    """Failures of two groups on the samples that both have run."""

    neither: int
    both: int
    first_only: tuple[int, ...]  # samples on which only the first fails
    second_only: tuple[int, ...]
    p: float  # p-value of McNemar's exact test that both fail equally often


@dataclass(frozen=True)
class Difference:
    """One metric of the second group minus that of the first, on the samples that both completed."""

    metric: str
    samples: int
    quantiles: tuple[float, ...]  # at `statistics.LEVELS`; NaN without samples
    first_better: int
    second_better: int
    p: float  # of the sign test

    @property
    def better_share(self) -> float:
        """Share of samples on which the second is better; NaN without samples."""
        return self.second_better / self.samples if self.samples else float("nan")


@dataclass(frozen=True)
class GroupAgreement:
    """Similarity of two groups in one metric, on the samples that both completed."""

    metric: str
    samples: int
    rho: float  # Spearman's rank correlation; NaN if one is constant
    quantiles: tuple[float, ...]  # of the absolute difference, at `statistics.LEVELS`
    largest: tuple[tuple[int, float], ...]  # samples and their differences, second minus first


@dataclass(frozen=True)
class Pair(JSONRecord):
    """Comparison of two groups on the same samples."""

    first: Group
    second: Group
    failures: Failures
    differences: tuple[Difference, ...]  # one for each of MAIN_METRICS
    agreement: GroupAgreement  # in the metric MEASURE


def pair_of(first: Group, second: Group) -> Pair:
    """Compare two groups sample by sample."""
    both_run = first.has_run & second.has_run
    a, b = first.failed & both_run, second.failed & both_run
    first_only, second_only = np.flatnonzero(a & ~b).tolist(), np.flatnonzero(b & ~a).tolist()
    failures = Failures(
        neither=int((both_run & ~a & ~b).sum()),
        both=int((a & b).sum()),
        first_only=tuple(first_only),
        second_only=tuple(second_only),
        p=sign_test(len(first_only), len(second_only)),
    )
    differences = tuple(_difference(first, second, metric) for metric in MAIN_METRICS)
    return Pair(first, second, failures, differences, _agreement(first, second))


def _agreement(first: Group, second: Group) -> GroupAgreement:
    a, b = first.metrics[MEASURE], second.metrics[MEASURE]
    difference = b - a
    order = np.argsort(-np.abs(difference), kind="stable")
    order = order[~np.isnan(difference[order])]
    return GroupAgreement(
        metric=MEASURE,
        samples=order.size,
        rho=float(rank_correlations(a[:, np.newaxis], b)[0]),
        quantiles=tuple(quantiles(np.abs(difference)).tolist()),
        largest=tuple((int(k), float(difference[k])) for k in order[:LISTED_SAMPLES] if difference[k]),
    )


def _difference(first: Group, second: Group, metric: str) -> Difference:
    difference = second.metrics[metric] - first.metrics[metric]
    difference = difference[~np.isnan(difference)]
    larger, smaller = int((difference > 0.0).sum()), int((difference < 0.0).sum())
    better, worse = (larger, smaller) if Metric.low_is_bad(metric) else (smaller, larger)
    return Difference(
        metric=metric,
        samples=difference.size,
        quantiles=tuple(quantiles(difference).tolist()),
        first_better=worse,
        second_better=better,
        p=sign_test(better, worse),
    )


@dataclass(frozen=True)
class GroupAnalysis:
    """All results of one controller on one plant."""

    group: Group
    summary: GroupSummary
    correlations: Correlations | None  # None with one-at-a-time sampling
    sobol: dict[str, SobolIndices]  # by metric; empty unless the sampling is saltelli
    one_at_a_time: tuple[OneAtATimeEffect, ...]  # empty unless the sampling is one-at-a-time
    separations: tuple[Separation, ...]

    def to_json(self) -> dict[str, Any]:
        """Return all results but the summary, with arrays as NumPy arrays."""
        data = self.group.to_json()
        if self.correlations is not None:
            extra = {"significant": self.correlations.significant, "bent": self.correlations.bent}
            data["correlations"] = asdict(self.correlations) | extra
        if self.sobol:
            data["sobol"] = {name: {**asdict(s), "important": s.important} for name, s in self.sobol.items()}
        if self.one_at_a_time:
            data["one_at_a_time"] = [asdict(effect) for effect in self.one_at_a_time]
        return data | {"failures": [asdict(separation) for separation in self.separations]}


@dataclass(frozen=True)
class Analysis:
    """All results of a campaign."""

    results: Results  # of all runs
    values: Array  # (samples, d) values of the parameters
    groups: tuple[GroupAnalysis, ...]  # one for each controller on each plant
    controllers: tuple[Pair, ...]  # two controllers on the same plant
    plants: tuple[Pair, ...]  # the same controller on the reference plant and another
    worst: tuple[Example, ...]  # the worst run of each group

    @property
    def by_plant(self) -> list[list[GroupAnalysis]]:
        """The groups, one list for each plant."""
        return [list(parts) for _, parts in itertools.groupby(self.groups, lambda part: part.group.plant)]

    @staticmethod
    def of(results: Results) -> "Analysis":
        """Compute all results of a campaign; the same campaign gives the same numbers."""
        values, groups = parameter_values(results), groups_of(results)
        reference = PLANTS.reference(results.campaign.settings.plants)
        pairs = []
        for a, b in itertools.combinations(groups, 2):
            with_reference = reference in (a.plant, b.plant)
            if a.plant == b.plant or (a.controller == b.controller and with_reference):
                pairs.append(pair_of(a, b))
        return Analysis(
            results=results,
            values=values,
            groups=tuple(
                _analyse_group(results, group, summary, values)
                for group, summary in zip(groups, summarize(results), strict=True)
            ),
            controllers=tuple(pair for pair in pairs if pair.first.plant == pair.second.plant),
            plants=tuple(pair for pair in pairs if pair.first.plant != pair.second.plant),
            worst=examples(results, worst=LISTED_RUNS),
        )

    @staticmethod
    def json(analysis: "Analysis") -> dict[str, Any]:
        """Return all results but the summary as plain data, with arrays as lists."""
        return {
            "influence": [Tree(part.to_json()).mapped(_plain) for part in analysis.groups],
            "controllers": [Tree(pair.to_json()).mapped(_plain) for pair in analysis.controllers],
            "plants": [Tree(pair.to_json()).mapped(_plain) for pair in analysis.plants],
            "worst": [example._asdict() for example in analysis.worst],
        }


def _analyse_group(results: Results, group: Group, summary: GroupSummary, values: Array) -> GroupAnalysis:
    sampling = results.campaign.settings.sampling
    if sampling == ONE_AT_A_TIME:
        steps = OneAtATimeEffect.all(results, group, values)
        return GroupAnalysis(group, summary, None, {}, steps, ())
    indices = SobolIndices.of(results, group) if sampling == "saltelli" else {}
    strengths = Correlations.of(results, group, values)
    return GroupAnalysis(group, summary, strengths, indices, (), Separation.all(results, group, values))


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value

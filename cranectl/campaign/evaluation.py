"""Everything that is computed of a result, for its report and as plain data.

Groups compare sample by sample: one controller against another, one plant against the other.
"""

import itertools
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cranectl.campaign.manifest import has_lags
from cranectl.campaign.results import Results
from cranectl.campaign.sensitivity import (
    Correlations,
    OneAtATimeEffect,
    Separation,
    SobolIndices,
    correlations,
    one_at_a_time_effects,
    separations,
    sobol_of,
)
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
from cranectl.metrics import low_is_bad
from cranectl.plants.registry import reference_plant
from cranectl.support.arrays import Array
from cranectl.support.documents import mapped

LISTED_RUNS = 3  # runs listed for each plant and controller
BY_STEPS = "one-at-a-time"  # a sampling that is no spread: correlations mean nothing
LISTED_SAMPLES = 5  # samples that are farthest apart


@dataclass(frozen=True)
class Failures:
    """How many samples fail in which of two groups; both have been run."""

    neither: int
    both: int
    first_only: tuple[int, ...]  # samples
    second_only: tuple[int, ...]
    p: float  # of McNemar's exact test: whether one fails more often than the other


@dataclass(frozen=True)
class Difference:
    """Second minus first of one metric over the samples that both completed."""

    metric: str
    samples: int
    quantiles: tuple[float, ...]  # LEVELS; NaN without samples
    first_better: int
    second_better: int
    p: float  # of the sign test

    @property
    def better_share(self) -> float:
        """Share of samples in which the second is better; NaN without samples."""
        return self.second_better / self.samples if self.samples else float("nan")


@dataclass(frozen=True)
class GroupAgreement:
    """How alike two groups are in one metric over the samples that both completed."""

    metric: str
    samples: int
    rho: float  # Spearman's; NaN where one is constant
    quantiles: tuple[float, ...]  # of the absolute difference, LEVELS
    largest: tuple[tuple[int, float], ...]  # sample and difference, second minus first


@dataclass(frozen=True)
class Pair:
    """Two groups on the same samples."""

    first: Group
    second: Group
    failures: Failures
    differences: tuple[Difference, ...]  # one for each of MAIN_METRICS
    agreement: GroupAgreement  # in MEASURE

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "first": {"plant": self.first.plant, "controller": self.first.controller},
            "second": {"plant": self.second.plant, "controller": self.second.controller},
            "failures": asdict(self.failures),
            "differences": [asdict(difference) for difference in self.differences],
            "agreement": asdict(self.agreement),
        }


def pair_of(first: Group, second: Group) -> Pair:
    """Compare two groups sample by sample."""
    there = first.there & second.there
    a, b = first.failed & there, second.failed & there
    first_only, second_only = np.flatnonzero(a & ~b).tolist(), np.flatnonzero(b & ~a).tolist()
    failures = Failures(
        neither=int((there & ~a & ~b).sum()),
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
    up, down = int((difference > 0.0).sum()), int((difference < 0.0).sum())
    better, worse = (up, down) if low_is_bad(metric) else (down, up)
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
    """One controller on one plant."""

    group: Group
    summary: GroupSummary
    correlations: Correlations | None  # none of one-at-a-time
    sobol: dict[str, SobolIndices]  # by metric; of saltelli only
    one_at_a_time: tuple[OneAtATimeEffect, ...]  # of that sampling only
    separations: tuple[Separation, ...]

    def to_json(self) -> dict[str, Any]:
        """Return what the page shows besides the summary; arrays stay arrays."""
        data: dict[str, Any] = {"plant": self.group.plant, "controller": self.group.controller}
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
    """A whole result."""

    results: Results
    values: Array  # (samples, d) of the parameters
    groups: tuple[GroupAnalysis, ...]
    controllers: tuple[Pair, ...]  # on the same plant
    plants: tuple[Pair, ...]  # with the same controller, one of them the reference plant
    worst: tuple[Example, ...]

    @property
    def by_plant(self) -> list[list[GroupAnalysis]]:
        """The groups of each plant."""
        return [list(parts) for _, parts in itertools.groupby(self.groups, lambda part: part.group.plant)]


def analyse(results: Results) -> Analysis:
    """Compute everything; nothing is drawn, nothing is random."""
    values, groups = parameter_values(results), groups_of(results)
    reference = reference_plant(results.campaign.settings.plants)
    alone = {"analytic"} if has_lags(results.manifest) else set()  # plants that others are not compared with
    pairs = []
    for a, b in itertools.combinations(groups, 2):
        across = reference in (a.plant, b.plant) and alone.isdisjoint((a.plant, b.plant))
        if a.plant == b.plant or (a.controller == b.controller and across):
            pairs.append(pair_of(a, b))
    return Analysis(
        results=results,
        values=values,
        groups=tuple(
            _of_group(results, group, summary, values)
            for group, summary in zip(groups, summarize(results), strict=True)
        ),
        controllers=tuple(pair for pair in pairs if pair.first.plant == pair.second.plant),
        plants=tuple(pair for pair in pairs if pair.first.plant != pair.second.plant),
        worst=examples(results, worst=LISTED_RUNS),
    )


def analysis_json(analysis: Analysis) -> dict[str, Any]:
    """Return what the report shows besides the summary as plain data, arrays as lists."""
    return {
        "influence": [mapped(part.to_json(), _plain) for part in analysis.groups],
        "controllers": [mapped(pair.to_json(), _plain) for pair in analysis.controllers],
        "plants": [mapped(pair.to_json(), _plain) for pair in analysis.plants],
        "worst": [example._asdict() for example in analysis.worst],
    }


def _of_group(results: Results, group: Group, summary: GroupSummary, values: Array) -> GroupAnalysis:
    sampling = results.campaign.settings.sampling
    if sampling == BY_STEPS:
        steps = one_at_a_time_effects(results, group, values)
        return GroupAnalysis(group, summary, None, {}, steps, ())
    indices = sobol_of(results, group) if sampling == "saltelli" else {}
    strengths = correlations(results, group, values)
    return GroupAnalysis(group, summary, strengths, indices, (), separations(results, group, values))


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value

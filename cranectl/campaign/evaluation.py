"""Everything that is computed of a result, for its report and as plain data."""

import itertools
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.groups import (
    Agreement,
    Difference,
    Failures,
    Group,
    agreement,
    differences,
    failures,
    groups_of,
    parameter_values,
)
from cranectl.campaign.results import Results
from cranectl.campaign.sensitivity import (
    Correlations,
    Separation,
    SobolIndices,
    Swing,
    correlations,
    separations,
    sobol_of,
    swings,
)
from cranectl.campaign.summary import MEASURE, Example, GroupSummary, examples, summarize
from cranectl.plants.registry import reference_plant
from cranectl.support.trees import mapped

Array = NDArray[np.float64]

WORST = 3  # runs listed for each plant and controller
BY_STEPS = "one-at-a-time"  # a sampling that is no spread: correlations mean nothing


@dataclass(frozen=True)
class Pair:
    """Two groups on the same samples."""

    first: Group
    second: Group
    failures: Failures
    differences: tuple[Difference, ...]
    agreement: Agreement  # in MEASURE


@dataclass(frozen=True)
class GroupAnalysis:
    """One controller on one plant."""

    group: Group
    summary: GroupSummary
    correlations: Correlations | None  # none of one-at-a-time
    sobol: dict[str, SobolIndices]  # by metric; of saltelli only
    swings: tuple[Swing, ...]  # of one-at-a-time only
    separations: tuple[Separation, ...]


@dataclass(frozen=True)
class Analysis:
    """A whole result."""

    results: Results
    values: Array  # (samples, d) of the parameters
    groups: tuple[GroupAnalysis, ...]
    controllers: tuple[Pair, ...]  # on the same plant
    plants: tuple[Pair, ...]  # with the same controller, one of them the reference plant
    worst: tuple[Example, ...]


def analyse(results: Results) -> Analysis:
    """Compute everything; nothing is drawn, nothing is random."""
    values, groups = parameter_values(results), groups_of(results)
    reference = reference_plant(results.campaign.settings.plants)
    parts = tuple(
        _of_group(results, group, summary, values)
        for group, summary in zip(groups, summarize(results), strict=True)
    )
    return Analysis(
        results=results,
        values=values,
        groups=parts,
        controllers=tuple(_pair(a, b) for a, b in itertools.combinations(groups, 2) if a.plant == b.plant),
        plants=tuple(
            _pair(a, b)
            for a, b in itertools.combinations(groups, 2)
            if a.controller == b.controller and reference in (a.plant, b.plant)
        ),
        worst=examples(results, worst=WORST),
    )


def analysis_json(analysis: Analysis) -> dict[str, Any]:
    """What the report shows beside the summary, as plain data; arrays become lists."""
    return {
        "influence": [mapped(dict(_influence(part)), _plain) for part in analysis.groups],
        "controllers": [mapped(_pair_json(pair), _plain) for pair in analysis.controllers],
        "plants": [mapped(_pair_json(pair), _plain) for pair in analysis.plants],
        "worst": [example._asdict() for example in analysis.worst],
    }


def _of_group(results: Results, group: Group, summary: GroupSummary, values: Array) -> GroupAnalysis:
    sampling = results.campaign.settings.sampling
    steps = sampling == BY_STEPS
    return GroupAnalysis(
        group=group,
        summary=summary,
        correlations=None if steps else correlations(results, group, values),
        sobol=sobol_of(results, group) if sampling == "saltelli" else {},
        swings=swings(results, group, values) if steps else (),
        separations=() if steps else separations(results, group, values),
    )


def _pair(first: Group, second: Group) -> Pair:
    return Pair(
        first,
        second,
        failures(first, second),
        differences(first, second),
        agreement(first, second, MEASURE),
    )


def _influence(part: GroupAnalysis) -> Iterator[tuple[str, Any]]:
    yield "plant", part.group.plant
    yield "controller", part.group.controller
    if part.correlations is not None:
        found = part.correlations
        yield "correlations", {**asdict(found), "significant": found.significant, "bent": found.bent}
    if part.sobol:
        yield "sobol", {name: {**asdict(s), "important": s.important} for name, s in part.sobol.items()}
    if part.swings:
        yield "one_at_a_time", [asdict(swing) for swing in part.swings]
    yield "failures", [asdict(each) for each in part.separations]


def _pair_json(pair: Pair) -> dict[str, Any]:
    return {
        "first": {"plant": pair.first.plant, "controller": pair.first.controller},
        "second": {"plant": pair.second.plant, "controller": pair.second.controller},
        "failures": {**asdict(pair.failures), "p": pair.failures.p},
        "differences": [asdict(each) for each in pair.differences],
        "agreement": asdict(pair.agreement),
    }


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value

"""Everything that is computed of a result, for its report and as plain data."""

import itertools
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.groups import Group, Pair, groups_of, pair_of, parameter_values
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
from cranectl.campaign.summary import Example, GroupSummary, examples, summarize
from cranectl.plants.registry import reference_plant
from cranectl.support.documents import mapped

Array = NDArray[np.float64]

WORST = 3  # runs listed for each plant and controller
BY_STEPS = "one-at-a-time"  # a sampling that is no spread: correlations mean nothing


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
        """What the page shows beside the summary; arrays stay."""
        found: dict[str, Any] = {"plant": self.group.plant, "controller": self.group.controller}
        if self.correlations is not None:
            extra = {"significant": self.correlations.significant, "bent": self.correlations.bent}
            found["correlations"] = asdict(self.correlations) | extra
        if self.sobol:
            found["sobol"] = {name: {**asdict(s), "important": s.important} for name, s in self.sobol.items()}
        if self.one_at_a_time:
            found["one_at_a_time"] = [asdict(effect) for effect in self.one_at_a_time]
        return found | {"failures": [asdict(each) for each in self.separations]}


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
    pairs = [pair_of(a, b) for a, b in itertools.combinations(groups, 2) if _comparable(a, b, reference)]
    return Analysis(
        results=results,
        values=values,
        groups=tuple(
            _of_group(results, group, summary, values)
            for group, summary in zip(groups, summarize(results), strict=True)
        ),
        controllers=tuple(pair for pair in pairs if pair.first.plant == pair.second.plant),
        plants=tuple(pair for pair in pairs if pair.first.plant != pair.second.plant),
        worst=examples(results, worst=WORST),
    )


def _comparable(a: Group, b: Group, reference: str) -> bool:
    """Whether they differ in the controller only, or in the plant only, one of which is the reference."""
    return a.plant == b.plant or (a.controller == b.controller and reference in (a.plant, b.plant))


def analysis_json(analysis: Analysis) -> dict[str, Any]:
    """What the report shows beside the summary, as plain data; arrays become lists."""
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
    found = correlations(results, group, values)
    return GroupAnalysis(group, summary, found, indices, (), separations(results, group, values))


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value

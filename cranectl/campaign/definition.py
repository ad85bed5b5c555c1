"""A campaign as it is run: settings, nominal scenario, uncertain parameters, and the batches it is cut into.

The batches are decided by the campaign alone, not by who runs it.
"""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from cranectl.campaign.correlation import Copula
from cranectl.campaign.parameters import Parameter
from cranectl.campaign.settings import CampaignSettings
from cranectl.plants.registry import plant_entry
from cranectl.scenario import Scenario
from cranectl.scenario.settings import parse_settings
from cranectl.support.documents import assign, mapped


@dataclass(frozen=True)
class Campaign:
    """Everything that decides the samples; the same in every process that has loaded it."""

    settings: CampaignSettings
    nominal: Scenario  # what the controller assumes
    parameters: tuple[Parameter, ...]  # columns of all samples
    copula: Copula | None
    runs: int  # number of samples

    @property
    def names(self) -> tuple[str, ...]:
        """Dotted names of the parameters, the columns of all samples."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def groups(self) -> list[tuple[str, str]]:
        """Plant and controller of each group of runs, in the order of the result."""
        return list(itertools.product(self.settings.plants, self.settings.controllers))

    @property
    def all_runs(self) -> int:
        """Number of runs: of each sample with each controller on each plant."""
        return self.runs * len(self.groups)

    @property
    def varied(self) -> tuple[int, ...]:
        """Columns of the parameters that have more than one value."""
        return tuple(k for k, p in enumerate(self.parameters) if p.distribution.varies)


MOST_BATCHES = 1024  # of one plant and controller; more would be many small files


class Batch(NamedTuple):
    """Samples [first, last) with one controller on one plant."""

    plant: str
    controller: str
    first: int
    last: int

    @property
    def runs(self) -> int:
        """How many."""
        return self.last - self.first


def batches_of(campaign: Campaign) -> list[Batch]:
    """All batches of `campaign`, by plant, controller and sample.

    A batch is what a kill can cost each worker: some seconds, so that handing it to a cluster costs less
    than 2 % of it.
    """
    runs = campaign.runs
    return [
        Batch(plant, controller, first, min(first + size, runs))
        for plant, controller in campaign.groups
        for size in [max(plant_entry(plant).batch, -(-runs // MOST_BATCHES))]
        for first in range(0, runs, size)
    ]


def sampled_scenario(campaign: Campaign, values: Iterable[float], source: str = "sample") -> Scenario:
    """The nominal scenario with `values` (d,) of `campaign.parameters`: what the plant is.

    Raises InputError, beginning with `source`, where the scenario does not allow them. About 0.1 ms.
    """
    table = mapped(campaign.nominal.model_dump())
    for parameter, value in zip(campaign.parameters, values, strict=True):
        assign(table, parameter.name, int(value) if parameter.whole else float(value), source)
    return parse_settings(Scenario, table, source)


def nominal_scenario(campaign: Campaign, sampled: Scenario) -> Scenario:
    """What the controller takes a sample for: the nominal crane, with the control period that it runs at."""
    return campaign.nominal.model_copy(update={"control": sampled.control})

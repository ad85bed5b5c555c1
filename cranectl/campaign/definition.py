"""Define a campaign: its settings, nominal scenario and uncertain parameters, and its batches.

A parameter is a number of the scenario with a dotted name such as "rig.load_mass". The batches depend on
the campaign only, not on the machine or the number of workers.
"""

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cranectl.campaign.distributions import MIN_PROBABILITY, Distribution, FewValues, Normal
from cranectl.campaign.settings import CampaignSettings
from cranectl.plants import PLANTS
from cranectl.scenario import NANOSECONDS, EffectNumbers, Scenario, nanoseconds
from cranectl.support import Array, InputError, Quantity, Tree

PHYSICAL = ("rig", "effects", "initial", "disturbances")  # tables that the plant gets
PERIOD = "control.period"  # the controller knows it: each run has a controller made for its period
TIMES = ("start", "end", "seconds")  # keys of disturbances and the delay: multiples of the control period


@dataclass(frozen=True)
class UncertainParameter:
    """One uncertain number of a scenario."""

    name: str  # dotted, such as "rig.load_mass"
    distribution: Distribution
    nominal: float  # what the controller assumes
    is_whole: bool  # whether the scenario takes whole numbers only
    multiple: float  # values are rounded to multiples of this; 0 means no rounding

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value before rounding, infinite where there is none."""
        return self.distribution.ends(self.nominal)

    def values(self, u: Array) -> Array:
        """Values at the points `u` (k,) of the unit interval, shape (k,); the nominal value where NaN."""
        values = self.distribution.quantile(u, self.nominal)
        if self.multiple:
            low, high = (end / self.multiple for end in self.ends)
            # An end that is a multiple but for rounding counts as one.
            counts = np.clip(np.round(values / self.multiple), np.ceil(low - 1e-6), np.floor(high + 1e-6))
            values = counts * self.multiple
        return np.where(np.isnan(u), self.nominal, values)


@dataclass(frozen=True)
class Campaign:
    """Everything that decides the samples of a campaign, equal in every process that loads it."""

    settings: CampaignSettings  # of its file
    nominal: Scenario  # what the controller assumes
    parameters: tuple[UncertainParameter, ...]  # columns of all samples
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


MAX_BATCHES = 1024  # batches of one plant and controller, and so files of a result


class Batch(NamedTuple):
    """Samples [first, last) with one controller on one plant."""

    plant: str  # by name
    controller: str  # by name
    first: int  # number of its first sample
    last: int  # number after that of its last sample

    @property
    def runs(self) -> int:
        """Number of samples."""
        return self.last - self.first


def batches_of(campaign: Campaign) -> list[Batch]:
    """Return all batches of `campaign`, in the order of plant, controller and sample.

    A batch takes some seconds. Less would make the transfer to a cluster cost more than 2 % of it, and more
    would be lost with each worker that is killed.
    """
    runs = campaign.runs
    return [
        Batch(plant, controller, first, min(first + size, runs))
        for plant, controller in campaign.groups
        for size in [max(PLANTS.entry(plant).batch, -(-runs // MAX_BATCHES))]
        for first in range(0, runs, size)
    ]


def sampled_scenario(campaign: Campaign, values: Iterable[float], source: str = "sample") -> Scenario:
    """Return the scenario of the plant: the nominal one with `values` (d,) of `campaign.parameters`.

    It takes about 0.1 ms. Raises InputError, whose text begins with `source`, if the scenario does not allow
    the values.
    """
    table = Tree(campaign.nominal.model_dump()).mapped()
    for parameter, value in zip(campaign.parameters, values, strict=True):
        Tree(table).assign(parameter.name, int(value) if parameter.is_whole else float(value), source)
    return Scenario.from_table(table, source).with_files(campaign.nominal.held_files)


def nominal_scenario(campaign: Campaign, sampled: Scenario) -> Scenario:
    """Return the scenario that the controller assumes: the nominal one with the sample's control period."""
    return campaign.nominal.model_copy(update={"control": sampled.control})


def parameters_of(settings: CampaignSettings, nominal: Scenario) -> tuple[UncertainParameter, ...]:
    """Return the uncertain parameters in order; raise InputError for those that `nominal` lacks."""
    values = _leaves_of(nominal)
    step = _common_period(settings.uncertain.get(PERIOD), nominal)
    return tuple(
        _parameter(name, distribution, settings.spread, values, step)
        for name, distribution in settings.uncertain.items()
    )


def numbers_of(scenario: Scenario) -> dict[str, float]:
    """Return every number of a scenario by its dotted name."""
    return {name: value for name, value in _leaves_of(scenario).items() if _is_number(value)}


def _leaves_of(scenario: Scenario) -> dict[str, Any]:
    """Return all values by dotted names, without effects, rated load and look that a rig's file states."""
    return dict(Tree(scenario.model_dump(exclude={"rig": {"effects", "rated_load", "look"}})).leaves())


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _common_period(distribution: Distribution | None, nominal: Scenario) -> float:
    """Return the shortest time [s] that is a multiple of every control period of the campaign."""
    if distribution is None:
        return nominal.control.period
    period = nominal.control.period
    if not isinstance(distribution, FewValues):
        raise InputError(
            f"uncertain.{PERIOD}: its distribution is a range, not single periods",
            allowed="distribution choice or fixed, with periods that divide all times of the scenario",
            remedy='take \'distribution = "choice"\' with "values", such as '
            f"[{', '.join(Quantity(times * period).setting() for times in (1, 2, 5))}]",
        )
    periods = distribution.quantile(distribution.grid(), period)
    return math.lcm(*(max(1, nanoseconds(seconds)) for seconds in periods)) / NANOSECONDS


def _parameter(
    name: str, distribution: Distribution, spread: float, values: dict[str, Any], time_step: float
) -> UncertainParameter:
    section, _, rest = name.partition(".")
    if name not in values:
        raise _unknown(name, values)
    nominal = values[name]
    if section not in PHYSICAL and name != PERIOD:
        raise InputError(
            f"uncertain.{name}: '{section}' belongs to the controller and the run, not to the crane",
            allowed=f"{PERIOD}, and parameters of the crane and what acts on it: {', '.join(PHYSICAL)}",
            remedy="run one campaign for each value",
        )
    if nominal is None:
        raise InputError(
            f"uncertain.{name}: it has no value in the scenario",
            allowed="parameters that have a number as nominal value",
            remedy=f"give it one in the scenario or by 'set = [\"{name}=...\"]'",
        )
    if not _is_number(nominal):
        raise InputError(
            f"uncertain.{name}: its value in the scenario is {nominal!r}, not a number",
            allowed="parameters that have a number as nominal value",
            remedy="choose a number of the scenario",
        )
    is_whole = isinstance(nominal, int)
    if is_whole and not distribution.is_whole:
        raise InputError(
            f"uncertain.{name}: its distribution may give fractions, but the scenario takes whole numbers",
            allowed="distribution choice, fixed or integers, with whole numbers",
            remedy="take 'distribution = \"integers\"', which draws a whole number for every run",
        )
    if distribution.relative and nominal == 0:
        raise InputError(
            f"uncertain.{name}: its numbers are relative, but its nominal value is 0",
            allowed="relative numbers where the nominal value is not 0",
            remedy="give absolute numbers and leave 'relative' out",
        )
    distribution = distribution.spread_out(spread, float(nominal))
    if isinstance(distribution, Normal) and distribution.mass(nominal) < MIN_PROBABILITY:
        raise InputError(
            f"uncertain.{name}: low and high exclude the whole normal distribution",
            allowed="low and high within a few deviations of the mean",
            remedy="correct mean, low or high",
        )
    timed = not distribution.discrete and (section == "disturbances" or rest.startswith("delay."))
    multiple = time_step if timed and name.rpartition(".")[2] in TIMES else 0.0
    low, high = distribution.ends(nominal)
    if multiple and np.floor(high / multiple + 1e-6) < np.ceil(low / multiple - 1e-6):
        raise InputError(
            f"uncertain.{name}: no whole control period lies between {low:g} s and {high:g} s",
            allowed=f"multiples of control.period = {Quantity(multiple).setting()} s",
            remedy="widen the range or take 'distribution = \"choice\"'",
        )
    return UncertainParameter(name, distribution, float(nominal), is_whole, multiple)


def _unknown(name: str, values: dict[str, Any]) -> InputError:
    """Return the error for a name that is no number; it lists the numbers below it, or similar names."""
    everything = {**values, **dict(Tree(EffectNumbers().model_dump()).leaves("effects"))}
    known = [
        leaf
        for leaf, value in everything.items()
        if (leaf.split(".")[0] in PHYSICAL or leaf == PERIOD) and _is_number(value)
    ]
    below = [leaf for leaf in known if leaf.startswith(f"{name}.")]
    if below:
        return InputError(
            f"uncertain.{name} is a table or a list, not a number",
            allowed=", ".join(below),
            remedy="give each of them a distribution",
        )
    near = InputError.nearest(name, known)
    return InputError(
        f"unknown parameter '{name}' under [uncertain]",
        allowed=f"numbers of the scenario, the nearest being {', '.join(near)}",
        remedy=InputError.did_you_mean(name, near) or "choose a number of the scenario",
    )

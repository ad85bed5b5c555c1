"""A campaign as it is run: settings, nominal scenario, uncertain parameters, and the batches it is cut into.

A parameter is a number of the scenario, found by its dotted name, with its nominal value. The batches are
decided by the campaign alone, not by who runs it.
"""

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cranectl.campaign.distributions import LEAST_MASS, Distribution, FewValues, Normal
from cranectl.campaign.settings import CampaignSettings
from cranectl.plants.registry import plant_entry
from cranectl.scenario import NANOSECONDS, Scenario, nanoseconds
from cranectl.scenario.effects import ALL_EFFECTS
from cranectl.scenario.load import held_files, with_files
from cranectl.scenario.settings import parse_settings
from cranectl.support.arrays import Array
from cranectl.support.documents import assign, leaves, mapped
from cranectl.support.errors import SHOWN_NEAR_NAMES, InputError, did_you_mean, nearest_first

PHYSICAL = ("rig", "effects", "initial", "disturbances")  # of a scenario; the rest is the controller's
PERIOD = "control.period"  # which the controller knows: it is made for that of each run
TIMES = ("start", "end", "seconds")  # of disturbances and of the delay: whole control periods


@dataclass(frozen=True)
class UncertainParameter:
    """One uncertain number of a scenario."""

    name: str  # dotted, "rig.load_mass"
    distribution: Distribution
    nominal: float  # what the controller assumes
    whole: bool  # whether the scenario takes whole numbers only
    multiple: float  # values are rounded to multiples of this; 0 for any value

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value before rounding, infinite where there is none."""
        return self.distribution.ends(self.nominal)

    def values(self, u: Array) -> Array:
        """Values at the points `u` (k,) of the unit interval, shape (k,); the nominal value where NaN."""
        values = self.distribution.quantile(u, self.nominal)
        if self.multiple:
            low, high = (end / self.multiple for end in self.ends)
            counts = np.clip(np.round(values / self.multiple), np.ceil(low - 1e-6), np.floor(high + 1e-6))
            values = counts * self.multiple
        return np.where(np.isnan(u), self.nominal, values)


@dataclass(frozen=True)
class Campaign:
    """Everything that decides the samples; the same in every process that has loaded it."""

    settings: CampaignSettings
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
    """Return all batches of `campaign`, by plant, controller and sample.

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
    """Return the nominal scenario with `values` (d,) of `campaign.parameters`, which the plant gets.

    Raises InputError, beginning with `source`, where the scenario does not allow them. About 0.1 ms.
    """
    table = mapped(campaign.nominal.model_dump())
    for parameter, value in zip(campaign.parameters, values, strict=True):
        assign(table, parameter.name, int(value) if parameter.whole else float(value), source)
    return with_files(parse_settings(Scenario, table, source), held_files(campaign.nominal))


def nominal_scenario(campaign: Campaign, sampled: Scenario) -> Scenario:
    """Return what the controller assumes: the nominal crane, with the control period of the sample."""
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
    """Return values by dotted names, without those of a rig under effects, which the effects state."""
    return dict(leaves(scenario.model_dump(exclude={"rig": {"effects", "rated_load", "look"}})))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _common_period(distribution: Distribution | None, nominal: Scenario) -> float:
    """Return the time of which all times must be multiples [s], with any control period of a run."""
    if distribution is None:
        return nominal.control.period
    period = nominal.control.period
    if not isinstance(distribution, FewValues):
        raise InputError(
            f"uncertain.{PERIOD}: it takes single periods",
            allowed="distribution choice or fixed: periods that divide all times of the scenario",
            remedy='take \'distribution = "choice"\' with "values", such as '
            f"[{period:g}, {2.0 * period:g}, {5.0 * period:g}]",
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
            remedy="compare other values with a campaign each",
        )
    if nominal is None:
        raise InputError(
            f"uncertain.{name}: the scenario gives it no value",
            allowed="parameters that have a number as nominal value",
            remedy=f"give it one in the scenario or by 'set = [\"{name}=...\"]'",
        )
    if not _is_number(nominal):
        raise InputError(
            f"uncertain.{name}: its value in the scenario is {nominal!r}, no number",
            allowed="parameters that have a number as nominal value",
            remedy="choose a number of the scenario",
        )
    whole = isinstance(nominal, int)
    if whole and not distribution.whole:
        raise InputError(
            f"uncertain.{name}: it takes whole numbers",
            allowed="distribution choice, fixed or integers, with whole numbers",
            remedy="take 'distribution = \"integers\"', which gives every run a number of its own",
        )
    if distribution.relative and nominal == 0:
        raise InputError(
            f"uncertain.{name}: relative, but its nominal value is 0",
            allowed="relative for nominal values other than 0",
            remedy="give the numbers themselves and leave 'relative' out",
        )
    distribution = distribution.spread_out(spread, float(nominal))
    if isinstance(distribution, Normal) and distribution.mass(nominal) < LEAST_MASS:
        raise InputError(
            f"uncertain.{name}: low and high cut off all of the normal distribution",
            allowed="low and high within a few deviations of the mean",
            remedy="correct mean, low or high",
        )
    timed = not distribution.discrete and (section == "disturbances" or rest.startswith("delay."))
    multiple = time_step if timed and name.rpartition(".")[2] in TIMES else 0.0
    low, high = distribution.ends(nominal)
    if multiple and np.floor(high / multiple + 1e-6) < np.ceil(low / multiple - 1e-6):
        raise InputError(
            f"uncertain.{name}: no whole control period lies between {low:g} s and {high:g} s",
            allowed=f"multiples of control.period = {multiple:g} s",
            remedy="widen the range or take 'distribution = \"choice\"'",
        )
    return UncertainParameter(name, distribution, float(nominal), whole, multiple)


def _unknown(name: str, values: dict[str, Any]) -> InputError:
    """Return the error for a name without a value; it lists the names below it, else the nearest."""
    everything = {**values, **dict(leaves(ALL_EFFECTS.model_dump(), "effects"))}
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
    near = nearest_first(name, known)[:SHOWN_NEAR_NAMES]
    return InputError(
        f"unknown parameter '{name}' under [uncertain]",
        allowed=f"numbers of the scenario, the nearest being {', '.join(near)}",
        remedy=did_you_mean(name, near) or "choose a number of the scenario",
    )

"""Load a campaign: everything that can be known to be wrong before the first run is found here.

So are parameters that change nothing: on the chosen plant and drives, or beside another number that is zero.
Effects that a plant cannot show at all are refused by `plants.applicable`. What only happens not to matter in
some runs, such as a limit that is not reached, is no mistake.
"""

import math
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cranectl.campaign.definition import Campaign, Parameter, numbers_of, parameters_of, sampled_scenario
from cranectl.campaign.distributions import FewValues
from cranectl.campaign.sampling import gaussian_copula, sample_values
from cranectl.campaign.settings import COUNTED, INDEPENDENT, MAX_RUNS, CampaignSettings, read_campaign
from cranectl.controllers.registry import checked_controller
from cranectl.plants.registry import check_effects, plant_entry
from cranectl.reference import load_scenario
from cranectl.scenario import Scenario
from cranectl.support.errors import InputError
from cranectl.support.patterns import matching


class Rule(NamedTuple):
    """Where parameters change nothing; None: everywhere."""

    names: str  # shell pattern
    lack: str | None  # of a plant, as in its registry entry
    drive: str | None
    why: str


RULES = (
    Rule("rig.*_time_constant", None, "ideal", "ideal drives have no lag"),
    Rule("rig.*_time_constant", None, "force", "force drives have no lag"),
    *(
        Rule(f"rig.{body}_mass", lack, drive, why)
        for body in ("bridge", "trolley", "winch")
        for lack, drive, why in (
            (None, "ideal", "ideal drives move as commanded whatever they carry"),
            ("force", "velocity", "the velocity drives of the {plant} plant know no forces"),
        )
    ),
    Rule("effects.sensing.observer_bandwidth", None, None, "the controller has the observer it was given"),
)

# Parameters that act only where none of these groups is zero in all its numbers.
FACTORS = {
    "effects.wind.mean.*": ("effects.wind.drag_area", "effects.wind.density"),
    "effects.wind.gust": ("effects.wind.drag_area", "effects.wind.density"),
    "effects.wind.gust_time": ("effects.wind.gust", "effects.wind.drag_area", "effects.wind.density"),
    "effects.wind.seed": ("effects.wind.gust", "effects.wind.drag_area", "effects.wind.density"),
    "effects.wind.drag_area": ("effects.wind.density",),
    "effects.wind.density": ("effects.wind.drag_area",),
    "effects.sensing.seed": ("effects.sensing.*_noise*",),
    "disturbances.*.start": ("disturbances.*.magnitude",),
    "disturbances.*.end": ("disturbances.*.magnitude",),
}


def _check_effect(settings: CampaignSettings, parameters: Sequence[Parameter], nominal: Scenario) -> None:
    """Raise InputError for a parameter that cannot change the outcome of any run."""
    zero = {name: value == 0 for name, value in numbers_of(nominal).items()}
    zero |= {parameter.name: parameter.ends == (0.0, 0.0) for parameter in parameters}
    for parameter in parameters:
        for plant in settings.plants:
            why = _why_without_effect(parameter.name, plant, settings.drive, zero)
            if why:
                raise InputError(
                    f"uncertain.{parameter.name} changes nothing on the {plant} plant with "
                    f"{settings.drive} drives: {why}",
                    allowed="parameters that act on every plant of the campaign",
                    remedy="leave it out, or choose other plants or drives",
                )


def _why_without_effect(name: str, plant: str, drive: str, zero: Mapping[str, bool]) -> str | None:
    """Why `name` changes nothing, None if it does; `zero` tells which numbers are 0 in all runs."""
    entry = plant_entry(plant)
    for rule in RULES:
        holds = rule.lack is None or rule.lack in entry.lacks
        if holds and fnmatchcase(name, rule.names) and rule.drive in (None, drive):
            return rule.why.format(plant=entry.label)
    for factor in (each for pattern in FACTORS if fnmatchcase(name, pattern) for each in FACTORS[pattern]):
        if name.startswith("disturbances."):  # of this one
            factor = factor.replace("*", name.split(".")[1])
        names = matching(factor, zero)
        if names and all(zero[each] for each in names):
            return f"{', '.join(names)} is 0 in all runs"
    return None


BLOCK = 2**17  # samples looked at together


def load_campaign(name_or_path: str | Path, *, overrides: Sequence[str] = ()) -> Campaign:
    """Load a campaign by name or from a TOML file; `overrides` are `"runs=100"` and the like.

    Raises InputError for whatever is wrong in the file, against the scenario, or in the values of any one
    parameter. Values that are wrong only together are found by `sampled_scenario`.
    """
    return make_campaign(read_campaign(name_or_path, overrides=overrides))


def make_campaign(settings: CampaignSettings) -> Campaign:
    """The campaign of `settings`, checked."""
    campaign = stated_campaign(settings)
    check_values(campaign)
    return campaign


def stated_campaign(settings: CampaignSettings) -> Campaign:
    """The campaign of `settings`, before `check_values`."""
    for name in settings.controllers:
        checked_controller(name)
    nominal = _nominal_scenario(settings)
    parameters = parameters_of(settings, nominal)
    if settings.correlation and settings.sampling not in INDEPENDENT:
        raise InputError(
            f"correlations with {settings.sampling} sampling, which changes parameters independently",
            allowed=f"correlations with {', '.join(INDEPENDENT)}",
            remedy="leave the correlations out or take another sampling",
        )
    _check_effect(settings, parameters, nominal)
    campaign = Campaign(settings, nominal, parameters, _runs(settings, parameters))
    if settings.correlation:
        gaussian_copula(campaign)
    return campaign


def _nominal_scenario(settings: CampaignSettings) -> Scenario:
    """What the controller assumes: the campaign's scenario, with every uncertain effect switched on."""
    scenario = load_scenario(settings.scenario, rig=settings.rig, overrides=settings.set)
    named = {name.split(".")[1] for name in settings.uncertain if name.startswith("effects.")}
    off = [effect for effect, given in scenario.effects if given is None and effect in named]
    if not off:
        return scenario
    added = [f"effects.{effect}={{}}" for effect in off]
    return load_scenario(settings.scenario, rig=settings.rig, overrides=[*settings.set, *added])


def _runs(settings: CampaignSettings, parameters: Sequence[Parameter]) -> int:
    """Number of samples; raises InputError where it contradicts the sampling."""
    if settings.sampling == "saltelli":
        return _saltelli_runs(settings.runs or 0, sum(p.distribution.varies for p in parameters))
    if settings.sampling not in COUNTED:
        return settings.runs or 0
    if settings.sampling == "grid":
        for parameter in parameters:
            if not parameter.distribution.grid_levels:
                raise InputError(
                    f"uncertain.{parameter.name} has no levels, which grid sampling needs",
                    allowed="a number of values for every parameter",
                    remedy="add 'levels = 5'",
                )
        runs = math.prod(parameter.distribution.grid_levels for parameter in parameters)
    else:
        runs = 1 + sum(len(parameter.distribution.end_points()) for parameter in parameters)
    if runs > MAX_RUNS:
        raise InputError(
            f"{settings.sampling} sampling of these parameters takes {runs} runs",
            allowed=f"up to {MAX_RUNS} runs",
            remedy="take fewer levels or another sampling",
        )
    if settings.runs not in (None, runs):
        raise InputError(
            f"runs = {settings.runs}, but {settings.sampling} sampling of these parameters takes {runs}",
            allowed=f"runs = {runs}, or none",
            remedy="remove 'runs' or correct it",
        )
    return runs


def _saltelli_runs(runs: int, varied: int) -> int:
    if not varied:
        raise InputError("saltelli sampling with nothing that varies", allowed="one parameter at least")
    block = varied + 2
    n = runs // block
    if n < 1 or runs % block or n & (n - 1):
        below = block * 2 ** max(0, n.bit_length() - 1)
        raise InputError(
            f"runs = {runs} with saltelli sampling of {varied} parameters",
            allowed=f"{block} times a power of two, near it {below} and {2 * below}",
            remedy=f"take 'runs = {2 * below}'",
        )
    return runs


def check_values(campaign: Campaign) -> None:
    """Raise InputError where a parameter by itself takes a value that the scenario or a plant refuses.

    It takes longer than all other checks.
    """
    middle = np.array([0.5])
    usual = [p.nominal if p.distribution.varies else float(p.values(middle)[0]) for p in campaign.parameters]
    sampled = _sampled_ends(campaign)
    for column, parameter in enumerate(campaign.parameters):
        for value in (*_outermost(parameter), *sampled.get(column, ())):
            values = [*usual[:column], value, *usual[column + 1 :]]
            source = f"uncertain.{parameter.name} reaches {value:g}"
            scenario = sampled_scenario(campaign, values, source)
            for plant in campaign.settings.plants:
                check_effects(scenario.effects, plant=plant, drive=campaign.settings.drive)


def _outermost(parameter: Parameter) -> list[float]:
    """Each of a few values, the ends of anything else, as far as they are finite."""
    distribution = parameter.distribution
    points = [u for u, end in zip((0.0, 1.0), distribution.ends(1.0), strict=True) if math.isfinite(end)]
    at = distribution.grid() if isinstance(distribution, FewValues) else np.array(points)
    values: list[float] = parameter.values(at).tolist()
    return values


def _sampled_ends(campaign: Campaign) -> dict[int, tuple[float, float]]:
    """Smallest and largest sample of the parameters that have an infinite end, by column."""
    columns = [k for k, p in enumerate(campaign.parameters) if not all(map(math.isfinite, p.ends))]
    if not columns:
        return {}
    low, high = np.full(len(columns), math.inf), np.full(len(columns), -math.inf)
    for first in range(0, campaign.runs, BLOCK):
        values = sample_values(campaign, first, min(first + BLOCK, campaign.runs))[:, columns]
        low, high = np.minimum(low, values.min(axis=0)), np.maximum(high, values.max(axis=0))
    return {k: (float(low[j]), float(high[j])) for j, k in enumerate(columns)}

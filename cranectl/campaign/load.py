"""Load a campaign and find its mistakes before the first run, except values that are wrong only together.

A parameter that has no effect on a plant of the campaign is refused too: the plant or its drives may ignore
it, or another number that is zero may switch it off. A parameter that matters only in some runs is allowed,
such as a limit that is not always reached. `plants.capabilities` refuses effects that a plant lacks.
"""

import itertools
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cranectl.campaign.definition import (
    Campaign,
    UncertainParameter,
    numbers_of,
    parameters_of,
    sampled_scenario,
)
from cranectl.campaign.distributions import FewValues
from cranectl.campaign.sampling import gaussian_copula, sample_values
from cranectl.campaign.settings import COUNTED, INDEPENDENT, CampaignSettings
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.plants import PLANTS
from cranectl.scenario import Scenario
from cranectl.simulate import RunKind
from cranectl.support import MAX_RUNS, InputError

SAMPLES_PER_CHECK = 2**17  # samples checked at a time, which limits memory
BANDWIDTH = "effects.sensing.observer_bandwidth"


def _check_not_idle(
    settings: CampaignSettings, parameters: Sequence[UncertainParameter], nominal: Scenario
) -> None:
    """Raise InputError for a parameter that changes nothing on one of the campaign's plants."""
    zero = {name: value == 0 for name, value in numbers_of(nominal).items()}
    zero |= {parameter.name: parameter.ends == (0.0, 0.0) for parameter in parameters}
    for parameter, plant in itertools.product(parameters, settings.plants):
        why = RunKind(plant, settings.drive).why_idle_on_plant(parameter.name, nominal.rig, zero)
        if parameter.name == BANDWIDTH:
            why = "the controller keeps the observer of the nominal scenario"
        if why:
            raise InputError(
                f"uncertain.{parameter.name} changes nothing on the {plant} plant with "
                f"{settings.drive} drives: {why}",
                allowed="parameters that act on every plant of the campaign",
                remedy="leave it out, or choose other plants or drives",
            )


def load_campaign(name_or_path: str | Path, *, overrides: Sequence[str] = ()) -> Campaign:
    """Load a campaign by name or from a TOML file; `overrides` are settings such as `"runs=100"`.

    Raises InputError for mistakes in the file, contradictions to the scenario, and single parameters with
    values that are not allowed. Values that are wrong only in combination are found by `sampled_scenario`.
    """
    return make_campaign(CampaignSettings.read(name_or_path, overrides=overrides))


def make_campaign(settings: CampaignSettings) -> Campaign:
    """Make and check the campaign of `settings`."""
    campaign = unchecked_campaign(settings)
    check_values(campaign)
    return campaign


def unchecked_campaign(settings: CampaignSettings) -> Campaign:
    """Make the campaign of `settings` with all checks but those of `check_values`, which take longest."""
    for name in settings.controllers:
        ALL_CONTROLLERS.checked(name)
    nominal = _nominal_scenario(settings)
    if nominal.rig.model is not None and "plants" not in settings.model_fields_set:
        own = PLANTS.find(nominal.rig.model).name
        settings = settings.model_copy(update={"plants": (*settings.plants, own)})
    for plant in settings.plants:
        PLANTS.find(plant, nominal.rig)
    parameters = parameters_of(settings, nominal)
    if settings.correlation and settings.sampling not in INDEPENDENT:
        raise InputError(
            f"the campaign has correlations, which {settings.sampling} sampling does not allow",
            allowed=f"correlations with {', '.join(INDEPENDENT)}",
            remedy="leave the correlations out or take another sampling",
        )
    _check_not_idle(settings, parameters, nominal)
    campaign = Campaign(settings, nominal, parameters, _number_of_samples(settings, parameters))
    if settings.correlation:
        gaussian_copula(campaign)
    return campaign


def _nominal_scenario(settings: CampaignSettings) -> Scenario:
    """Return the scenario that the controller assumes, with every uncertain effect switched on."""
    scenario = load_scenario(settings.scenario, rig=settings.rig, overrides=settings.set)
    named = {name.split(".")[1] for name in settings.uncertain if name.startswith("effects.")}
    off = [effect for effect, stated in scenario.effects if stated is None and effect in named]
    if not off:
        return scenario
    added = [f"effects.{effect}={{}}" for effect in off]
    return load_scenario(settings.scenario, rig=settings.rig, overrides=[*settings.set, *added])


def _number_of_samples(settings: CampaignSettings, parameters: Sequence[UncertainParameter]) -> int:
    """Return the number of samples; raise InputError if it does not suit the sampling or is too large."""
    if settings.sampling == "saltelli":
        return _checked_saltelli_runs(settings.runs or 0, sum(p.distribution.varies for p in parameters))
    if settings.sampling not in COUNTED:
        return settings.runs or 0
    if settings.sampling == "grid":
        for parameter in parameters:
            if not parameter.distribution.grid_levels:
                raise InputError(
                    f"uncertain.{parameter.name} has no levels, which grid sampling needs",
                    allowed="a number of levels for every parameter",
                    remedy=f"add 'levels = 5' to [uncertain.{parameter.name}]",
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
            allowed=f"runs = {runs}, or no 'runs'",
            remedy="remove 'runs' or correct it",
        )
    return runs


def _checked_saltelli_runs(runs: int, varied: int) -> int:
    if not varied:
        raise InputError(
            "saltelli sampling needs parameters that vary, but all are fixed",
            allowed="at least one parameter that is not fixed",
            remedy="take another sampling, or give a parameter another distribution than fixed",
        )
    block = varied + 2
    n = runs // block
    if n < 1 or runs % block or n & (n - 1):
        below = block * 2 ** max(0, n.bit_length() - 1)
        raise InputError(
            f"runs = {runs} does not suit saltelli sampling of {varied} parameters",
            allowed=f"{block} times a power of two, such as {below} and {2 * below}",
            remedy=f"take 'runs = {2 * below}'",
        )
    return runs


def check_values(campaign: Campaign) -> None:
    """Raise InputError if the scenario or a plant refuses an extreme value of one parameter.

    All other parameters have their nominal values. This check takes longer than all others.
    """
    middle = np.array([0.5])
    nominal = [
        p.nominal if p.distribution.varies else float(p.values(middle)[0]) for p in campaign.parameters
    ]
    sampled = _sampled_ends(campaign)
    for column, parameter in enumerate(campaign.parameters):
        for value in (*_values_to_test(parameter), *sampled.get(column, ())):
            values = [*nominal[:column], value, *nominal[column + 1 :]]
            source = f"uncertain.{parameter.name} reaches {value:g}"
            scenario = sampled_scenario(campaign, values, source)
            for plant in campaign.settings.plants:
                PLANTS.entry(plant).check_scenario(scenario, campaign.settings.drive)


def _values_to_test(parameter: UncertainParameter) -> list[float]:
    """Return the values to test: all of a distribution with few values, else the ends that are finite."""
    distribution = parameter.distribution
    points = [u for u, end in zip((0.0, 1.0), distribution.ends(1.0), strict=True) if math.isfinite(end)]
    at = distribution.grid() if isinstance(distribution, FewValues) else np.array(points)
    values: list[float] = parameter.values(at).tolist()
    return values


def _sampled_ends(campaign: Campaign) -> dict[int, tuple[float, float]]:
    """Return the smallest and largest sample of each parameter that has an infinite end, by column."""
    columns = [k for k, p in enumerate(campaign.parameters) if not all(map(math.isfinite, p.ends))]
    if not columns:
        return {}
    low, high = np.full(len(columns), math.inf), np.full(len(columns), -math.inf)
    for first in range(0, campaign.runs, SAMPLES_PER_CHECK):
        values = sample_values(campaign, first, min(first + SAMPLES_PER_CHECK, campaign.runs))[:, columns]
        low, high = np.minimum(low, values.min(axis=0)), np.maximum(high, values.max(axis=0))
    return {k: (float(low[j]), float(high[j])) for j, k in enumerate(columns)}

"""`cranectl campaign list` and `cranectl campaign show`."""

import math
from typing import TYPE_CHECKING, Any

import click

from cranectl import campaign as campaigns
from cranectl.campaign.commands.options import campaign_argument, idle_in_campaign
from cranectl.cli.command import Command
from cranectl.cli.counts import Count
from cranectl.cli.idle import IdleSettings
from cranectl.cli.output import Screen
from cranectl.report import Cell, Table

if TYPE_CHECKING:
    from cranectl.campaign.definition import Campaign, UncertainParameter

QUANTILES = (0.05, 0.95)


@click.command("list", cls=Command)
@Command.json_option
def list_campaigns(screen: Screen) -> None:
    """List the campaigns that come with cranectl.

    \b
    cranectl campaign list
    cranectl campaign list --json -
    """
    shipped = [campaigns.load_campaign(name) for name in campaigns.CampaignSettings.shipped_names()]
    headings = ("campaign", "scenario", "sampling", "parameters", "runs")
    rows = tuple(
        Cell.row(s.name, s.scenario, s.sampling, str(len(campaign.parameters)), str(campaign.runs))
        for campaign, s in ((campaign, campaign.settings) for campaign in shipped)
    )
    screen.print(Table("Campaigns", headings, rows, labels=3))
    screen.print_each(f"{campaign.settings.name}: {campaign.settings.title}" for campaign in shipped)
    screen.write_json({"campaigns": [_facts(campaign) for campaign in shipped]})


@click.command("show", cls=Command)
@campaign_argument
@click.option("--no-estimate", is_flag=True, help="Do not run anything to say how long it takes.")
@Command.json_option
def show_campaign(campaign: "Campaign", no_estimate: bool, screen: Screen) -> None:
    """Say what is uncertain in CAMPAIGN, and how long it takes here.

    The time is that of nominal runs, one with each controller on each plant, times their number.

    \b
    cranectl campaign show lab-rig
    cranectl campaign show mine.toml --runs 10000 --no-estimate
    """
    screen.print(_parameters_table(campaign))
    screen.print_each(_lines(campaign))
    IdleSettings.print(screen, idle_in_campaign(campaign))
    facts = _facts(campaign)
    if not no_estimate:
        cores = Count.available_cores()
        with Screen.progress_bar(1.0, "running the nominal scenario", done="measured"):
            seconds = campaigns.estimated_seconds(campaign, workers=cores)
        screen.print(f"time: about {duration(seconds)} on {cores} cores")
        facts |= {"estimated_s": seconds, "workers": cores}
    screen.write_json(facts)


def duration(seconds: float) -> str:
    """Return a readable time with about two digits."""
    if seconds < 90.0:
        return f"{max(1, math.ceil(seconds))} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _parameters_table(campaign: "Campaign") -> Table:
    headings = ("parameter", "unit", "distribution", "nominal", *(f"{100 * q:g} %" for q in QUANTILES))
    rows = tuple(
        Cell.row(
            parameter.name,
            campaigns.describe(campaign, parameter.name).unit,
            parameter.distribution.distribution,
            *(f"{value:.4g}" for value in (parameter.nominal, *_quantiles(parameter))),
        )
        for parameter in campaign.parameters
    )
    note = "Quantiles are of what the plant gets; the controller knows the nominal values."
    return Table(f"Campaign {campaign.settings.name}", headings, rows, labels=3, note=note)


def _quantiles(parameter: "UncertainParameter") -> list[float]:
    import numpy as np

    values: list[float] = parameter.values(np.array(QUANTILES)).tolist()
    return values


def _lines(campaign: "Campaign") -> list[str]:
    settings, limits = campaign.settings, campaign.settings.limits.given
    simulated = campaign.all_runs * campaign.nominal.duration
    return [
        *([settings.title] if settings.title else []),
        f"scenario: {settings.scenario}, {campaign.nominal.duration:g} s, {settings.drive} drives",
        f"controllers: {', '.join(settings.controllers)}",
        f"plants: {', '.join(settings.plants)}",
        f"sampling: {settings.sampling}, seed {settings.seed}",
        *(f"correlation: {pair}" for pair in settings.correlation),
        *(f"limit: {name} = {limit:g}" for name, limit in limits.items()),
        f"runs: {campaign.all_runs} of {campaign.runs} samples, {simulated:g} s simulated",
    ]


def _facts(campaign: "Campaign") -> dict[str, Any]:
    return {
        **campaign.settings.model_dump(mode="json", exclude={"uncertain", "runs"}),
        "samples": campaign.runs,
        "runs": campaign.all_runs,
        "parameters": [
            {
                "name": parameter.name,
                "unit": campaigns.describe(campaign, parameter.name).unit,
                "nominal": parameter.nominal,
                "distribution": parameter.distribution.model_dump(mode="json", exclude_none=True),
                "quantiles": dict(zip(map(str, QUANTILES), _quantiles(parameter), strict=True)),
            }
            for parameter in campaign.parameters
        ],
    }

"""Options that choose and change a campaign."""

import functools
import json
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from cranectl import campaign as campaigns
from cranectl.cli.command import Command
from cranectl.cli.completion import Completion
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.idle import IdleSettings
from cranectl.cli.names import Names
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.plants import DRIVES
from cranectl.support import FileKind, InputError

if TYPE_CHECKING:
    from cranectl.campaign.definition import Campaign


class Judgement(NamedTuple):
    """What `--max-failures` and `--junit` ask for."""

    allowed: "campaigns.AllowedFailures | None"
    junit: Path | None


def judgement_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--max-failures` and `--junit`; the command gets them as `judgement`."""

    @click.option(
        "--max-failures",
        metavar="N|N%",
        help="Exit code 1 if more runs with a controller on a plant fail: a number, or a share such as 5%.",
    )
    @Command.output_option(
        "--junit",
        FileKind.XML,
        "With --max-failures: write JUnit XML, a test for each controller and plant.",
    )
    @functools.wraps(function)
    def command(*given: Any, max_failures: str | None, junit: Path | None, **options: Any) -> Any:
        if junit is not None and max_failures is None:
            raise InputError(
                "--junit without --max-failures, which judges the runs",
                allowed="--junit with --max-failures",
                remedy="add --max-failures 5%",
            )
        allowed = None if max_failures is None else campaigns.AllowedFailures.parse(max_failures)
        return function(*given, judgement=Judgement(allowed, junit), **options)

    return command


def campaign_argument(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add CAMPAIGN and the options that replace fields of its file; the command gets the changed campaign."""

    @click.argument("campaign", shell_complete=Completion.campaigns)
    @click.option("--runs", type=int, metavar="N", help="Number of samples.")
    @ControllerName.repeated_option("Default: the campaign's; repeatable, or names with commas.")
    @Names.plants_option("Default: the campaign's.", check="check_campaigns")
    @click.option(
        "--drive",
        metavar="NAME",
        shell_complete=Completion.drives,
        help="ideal, velocity or force. Default: the campaign's.",
    )
    @click.option(
        "--rig",
        metavar="NAME",
        shell_complete=Completion.rigs,
        help="Name or TOML file of a rig. Default: the campaign's.",
    )
    @click.option("--seed", type=int, metavar="N", help="Other samples. Default: the campaign's.")
    @click.option(
        "--set",
        "overrides",
        metavar="KEY=VALUE",
        multiple=True,
        help="Override any field of the campaign (uncertain.rig.load_mass.low=0.8, limits.max_error_m=0.1) "
        "or of its scenario (duration=5); repeatable.",
    )
    @ControllerName.trust_option("CAMPAIGN")
    @functools.wraps(function)
    def command(campaign: str, overrides: Sequence[str], trust: bool, **options: Any) -> Any:
        to_toml = functools.partial(json.dumps, ensure_ascii=False)  # the same for strings, numbers, lists
        fields = campaigns.CampaignSettings.model_fields
        roots = [text.partition("=")[0].split(".") for text in overrides]
        own = [
            text
            for text, root in zip(overrides, roots, strict=True)
            if root[0] in fields and (root[0] != "rig" or len(root) == 1)  # rig.load_mass is the scenario's
        ]
        shared = [text for text in overrides if text not in own]
        replaced = {
            key: options.pop(key) for key in ("runs", "controllers", "plants", "drive", "rig", "seed")
        }
        if trust and not replaced["controllers"]:
            named, folder = (
                campaigns.CampaignSettings.read(campaign, overrides=own).controllers,
                campaigns.CampaignSettings.file_of(campaign).parent,
            )
            replaced["controllers"] = tuple(ControllerName.open(name, folder) for name in named)
        own += [f"{key}={to_toml(value)}" for key, value in replaced.items() if value not in (None, ())]
        if shared:
            own.append(
                f"set={to_toml([*campaigns.CampaignSettings.read(campaign, overrides=own).set, *shared])}"
            )
        return function(campaigns.load_campaign(campaign, overrides=own), **options)

    return command


def idle_in_campaign(campaign: "Campaign") -> list[str]:
    """Say which settings of a campaign and of its scenario change nothing in its runs."""
    settings = campaign.settings
    uses = product(settings.plants, (DRIVES.checked(settings.drive),), settings.controllers)
    request = ScenarioRequest(settings.scenario, settings.rig, settings.set)
    lines = IdleSettings.lines(campaign.nominal, request, uses, unread=("limits.*", "expected"))
    if "seed" in settings.model_fields_set and settings.sampling in campaigns.COUNTED:
        lines.append(
            f"{settings.name}: seed changes nothing here: {settings.sampling} sampling draws nothing"
        )
    return lines

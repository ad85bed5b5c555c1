"""Options that choose and change a campaign."""

import functools
import json
from collections.abc import Callable, Sequence
from typing import Any

import click

from cranectl.cli.command import plants_option
from cranectl.cli.completion import complete_campaigns, complete_drives, complete_rigs
from cranectl.cli.controller_options import controllers_option, opened, trust_option


def campaign_argument(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add CAMPAIGN and the options that replace fields of its file; the command gets the changed campaign."""

    @click.argument("campaign", shell_complete=complete_campaigns)
    @click.option("--runs", type=int, metavar="N", help="Number of samples.")
    @controllers_option("Default: the campaign's; repeatable, or names with commas.")
    @plants_option("Default: the campaign's.", check="check_campaigns")
    @click.option(
        "--drive",
        metavar="NAME",
        shell_complete=complete_drives,
        help="ideal, velocity or force. Default: the campaign's.",
    )
    @click.option(
        "--rig",
        metavar="NAME",
        shell_complete=complete_rigs,
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
    @trust_option("CAMPAIGN")
    @functools.wraps(function)
    def command(campaign: str, overrides: Sequence[str], trust: bool, **options: Any) -> Any:
        from cranectl.campaign import campaign_file, load_campaign, read_campaign
        from cranectl.campaign.settings import CampaignSettings

        to_toml = functools.partial(json.dumps, ensure_ascii=False)  # the same for strings, numbers, lists
        fields = CampaignSettings.model_fields
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
            named, folder = read_campaign(campaign, overrides=own).controllers, campaign_file(campaign).parent
            replaced["controllers"] = tuple(opened(name, folder) for name in named)
        own += [f"{key}={to_toml(value)}" for key, value in replaced.items() if value not in (None, ())]
        if shared:
            own.append(f"set={to_toml([*read_campaign(campaign, overrides=own).set, *shared])}")
        return function(load_campaign(campaign, overrides=own), **options)

    return command

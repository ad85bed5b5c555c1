"""Options that choose and change a campaign."""

import json
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

from cranectl.cli.options import names_given, plants_option

if TYPE_CHECKING:
    from cranectl.campaign import Campaign

F = TypeVar("F", bound=Callable[..., Any])


def campaign_options(function: F) -> F:
    """What replaces fields of the campaign's file; `chosen_campaign` takes them."""
    options = [
        click.option("--runs", type=int, metavar="N", help="Number of samples."),
        controllers_option("Default: the campaign's; repeatable, or names with commas."),
        plants_option("Default: the campaign's."),
        click.option("--drive", metavar="NAME", help="ideal or velocity. Default: the campaign's."),
        click.option("--seed", type=int, metavar="N", help="Other samples. Default: the campaign's."),
        click.option(
            "--set",
            "overrides",
            metavar="KEY=VALUE",
            multiple=True,
            help="Override any field of the campaign (uncertain.rig.load_mass.low=0.8, "
            "limits.max_error_m=0.1) or of its scenario (duration=5); repeatable.",
        ),
    ]
    for option in reversed(options):
        function = option(function)
    return function


def controllers_option(help_text: str) -> Callable[[F], F]:
    """`--controller`, one name or more."""
    return click.option(
        "--controller",
        "--controllers",
        "controllers",
        metavar="NAME",
        multiple=True,
        callback=names_given,
        help=help_text,
    )


def cluster_options(function: F) -> F:
    """Where the batches of a campaign are run, if not in threads."""
    options = [
        click.option(
            "--scheduler",
            metavar="ADDRESS",
            help="Run on the workers of this Dask scheduler: tcp://host:8786, or tls:// with certificates. "
            "Whoever reaches it runs programs there: start it with --host, in a closed network.",
        ),
        click.option(
            "--cluster",
            type=click.Choice(["local"]),
            help="local: run on a Dask cluster of --workers processes on this machine, to try it.",
        ),
    ]
    for option in reversed(options):
        function = option(function)
    return function


def chosen_campaign(
    name_or_path: str,
    *,
    runs: int | None,
    controllers: Sequence[str],
    plants: Sequence[str],
    drive: str | None,
    seed: int | None,
    overrides: Sequence[str],
) -> "Campaign":
    """The campaign with what its options replace."""
    from cranectl.campaign import load_campaign, read_campaign
    from cranectl.campaign.settings import CampaignSettings

    own = [
        text for text in overrides if text.partition("=")[0].split(".")[0] in CampaignSettings.model_fields
    ]
    options: dict[str, Any] = {"runs": runs, "controllers": list(controllers), "plants": list(plants)}
    options |= {"drive": drive, "seed": seed}
    own += [f"{key}={_toml(value)}" for key, value in options.items() if value not in (None, [])]
    shared = [text for text in overrides if text not in own]
    if shared:
        settings = read_campaign(name_or_path, overrides=own)
        own.append(f"set={_toml([*settings.set, *shared])}")
    return load_campaign(name_or_path, overrides=own)


def _toml(value: Any) -> str:
    """Strings, numbers and lists of them are written the same in TOML and in JSON."""
    return json.dumps(value, ensure_ascii=False)

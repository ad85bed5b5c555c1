"""Options that several commands share."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from cranectl.cli.command import OutputFile
from cranectl.support.places import JSON

F = TypeVar("F", bound=Callable[..., Any])


def json_option(function: F) -> F:
    """`--json FILE`."""
    return click.option(
        "--json",
        "json_file",
        metavar="FILE",
        type=OutputFile(JSON, dash=True),
        help="Write the result as JSON; - is standard output, tables then go to standard error.",
    )(function)


def scenario_options(function: F) -> F:
    """`--rig` and `--set`."""
    rig = click.option(
        "--rig",
        metavar="FILE",
        type=click.Path(path_type=Path),
        help="TOML file of rig parameters; overrides those of the scenario.",
    )
    assign = click.option(
        "--set",
        "overrides",
        metavar="KEY=VALUE",
        multiple=True,
        help="Override any field of the scenario, e.g. rig.load_mass=2.5; repeatable.",
    )
    return rig(assign(function))


def predict_option(function: F) -> F:
    """`--predict`."""
    return click.option(
        "--predict",
        is_flag=True,
        help="Judge velocity drives of a scenario or rig that is not shipped by a bound computed for it, in "
        "some seconds a case; without it they are not judged.",
    )(function)


def drive_option(*, default: str) -> Callable[[F], F]:
    """`--drive`."""
    both = "; or both" if default == "both" else ""
    return click.option(
        "--drive",
        default=default,
        show_default=True,
        metavar="NAME",
        help=f"ideal: accelerations realised exactly; velocity: first-order drives with set-points{both}.",
    )

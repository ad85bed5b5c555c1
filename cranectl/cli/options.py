"""Options that several commands share."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])


def json_option(function: F) -> F:
    """`--json FILE`."""
    return click.option(
        "--json",
        "json_file",
        metavar="FILE",
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


def drive_option(function: F) -> F:
    """`--drive`."""
    return click.option(
        "--drive",
        default="ideal",
        show_default=True,
        metavar="NAME",
        help="ideal: accelerations realised exactly; velocity: first-order drives that take set-points.",
    )(function)

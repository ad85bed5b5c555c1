"""Options that are refused beside or without others."""

from collections.abc import Mapping
from typing import Any

import click

from cranectl.support import InputError

fmi_option = click.option(
    "--fmi", type=click.Choice(["2", "3"]), help="Version of FMI for --fmu. Default: 2."
)


def refuse_options(
    options: Mapping[str, Any], why: str, *, allowed: str, remedy: str = "leave out {}"
) -> None:
    """Raise InputError if any of `options`, by name, has a value; `{}` in `remedy` stands for the names."""
    given = " and ".join(name for name, value in options.items() if value)
    if given:
        raise InputError(f"{given} {why}", allowed=allowed, remedy=remedy.format(given))


def refuse_fmi(fmi: str | None) -> None:
    """Raise InputError for `--fmi`, if it is given without `--fmu`."""
    refuse_options({"--fmi": fmi}, "without --fmu", allowed="--fmi with --fmu", remedy="add --fmu FILE")

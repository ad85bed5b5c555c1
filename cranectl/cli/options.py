"""Options that several commands share."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from cranectl.cli.command import OutputFile
from cranectl.support.errors import InputError
from cranectl.support.files import JSON, Kind

F = TypeVar("F", bound=Callable[..., Any])


controller_option = click.option("--controller", metavar="NAME", help="Default: the scenario's own.")
json_option = click.option(
    "--json",
    "json_file",
    metavar="FILE",
    type=OutputFile(JSON, dash=True),
    help="Write the result as JSON; - is standard output, tables then go to standard error.",
)
predict_option = click.option(
    "--predict",
    is_flag=True,
    help="Judge velocity drives of a scenario or rig that is not shipped by a bound computed for it, in "
    "some seconds a case; without it they are not judged.",
)


def output_option(
    name: str, kind: Kind | None, help_text: str, *, endings: tuple[str, ...] = ()
) -> Callable[[F], F]:
    """An option for a file to write: of one kind, or of that which one of `endings` names."""
    return click.option(name, metavar="FILE", type=OutputFile(kind, endings=endings), help=help_text)


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


def plants_option(help_text: str) -> Callable[[F], F]:
    """`--plants`: names with commas, or all; nothing is () and means what the command says."""
    return click.option(
        "--plants", "--plant", "plants", metavar="A,B|all", multiple=True, callback=_plants, help=help_text
    )


def _plants(context: click.Context, parameter: click.Parameter, given: tuple[str, ...]) -> tuple[str, ...]:
    names = names_given(context, parameter, given)
    if not names:
        return ()
    from cranectl.plants.registry import PLANTS, plant_entry

    if names in (("all",), ("both",)):  # both: as long as there were two
        return tuple(PLANTS)
    return tuple(plant_entry(name).name for name in names)


def names_given(_: click.Context, parameter: click.Parameter, given: tuple[str, ...]) -> tuple[str, ...]:
    """Names with commas between, of an option that may be repeated; each once."""
    names = [name.strip() for text in given for name in text.split(",")]
    if not all(names):
        raise InputError(
            f"{parameter.opts[0]} {','.join(given)}: a name is empty",
            allowed="a name, or names with a comma between",
            remedy="remove the comma that is too many",
        )
    return tuple(dict.fromkeys(names))


def layout_for(plants: Sequence[str]) -> str:
    """What `cranectl log layout` is given to show a log of `plants`."""
    from cranectl.plants.registry import PLANTS

    if len(plants) == 1:
        return f"single view.json --plant {plants[0]}"
    chosen = "" if len(plants) == len(PLANTS) else f" --plants {','.join(plants)}"
    return f"comparison view.json{chosen}"


def drive_option(*, default: str, force: bool = True) -> Callable[[F], F]:
    """`--drive`; `force`: whether the command takes force drives."""
    forces = "; force: forces on bridge, trolley, winch" if force else ""
    both = "; both: ideal and velocity; all" if default == "both" else ""
    return click.option(
        "--drive",
        default=default,
        show_default=True,
        metavar="NAME",
        help="ideal: accelerations realised exactly; velocity: first-order drives with set-points"
        f"{forces}{both}.",
    )

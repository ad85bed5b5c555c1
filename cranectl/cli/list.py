"""`cranectl list`."""

import json
import tomllib
from typing import Any

import click

from cranectl import scenario as scenario_files
from cranectl.cli.command import Command
from cranectl.cli.output import Screen
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.plants import DRIVES, PLANTS
from cranectl.report import Cell, Table
from cranectl.support import Shipped

DOCUMENTS = ("scenario", "rig", "campaign", "benchmark", "map")


def _show(context: click.Context, _: click.Parameter, document: str | None) -> None:
    """Print the schema and end the command."""
    if document is None or context.resilient_parsing:  # a shell completes the line
        return
    from cranectl.cli.schemas import json_schema  # which loads all kinds of documents

    click.echo(json.dumps(json_schema(document), indent=1, ensure_ascii=False))
    context.exit()


schema_option = click.option(
    "--schema",
    type=click.Choice(DOCUMENTS),
    callback=_show,
    is_eager=True,
    expose_value=False,
    help="Print the JSON Schema of this kind of file instead, for editors.",
)


@click.command("list", cls=Command)
@schema_option
@Command.json_option
def list_command(screen: Screen) -> None:
    """List scenarios, rigs, controllers, plants and drives.

    --schema prints the keys of a kind of file, those of installed packages included. With `#:schema
    scenario.json` in the first line of a TOML file, editors complete its keys, explain them and mark
    mistakes.

    \b
    cranectl list
    cranectl list --json -
    cranectl list --schema scenario > scenario.json
    """
    default = next(iter(ALL_CONTROLLERS))
    headings = [_heading(name, default) for name in Shipped.SCENARIOS.names()]
    rows = tuple(
        Cell.row(h["name"], f"{h['duration']:g} s", _name(h["controller"]), h["title"]) for h in headings
    )
    screen.print(Table("Scenarios", ("name", "duration", "controller", "what it is"), rows, labels=4))
    controllers = [(name, origin, title) for name, (origin, title) in ALL_CONTROLLERS.described().items()]
    rows = tuple(Cell.row(*controller) for controller in controllers)
    screen.print(Table("Controllers", ("name", "from", "what it is"), rows, labels=3))
    registries = {"rigs": Shipped.RIGS.names(), "plants": [*PLANTS], "drives": [*DRIVES]}
    screen.print_each(f"{name:12} {', '.join(entries)}" for name, entries in registries.items())
    names = [name for name, *_ in controllers]
    screen.write_json({"scenarios": headings, "controllers": names, **registries})


def _name(controller: str | dict[str, Any]) -> str:
    """Return the name of a controller, which stands alone or in a table with its parameters."""
    return controller if isinstance(controller, str) else str(controller["name"])


def _heading(name: str, default_controller: str) -> dict[str, Any]:
    """Return name, title, duration [s] and controller of a shipped scenario, as its file states them.

    Only a scenario that leaves more than its controller to the defaults is read in full: that takes a second.
    """
    table = tomllib.loads(Shipped.SCENARIOS.file(name).read_text(encoding="utf-8"))
    controller = table.get("controller", default_controller)
    if isinstance(controller, dict) and controller.keys() == {"name"}:
        controller = controller["name"]
    if {"name", "title", "duration"} <= table.keys() and isinstance(controller, str):
        stated = {"name": table["name"], "title": table["title"], "duration": float(table["duration"])}
        return {**stated, "controller": controller}
    return scenario_files.ScenarioFile.read(name).model_dump(
        include={"name", "title", "duration", "controller"}
    )

"""`cranectl list`, and the JSON Schemas of `--schema`."""

import json
import tomllib
from math import isfinite
from typing import TYPE_CHECKING, Any

import click

from cranectl.cli.command import Command
from cranectl.cli.output import Screen
from cranectl.report import Cell, Table
from cranectl.support import Shipped

if TYPE_CHECKING:
    from cranectl.controllers import Parameter

DOCUMENTS = ("scenario", "rig", "campaign", "benchmark", "map")


def _show(context: click.Context, _: click.Parameter, document: str | None) -> None:
    """Print the schema and end the command."""
    if document is None or context.resilient_parsing:  # a shell completes the line
        return
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
    from cranectl.controllers import ALL_CONTROLLERS
    from cranectl.plants import DRIVES, PLANTS

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
    from cranectl.scenario import ScenarioFile

    return ScenarioFile.read(name).model_dump(include={"name", "title", "duration", "controller"})


def json_schema(document: str) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a file of the kind `document`, one of DOCUMENTS."""
    from cranectl.campaign import CampaignSettings
    from cranectl.scenario import AddedSegment, RigParameters, Scenario
    from cranectl.tools.benchmark.settings import Benchmark
    from cranectl.tools.measured.mapping import MeasuredMap

    models: dict[str, Any] = {
        "scenario": Scenario,
        "rig": RigParameters,
        "campaign": CampaignSettings,
        "benchmark": Benchmark,
        "map": MeasuredMap,
    }
    schema = models[document].model_json_schema()
    if document == "scenario":
        schema["$defs"]["LimitSettings"] |= _limits()
        schema["$defs"]["AddedSegment"]["properties"]["kind"]["enum"] = AddedSegment.kinds()
        schema["properties"]["controller"] = _controller(schema["$defs"]["ControllerSettings"])
        rig = schema["properties"]["rig"]
        by_path = {"description": "path of a rig file, relative to this file"}
        schema["properties"]["rig"] = {"if": {"type": "string"}, "then": by_path, "else": rig}
    if document == "rig":
        schema["properties"]["extends"] = {
            "type": "string",
            "description": "path of a rig file to begin with",
        }
    if document == "campaign":
        schema["properties"]["uncertain"]["$ref"] = "#/$defs/Uncertain"
        schema["$defs"]["Uncertain"] = _nested(schema["properties"]["uncertain"].pop("additionalProperties"))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _nested(distribution: dict[str, Any]) -> dict[str, Any]:
    """Return tables in tables, as a scenario has them, where a table with a distribution is a leaf."""
    below = {
        "if": {"type": "object", "required": ["distribution"]},
        "then": distribution,
        "else": {"$ref": "#/$defs/Uncertain"},
    }
    return {"type": "object", "additionalProperties": below}


def _limits() -> dict[str, Any]:
    """Return the schema of limits on metrics, with a table of them for each plant."""
    from cranectl.metrics import Limits
    from cranectl.plants import PLANTS

    own = {"properties": Limits.model_json_schema()["properties"], "additionalProperties": False}
    tables = {plant: {"type": "object", "description": f"on {plant} only", **own} for plant in PLANTS}
    return {**own, "properties": {**own["properties"], **tables}}


def _controller(table: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a controller: a name, or a table of name and parameters."""
    from cranectl.controllers import ALL_CONTROLLERS

    name = {**table["properties"]["name"], "enum": list(ALL_CONTROLLERS)}
    tables = {}
    for controller in ALL_CONTROLLERS.values():
        if controller.axis_design is not None:  # its numbers are in [design]
            continue
        tables[controller.name] = {
            "type": "object",
            "description": controller.title,
            "properties": {parameter.name: _parameter(parameter) for parameter in controller.parameters},
            "additionalProperties": False,
        }
    both = {**table, "properties": {"name": name, **tables}, "additionalProperties": False}
    return {"anyOf": [name, both], "description": table["description"]}


def _parameter(parameter: "Parameter") -> dict[str, Any]:
    """Return the schema of a controller's parameter: a text or a number within its bounds."""
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    schema = {"description": f"{parameter.description}{unit}", "default": parameter.default}
    if parameter.choices:
        return {**schema, "enum": list(parameter.choices)}
    bounds = {"minimum": parameter.lowest, "maximum": parameter.highest}
    return {**schema, "type": "number", **{name: end for name, end in bounds.items() if isfinite(end)}}

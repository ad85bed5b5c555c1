"""JSON Schemas of files that users write, as `cranectl list --schema` prints them."""

from math import isfinite
from typing import Any

from cranectl.campaign import CampaignSettings
from cranectl.controllers import ALL_CONTROLLERS, Parameter
from cranectl.metrics import Limits
from cranectl.plants import PLANTS
from cranectl.scenario import AddedSegment, RigParameters, Scenario
from cranectl.tools.benchmark import Benchmark
from cranectl.tools.measured import MeasuredMap


def json_schema(document: str) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a file of the kind `document`."""
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
    own = {"properties": Limits.model_json_schema()["properties"], "additionalProperties": False}
    tables = {plant: {"type": "object", "description": f"on {plant} only", **own} for plant in PLANTS}
    return {**own, "properties": {**own["properties"], **tables}}


def _controller(table: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a controller: a name, or a table of name and parameters."""
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


def _parameter(parameter: Parameter) -> dict[str, Any]:
    """Return the schema of a controller's parameter: a text or a number within its bounds."""
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    schema = {"description": f"{parameter.description}{unit}", "default": parameter.default}
    if parameter.choices:
        return {**schema, "enum": list(parameter.choices)}
    bounds = {"minimum": parameter.lowest, "maximum": parameter.highest}
    return {**schema, "type": "number", **{name: end for name, end in bounds.items() if isfinite(end)}}

"""The header of logs of format 2: what their metadata and attachments mean.

Once logs of another format are written this file stays as it is, and turns old into what is known then.
"""

import math
from collections.abc import Mapping
from typing import Any

from cranectl.controllers.controller import LawDesign
from cranectl.controllers.registry import design_from_json
from cranectl.design import Design
from cranectl.log.consistency import MAX_NS, Outcome, check_design, check_outcome
from cranectl.log.header import LogHeader
from cranectl.plants.registry import PLANTS
from cranectl.scenario import Scenario
from cranectl.scenario.settings import parse_settings
from cranectl.simulate import checked_drive
from cranectl.status import RunStatus
from cranectl.support.documents import leaves, parse_json


def read_header(metadata: Mapping[str, Mapping[str, str]], attachments: Mapping[str, bytes]) -> LogHeader:
    """The header that metadata and attachments make.

    Raises DamageError where it contradicts itself; InputError, KeyError, TypeError, ValueError, IndexError,
    OverflowError or RecursionError where it is no such header.
    """
    declared = metadata["cranectl"]
    scenario = parse_settings(Scenario, _json(attachments, "scenario.json"), "scenario.json")
    plants = declared["plants"].split(",")
    if not set(plants) <= set(PLANTS) or len(set(plants)) < len(plants):
        raise ValueError(f"unknown plants {declared['plants']}")
    design = _design(_json(attachments, "design.json"))
    if (declared["scenario"], declared["controller"]) != (scenario.name, design.name):
        raise ValueError(f"it is said to be of {declared['scenario']} and {declared['controller']}")
    check_design(design)
    header = LogHeader(
        scenario=scenario,
        design=design,
        drive=checked_drive(declared["drive"]),
        every=_count(declared["every"], least=1),
        models={plant: _model(attachments, plant) for plant in plants},
        versions=metadata["versions"],
        outcomes={p: _outcome(metadata[f"run/{p}"]) for p in plants if f"run/{p}" in metadata},
        from_ns=_count(metadata["live"]["from_ns"]) if "live" in metadata else None,
    )
    for plant, outcome in header.outcomes.items():
        check_outcome(plant, outcome, header.clock)
    return header


def _model(attachments: Mapping[str, bytes], plant: str) -> str:
    return attachments.get(f"{plant}.xml", attachments.get(f"{plant}.txt", b"")).decode()


def _outcome(declared: Mapping[str, str]) -> Outcome:
    statuses = {status.label: status for status in RunStatus}
    if declared["status"] not in statuses:
        raise ValueError(f"unknown status '{declared['status']}'")
    return Outcome(statuses[declared["status"]], _count(declared["end_ns"]), _count(declared["samples"]))


def _count(text: str, *, least: int = 0) -> int:
    """Samples or nanoseconds, no more than there can be."""
    digits = len(str(MAX_NS))
    if not (text.isascii() and text.isdecimal() and len(text) <= digits and least <= int(text) <= MAX_NS):
        raise ValueError(f"'{text[: 2 * digits]}' is no number from {least} to {MAX_NS}")
    return int(text)


def _json(attachments: Mapping[str, bytes], name: str) -> dict[str, Any]:
    data = parse_json(attachments[name], name)
    if not isinstance(data, dict):
        raise TypeError(f"{name} is no table")
    return data


def _design(data: dict[str, Any]) -> Design | LawDesign:
    """The design in `data`, if it says the same as `data`: whole matrices of numbers, none of them NaN."""
    design = design_from_json(data)
    if isinstance(design, LawDesign):
        return design
    for _, number in leaves({name: value for name, value in data.items() if name != "name"}):
        if number is None:
            continue
        if isinstance(number, bool) or not isinstance(number, int | float) or math.isnan(number):
            raise TypeError(f"design.json holds {number!r} where a number belongs")
    declared = design.to_json()
    if any(declared[name] != value for name, value in data.items()):
        raise ValueError("the numbers of design.json do not fit together")
    return design

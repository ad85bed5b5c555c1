"""What a log says of its runs beside their signals: scenario, design, plants, outcomes."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from cranectl.design import Design
from cranectl.errors import InputError, LogError
from cranectl.log import topics
from cranectl.log.consistency import check_design
from cranectl.log.outcome import MAX_NS, Clock, Outcome, check_outcome
from cranectl.log.records import DamageError
from cranectl.plants.interface import PLANTS, Drive
from cranectl.scenario import Scenario
from cranectl.settings import parse_settings
from cranectl.signals import REFERENCE, SignalGroup
from cranectl.simulate import checked_drive, groups_of
from cranectl.status import RunStatus

MAX_JSON = 2**20  # [bytes]; scenarios and designs have a few thousand


@dataclass(frozen=True)
class LogHeader:
    """The metadata and attachments of a log, understood."""

    scenario: Scenario
    design: Design
    drive: Drive
    every: int  # logged every n-th control sample
    models: Mapping[str, str]  # the plants' own descriptions, by plant
    versions: Mapping[str, str]
    outcomes: Mapping[str, Outcome]  # by plant, where known
    from_ns: int | None  # where a take of a live session begins

    @property
    def plants(self) -> tuple[str, ...]:
        """In the order of the log."""
        return tuple(self.models)

    @property
    def clock(self) -> Clock:
        """When its runs have samples."""
        return Clock.of(self.scenario, self.every, self.from_ns)

    def outcome(self, plant: str) -> Outcome:
        """How the run of `plant` ended; raises DamageError if that is missing."""
        if plant not in self.outcomes:
            raise DamageError(f"it does not say how the run of {plant} ended")
        return self.outcomes[plant]

    def groups(self) -> dict[str, SignalGroup]:
        """The groups of signals that make up the runs, by topic."""
        recorded = groups_of(self.scenario, self.design, self.drive)
        found = {topics.plant_topic(plant, group.name): group for plant in self.plants for group in recorded}
        return {**found, topics.REFERENCE_LOAD: REFERENCE}


def parse_header(
    path: str, metadata: Mapping[str, Mapping[str, str]], attachments: Mapping[str, bytes]
) -> LogHeader:
    """The header of the log at `path`; raises LogError for a foreign log and one of another version."""
    if "cranectl" not in metadata:
        raise LogError(
            f"{path} is an MCAP file, but not of cranectl",
            allowed="logs that cranectl wrote",
            remedy="name such a log, or open the file in a viewer",
        )
    version = metadata["cranectl"].get("format")
    if version != topics.FORMAT_VERSION:
        raise LogError(
            f"{path} has log format {version}",
            allowed=f"format {topics.FORMAT_VERSION}",
            remedy="write the log again, or read it with the version of cranectl that wrote it",
        )
    try:
        return _header(metadata, attachments)
    except InputError as error:
        raise LogError(
            f"{path}: {error.found}", allowed=error.allowed, remedy="write the log again"
        ) from None
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, RecursionError) as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise LogError(
            f"{path} is not a log this version understands: {reason[:200]}",
            allowed=f"logs of cranectl, format {topics.FORMAT_VERSION}",
            remedy="write the log again with this version",
        ) from None


def _header(metadata: Mapping[str, Mapping[str, str]], attachments: Mapping[str, bytes]) -> LogHeader:
    said = metadata["cranectl"]
    scenario = parse_settings(Scenario, _json(attachments, "scenario.json"), "scenario.json")
    plants = said["plants"].split(",")
    if not set(plants) <= set(PLANTS) or len(set(plants)) < len(plants):
        raise ValueError(f"unknown plants {said['plants']}")
    design = _design(_json(attachments, "design.json"))
    if (said["scenario"], said["controller"]) != (scenario.name, design.name):
        raise ValueError(f"it is said to be of {said['scenario']} and {said['controller']}")
    check_design(design)
    header = LogHeader(
        scenario=scenario,
        design=design,
        drive=checked_drive(said["drive"]),
        every=_count(said["every"], least=1),
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


def _outcome(said: Mapping[str, str]) -> Outcome:
    statuses = {status.label: status for status in RunStatus}
    if said["status"] not in statuses:
        raise ValueError(f"unknown status '{said['status']}'")
    return Outcome(statuses[said["status"]], _count(said["end_ns"]), _count(said["samples"]))


def _count(text: str, *, least: int = 0) -> int:
    """Samples or nanoseconds, no more than there can be."""
    digits = len(str(MAX_NS))
    if not (text.isascii() and text.isdecimal() and len(text) <= digits and least <= int(text) <= MAX_NS):
        raise ValueError(f"'{text[: 2 * digits]}' is no number from {least} to {MAX_NS}")
    return int(text)


def _json(attachments: Mapping[str, bytes], name: str) -> dict[str, Any]:
    if len(attachments[name]) > MAX_JSON:
        raise ValueError(f"{name} has {len(attachments[name])} bytes")
    data = json.loads(attachments[name])
    if not isinstance(data, dict):
        raise TypeError(f"{name} is no table")
    return data


def _design(data: dict[str, Any]) -> Design:
    """The design in `data`, if it says the same as `data`: whole matrices of numbers, none of them NaN."""
    design = Design.from_json(data)
    for number in _leaves([value for name, value in data.items() if name != "name"]):
        if isinstance(number, bool) or not isinstance(number, int | float) or math.isnan(number):
            raise TypeError(f"design.json holds {number!r} where a number belongs")
    said = design.to_json()
    if any(said[name] != value for name, value in data.items()):
        raise ValueError("the numbers of design.json do not fit together")
    return design


def _leaves(node: Any) -> Iterator[Any]:
    if isinstance(node, dict | list):
        for child in node.values() if isinstance(node, dict) else node:
            yield from _leaves(child)
    elif node is not None:
        yield node

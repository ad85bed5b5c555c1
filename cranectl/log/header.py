"""What a log says of its runs beside their signals: scenario, design, plants, outcomes.

The rule of formats, docs/reference/logs.md: the number rises with each change that would make an older reader
misread or refuse a log, and every number ever written stays readable. A change that only adds what old
readers pass over does not raise it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cranectl.controllers.controller import LawDesign
from cranectl.controllers.registry import design_from_json
from cranectl.design import Design
from cranectl.log import topics
from cranectl.log.consistency import MAX_NS, Clock, Outcome, check_design, check_outcome
from cranectl.mcap_columns.records import DamageError
from cranectl.plants.plant import Drive
from cranectl.plants.registry import PLANTS
from cranectl.scenario import Scenario
from cranectl.scenario.held_files import with_files
from cranectl.scenario.settings import parse_settings
from cranectl.signals import REFERENCE, SignalGroup
from cranectl.simulate import checked_drive, groups_of
from cranectl.status import RunStatus
from cranectl.support.documents import leaves, parse_json
from cranectl.support.errors import InputError, LogError

FORMATS = ("2",)  # that can be read; the last is written
OVERLAY = "overlay"  # the metadata of a log of runs by label, which has a header for each


@dataclass(frozen=True)
class LogHeader:
    """The metadata and attachments of a log, understood."""

    scenario: Scenario
    design: Design | LawDesign
    drive: Drive
    every: int  # logged every n-th control sample
    models: Mapping[str, str]  # the plants' own descriptions, by plant
    versions: Mapping[str, str]
    outcomes: Mapping[str, Outcome]  # by plant, where known
    from_ns: int | None  # where a segment of a live session begins

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
        groups = {topics.plant_topic(plant, group.name): group for plant in self.plants for group in recorded}
        return {**groups, topics.REFERENCE_LOAD: REFERENCE}


def parse_header(
    path: str, metadata: Mapping[str, Mapping[str, str]], attachments: Mapping[str, bytes]
) -> LogHeader:
    """The header of the log at `path`; raises LogError for a foreign log and one of another version."""
    if OVERLAY in metadata:
        raise LogError(
            f"{path} is an overlay of the runs {metadata[OVERLAY].get('labels')}",
            allowed="logs of one controller and kind of drive",
            remedy="name one of these; info, compare, report, render and log export take overlays too",
        )
    if "cranectl" not in metadata:
        raise LogError(
            f"{path} is an MCAP file, but not of cranectl",
            allowed="logs that cranectl wrote",
            remedy="name such a log, or open the file in a viewer",
        )
    version = str(metadata["cranectl"].get("format"))
    if version not in FORMATS:
        raise LogError(
            f"{path} has log format {version}",
            allowed=f"format {' or '.join(FORMATS)}",
            remedy="write the log again, or read it with the version of cranectl that wrote it",
        )
    try:
        return _read(metadata, attachments)
    except InputError as error:
        raise LogError(
            f"{path}: {error.found}", allowed=error.allowed, remedy="write the log again"
        ) from None
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, RecursionError) as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise LogError(
            f"{path} is not a log this version understands: {reason[:200]}",
            allowed=f"logs of cranectl, format {' or '.join(FORMATS)}",
            remedy="write the log again with this version",
        ) from None


def _read(metadata: Mapping[str, Mapping[str, str]], attachments: Mapping[str, bytes]) -> LogHeader:
    """The header that metadata and attachments make, those of format 2.

    Raises DamageError where it contradicts itself; InputError, KeyError, TypeError, ValueError, IndexError,
    OverflowError or RecursionError where it is no such header.
    """
    declared = metadata["cranectl"]
    asked = parse_settings(Scenario, _json(attachments, "scenario.json"), "scenario.json")
    scenario = with_files(asked, attachments)
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

"""Write and read the header of a log: scenario, design, plants and outcomes of its runs.

Rule of the format number (docs/reference/logs.md): it rises with each change that would make an older reader
misread or refuse a log. Additions that older readers ignore do not raise it. Formats 2 and 3 stay readable.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass
from typing import Any, TypeVar

from mcap.records import Attachment

from cranectl.design import ControllerDesign
from cranectl.log.consistency import MAX_NS, Outcome, Sampling, check_outcome
from cranectl.log.topics import Topics, group_schema
from cranectl.mcap_columns import MAX_DEFINITION, DamageError, McapFile, UnsupportedError
from cranectl.plants import DRIVES, PLANTS, Drive, PlantEntry
from cranectl.scenario import MeasuredScenario, Scenario
from cranectl.signals import Signal, SignalGroup
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import JSON, InputError, LogError, Provenance, Tree

FORMAT, WITHOUT_REFERENCE = "2", "3"  # written for runs with a reference, and for runs without
FORMATS = (FORMAT, WITHOUT_REFERENCE)  # that can be read
GROUPS = "groups.json"  # attachment: the groups of signals of runs without a reference
FILTERED = "keep metadata and attachments: mcap filter --include-metadata --include-attachments"
OVERLAY = "overlay"  # name of the metadata of an overlay: a log with a header for each label
OVERLAY_FORMAT = "1"

T = TypeVar("T")

# The documents that a log attaches, and a remedy for each that is too large.
_SMALLER = "move large data into files that they name"
_REMEDIES = {
    "scenario.json": f"shorten the scenario, or {_SMALLER}",
    "parameters.json": "shorten the description of the rig",
    "design.json": f"shorten the controller's source and its texts, or {_SMALLER}",
}


@dataclass(frozen=True, kw_only=True)
class LogHeader(Sampling):
    """The parsed metadata and attachments of a log."""

    design: ControllerDesign
    drive: Drive
    models: Mapping[str, str]  # the model file or description of each plant
    versions: Mapping[str, str]
    outcomes: Mapping[str, Outcome]  # by plant, if known
    own_groups: tuple[SignalGroup, ...] | None = None  # of runs without a reference
    label: str = ""  # label of a run in an overlay; its topics have it instead of the plant

    @property
    def plants(self) -> tuple[str, ...]:
        """Names of the plants in the order of the log."""
        return tuple(self.models)

    def outcome(self, plant: str) -> Outcome:
        """Return how the run of `plant` ended; raise DamageError if that is missing."""
        if plant not in self.outcomes:
            raise DamageError(f"it does not say how the run of {plant} ended")
        return self.outcomes[plant]

    @property
    def reference_topic(self) -> str:
        """Topic of the reference that the runs follow."""
        return Topics(self.label).reference if self.label else Topics.REFERENCE

    def groups_of(self, plant: str) -> dict[str, SignalGroup]:
        """Return the recorded groups of signals of one plant, by topic."""
        recorded = self.own_groups
        if recorded is None:
            recorded = Run.groups_of(self.scenario, self.design, self.drive)
        return {Topics(self.label or plant).of(group.name): group for group in recorded}

    def groups(self) -> dict[str, SignalGroup]:
        """Return the recorded groups of signals of all plants and the reference, by topic."""
        groups = {topic: group for plant in self.plants for topic, group in self.groups_of(plant).items()}
        return (
            groups if self.own_groups is not None else {**groups, self.reference_topic: SignalGroup.REFERENCE}
        )


def parse_header(file: McapFile, prefix: str = "") -> LogHeader:
    """Make the header from the metadata and attachments of a log whose names begin with `prefix`.

    Plants that are not installed are added to the registry. Raises LogError for an overlay, a log of another
    program or format, and missing metadata. Raises DamageError if the header contradicts itself, and
    UnsupportedError if an attachment is missing.
    """
    path, metadata = file.path, _named(prefix, file.metadata)
    attachments = {name: attached.data for name, attached in _named(prefix, file.attachments).items()}
    if OVERLAY in metadata:
        raise LogError(
            f"{path} is an overlay of the runs {metadata[OVERLAY].get('labels')}",
            allowed="logs of one controller and kind of drive",
            remedy="name one of these; info, compare, report, render and log export take overlays too",
        )
    if "cranectl" not in metadata:
        raise file.foreign()
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


def _named(prefix: str, records: Mapping[str, T]) -> dict[str, T]:
    """Return the records whose names begin with `prefix`, by their names without it."""
    return {name.removeprefix(prefix): record for name, record in records.items() if name.startswith(prefix)}


def _read(metadata: Mapping[str, Mapping[str, str]], attachments: Mapping[str, bytes]) -> LogHeader:
    """Return the header; `parse_header` turns the errors of a contradictory or wrong one into LogError."""
    declared = metadata["cranectl"]
    kind = MeasuredScenario if declared["format"] == WITHOUT_REFERENCE else Scenario
    stated = kind.from_table(_json(attachments, "scenario.json"), "scenario.json")
    scenario = stated.with_files(attachments)
    plants = declared["plants"].split(",")
    if len(set(plants)) < len(plants):
        raise ValueError(f"it has a plant twice: {declared['plants']}")
    for plant in plants:
        if plant not in PLANTS:
            PLANTS.remember(PlantEntry.from_declared(plant, metadata.get(f"plant/{plant}", {})))
    design = _design(_json(attachments, "design.json"))
    if (declared["scenario"], declared["controller"]) != (scenario.name, design.name):
        raise ValueError(f"it names {declared['scenario']} and {declared['controller']}, but attaches others")
    header = LogHeader(
        scenario=scenario,
        design=design,
        drive=DRIVES.checked(declared["drive"]),
        every=_count(declared["every"], least=1),
        models={p: attachments.get(f"{p}.xml", attachments.get(f"{p}.txt", b"")).decode() for p in plants},
        versions=metadata["versions"],
        outcomes={p: _outcome(metadata[f"run/{p}"]) for p in plants if f"run/{p}" in metadata},
        from_ns=_count(metadata["live"]["from_ns"]) if "live" in metadata else None,
        own_groups=_own_groups(attachments) if declared["format"] == WITHOUT_REFERENCE else None,
    )
    for plant, outcome in header.outcomes.items():
        check_outcome(plant, outcome, header)
    return header


def _own_groups(attachments: Mapping[str, bytes]) -> tuple[SignalGroup, ...]:
    groups = _json(attachments, GROUPS)["groups"]
    if not groups:
        raise ValueError(f"{GROUPS} has no groups")
    return tuple(
        SignalGroup(
            str(group["name"]),
            str(group["schema"]),
            str(group["description"]),
            tuple(Signal(*map(str, signal)) for signal in group["signals"]),
        )
        for group in groups
    )


def _outcome(declared: Mapping[str, str]) -> Outcome:
    statuses = {status.label: status for status in RunStatus}
    if declared["status"] not in statuses:
        raise ValueError(f"unknown status '{declared['status']}'")
    return Outcome(statuses[declared["status"]], _count(declared["end_ns"]), _count(declared["samples"]))


def _count(text: str, *, least: int = 0) -> int:
    """Return a number of samples or nanoseconds; raise ValueError for an impossible one."""
    digits = len(str(MAX_NS))
    if not (text.isascii() and text.isdecimal() and len(text) <= digits and least <= int(text) <= MAX_NS):
        raise ValueError(f"'{text[: 2 * digits]}' is not a whole number from {least} to {MAX_NS}")
    return int(text)


def _json(attachments: Mapping[str, bytes], name: str) -> dict[str, Any]:
    if name not in attachments:
        raise UnsupportedError(f"'{name}' is missing, as in filtered logs", FILTERED)
    data = JSON.parse(attachments[name], name)
    if not isinstance(data, dict):
        raise TypeError(f"{name} is not a table")
    return data


def _design(data: dict[str, Any]) -> ControllerDesign:
    """Return the design; raise TypeError or ValueError unless it has all numbers, and writes them again."""
    design = ControllerDesign.from_json(data)
    if design.axis_design is None:
        return design
    for name, value in Tree(data).leaves():
        is_number = type(value) in (int, float) and not math.isnan(value)
        if not (value is None or name == "name" or is_number):
            raise TypeError(f"design.json holds {value!r} where a number belongs")
    declared = design.to_json()
    if any(declared[name] != value for name, value in data.items()):
        raise ValueError("the numbers of design.json contradict each other")
    return design


def outcome_metadata(outcome: Outcome) -> dict[str, str]:
    """Return how a run ended, as the metadata record `run/PLANT`."""
    status, end_ns, samples = outcome.status.label, str(outcome.end_ns), str(outcome.samples)
    return {"status": status, "end_ns": end_ns, "samples": samples}


def file_metadata(runs: Sequence[Run], every: int) -> dict[str, dict[str, str]]:
    """Return the metadata records of a log of these runs, which has every n-th control sample."""
    first = runs[0]
    records = {
        "cranectl": {
            "format": FORMAT if first.has_reference else WITHOUT_REFERENCE,
            "scenario": first.scenario.name,
            "controller": first.design.name,
            "drive": first.drive,
            "plants": ",".join(run.plant for run in runs),
            "every": str(every),
        },
        "versions": Provenance.now(),
    }
    for entry in (PLANTS.entry(run.plant) for run in runs):
        if not entry.is_own:  # so that the log can be read where its package is not installed
            records[f"plant/{entry.name}"] = entry.declared
    return records | {f"run/{run.plant}": outcome_metadata(Outcome.of(run)) for run in runs}


def file_attachments(runs: Sequence[Run]) -> list[Attachment]:
    """Return the attachments of a log: everything needed to repeat the runs."""
    first = runs[0]
    documents = _documents(first.scenario, first.design)
    attached = [(name, "application/json", text.encode()) for name, text in documents.items()]
    for run in runs:
        is_xml = run.model.startswith("<")
        name, kind = ("xml", "application/xml") if is_xml else ("txt", "text/plain")
        attached.append((f"{run.plant}.{name}", kind, run.model.encode()))
    if first.own_groups is not None:
        groups = [
            {**asdict(group), "signals": [astuple(s) for s in group.signals]} for group in first.own_groups
        ]
        attached.append((GROUPS, "application/json", json.dumps({"groups": groups}).encode()))
    files = first.scenario.held_files
    attached += [(name, "application/octet-stream", content) for name, content in files.items()]
    return [Attachment(0, 0, *content) for content in attached]


def _documents(scenario: Scenario, design: ControllerDesign) -> dict[str, str]:
    """Return the JSON documents that a log attaches, by the names of their attachments."""
    tables = (scenario.model_dump(mode="json"), scenario.rig.model_dump(mode="json"), design.to_json())
    texts = (json.dumps(table, indent=2, ensure_ascii=False) for table in tables)
    return dict(zip(_REMEDIES, texts, strict=True))


def check_recordable(scenario: Scenario, design: ControllerDesign, drive: Drive) -> None:
    """Raise InputError if the log of such a run could not be read, before it is computed or written."""
    for group in Run.groups_of(scenario, design, drive):
        size = len(group_schema(group))
        if size > MAX_DEFINITION:
            raise InputError(
                f"the {len(group)} signals that {design.name} logs need a message type of "
                f"{size} bytes in a log",
                allowed=f"at most {MAX_DEFINITION} bytes; a signal takes twice its name and about 20 more",
                remedy="log fewer signals, or give them shorter names",
            )
    for name, text in _documents(scenario, design).items():
        try:
            JSON.parse(text, name)
        except InputError as error:
            raise InputError(
                f"the run of {scenario.name} with {design.name} cannot be logged: {error.found}",
                allowed=error.allowed,
                remedy=_REMEDIES[name],
            ) from None

"""Check before a run that its log can be read: the writer asks the reader's own checks.

Names and descriptions of a controller's signals, the scenario and the design are known before the run.
Whatever the reader would refuse of them is refused here, while nothing has been computed or written.
"""

import json

from mcap.records import Channel, Schema

from cranectl.design import ControllerDesign
from cranectl.log import schema
from cranectl.mcap_columns.records import DamageError
from cranectl.mcap_columns.rows import MAX_DEFINITION, signal_names
from cranectl.plants.plant import Drive
from cranectl.scenario import Scenario
from cranectl.signals import SignalGroup
from cranectl.simulate import groups_of
from cranectl.support.documents import parse_json
from cranectl.support.errors import InputError

# By document that a log attaches, what to do about one that is too large.
_SMALLER = "move large data into files that they name"
_REMEDIES = {
    "scenario.json": f"shorten the scenario, or {_SMALLER}",
    "parameters.json": "shorten the description of the rig",
    "design.json": f"shorten the controller's source and its texts, or {_SMALLER}",
}


def documents_of(scenario: Scenario, design: ControllerDesign) -> dict[str, str]:
    """Return the JSON documents that a log attaches, complete, by the names of their attachments."""
    tables = (scenario.model_dump(mode="json"), scenario.rig.model_dump(mode="json"), design.to_json())
    texts = (json.dumps(table, indent=2, ensure_ascii=False) for table in tables)
    return dict(zip(_REMEDIES, texts, strict=True))


def check_recordable(scenario: Scenario, design: ControllerDesign, drive: Drive) -> None:
    """Raise InputError if no command could read a log of such a run."""
    for group in groups_of(scenario, design, drive):
        _check_group(group, design.name)
    for name, text in documents_of(scenario, design).items():
        try:
            parse_json(text, name)
        except InputError as error:
            raise InputError(
                f"the run of {scenario.name} with {design.name} cannot be logged: {error.found}",
                allowed=error.allowed,
                remedy=_REMEDIES[name],
            ) from None


def _check_group(group: SignalGroup, controller: str) -> None:
    definition = schema.group_schema(group)
    kind = Schema(id=0, name=f"{schema.PACKAGE}.{group.schema}", encoding="protobuf", data=definition)
    topic = Channel(id=0, topic=group.name, message_encoding="protobuf", metadata={}, schema_id=0)
    try:
        signal_names(topic, kind)
    except DamageError:
        raise InputError(
            f"the {len(group)} signals that {controller} logs need a message type of "
            f"{len(definition)} bytes in a log",
            allowed=f"at most {MAX_DEFINITION} bytes; a signal takes twice its name and about 20 more",
            remedy="log fewer signals, or give them shorter names",
        ) from None

"""Classes of information: what a controller declares that it reads of crane and path."""

from collections.abc import Mapping
from typing import Any

from cranectl.controllers.registry import law_digests, load_controller


def information_class(facts: Mapping[str, Any]) -> str:
    """Sum `information` up: what the controller follows and measures, what it knows besides gravity."""
    known = facts["rig"]
    more = {
        "preview": facts["preview"] or facts["reads_path"],
        "masses": known and any("mass" in name for name in known),
        "drives": known and "time_constants" in known,
        "limits": known and "limits" in known,
        "rig not declared": known is None,
    }
    follows = "set points" if facts["follows"] == "set-point" else "path"
    return ", ".join([follows, facts["measures"], *(name for name, there in more.items() if there)])


def information(law: str) -> dict[str, Any]:
    """Return what a controller follows, measures, commands, sees ahead and reads of the rig, as plain data.

    `reads_path`: its numbers are made from all of the path. This and `rig` are None if it does not declare
    what it reads.
    """
    controller = load_controller(law)
    reads = controller.reads
    masses = ["masses"] if controller.command == "force" else []  # by which the loop knows what a force does
    return {
        "follows": controller.follows,
        "measures": controller.measures,
        "commands": controller.command,
        "preview": controller.preview,
        "reads_path": None if reads is None else "path" in reads,
        "every": controller.every,
        "rig": None if reads is None else sorted({*reads} - {"path"}) + masses,
        "file": law_digests([law]).get(f"law {law}", ""),
    }

"""Classes of information: what a law is told of crane and path, found out where that can be."""

from collections.abc import Mapping
from typing import Any

from cranectl.controllers.controller import LawDesign
from cranectl.controllers.registry import controller_design, law_digests, load_controller
from cranectl.design import CONTROLLERS as FLAT_FAMILY
from cranectl.plants.plant import Drive
from cranectl.scenario import Scenario
from cranectl.scenario.effects import EffectNumbers
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import plan_reference
from cranectl.simulate.runner import nominal_crane


class _Watched:
    """A rig that remembers what of it was asked for; of its effects which, such as limits."""

    def __init__(self, rig: RigParameters | EffectNumbers, asked: set[str]) -> None:
        self._rig, self.asked = rig, asked

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._rig, name)
        if isinstance(found, EffectNumbers):
            return _Watched(found, self.asked)
        self.asked.add(name)
        return found


def information_class(facts: Mapping[str, Any]) -> str:
    """Of `information`, in a few words: what it follows and measures, what it knows besides gravity."""
    known = facts["rig"]
    more = {
        "preview": facts["preview"],
        "masses": any("mass" in name for name in known),
        "drives": "time_constants" in known,
        "limits": "limits" in known,
    }
    follows = "set points" if facts["follows"] == "set-point" else "path"
    return ", ".join([follows, facts["measures"], *(name for name, there in more.items() if there)])


def information(law: str, scenario: Scenario, drive: Drive) -> dict[str, Any]:
    """Facts of `law`, plain data: what it follows, measures, commands, sees ahead, knows of the rig."""
    file = {"file": law_digests([law]).get(f"law {law}", "")}
    if law in FLAT_FAMILY:
        own = {"follows": "path", "measures": "state", "commands": "acceleration", "preview": 0}
        return {**own, "every": 1, "rig": ["gravity"], **file}
    controller = load_controller(law)
    design = controller_design(law, scenario)
    assert isinstance(design, LawDesign)  # of what is not of the flat family
    known = nominal_crane(scenario, design, controller, drive, plan_reference(scenario))
    watched = _Watched(known.rig, set())
    controller.prepare(known._replace(rig=watched))  # type: ignore[arg-type]
    masses = ["masses"] if controller.command == "force" else []  # by which the loop knows what a force does
    return {
        "follows": controller.follows,
        "measures": controller.measures,
        "commands": controller.command,
        "preview": controller.preview,
        "every": controller.every,
        "rig": sorted(watched.asked) + masses,
        **file,
    }

"""Classes of information: what a law is told of crane and path, found out where that can be."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cranectl.controllers.controller import Controller, LawDesign, Nominal
from cranectl.controllers.registry import controller_design, law_digests, load_controller
from cranectl.design import CONTROLLERS as FLAT_FAMILY
from cranectl.plants.plant import Drive
from cranectl.scenario import Scenario
from cranectl.scenario.effects import EffectNumbers
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import plan_reference
from cranectl.simulate.runner import nominal_crane
from cranectl.support.arrays import Array


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


class _WatchedPath:
    """A path that remembers whether more of it was asked for than where it begins."""

    def __init__(self, path: Array) -> None:
        self._path, self.asked = path, False

    def __getitem__(self, at: Any) -> Any:
        self.asked |= (at[0] if isinstance(at, tuple) else at) != 0
        return self._path[at]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        self.asked = True
        return np.array(self._path, dtype=dtype, copy=copy)


def _leaves_cold(controller: Controller, known: Nominal, asked: str) -> bool:
    """Whether masses or drives that were asked for change no number: the door of laws in C asks for all."""
    word = next((word for word in ("mass", "time_constant") if word in asked), "")
    if not word:
        return False
    fields = [name for name in RigParameters.model_fields if word in name]
    changed = {name: (1.01 + 0.001 * k) * getattr(known.rig, name) for k, name in enumerate(fields)}
    other = known.rig.model_copy(update=changed)
    pairs = zip(controller.prepare(known), controller.prepare(known._replace(rig=other)), strict=True)
    return all(np.array_equal(one, two) for one, two in pairs)


def information_class(facts: Mapping[str, Any]) -> str:
    """Of `information`, in a few words: what it follows and measures, what it knows besides gravity."""
    known = facts["rig"]
    more = {
        "preview": facts["preview"] or facts["reads_path"],
        "masses": any("mass" in name for name in known),
        "drives": "time_constants" in known,
        "limits": "limits" in known,
    }
    follows = "set points" if facts["follows"] == "set-point" else "path"
    return ", ".join([follows, facts["measures"], *(name for name, there in more.items() if there)])


def information(law: str, scenario: Scenario, drive: Drive) -> dict[str, Any]:
    """Facts of `law`, plain data: what it follows, measures, commands, sees ahead, knows of the rig.

    `reads_path`: its numbers are made from all of the path.
    """
    file = {"file": law_digests([law]).get(f"law {law}", "")}
    if law in FLAT_FAMILY:
        own = {"follows": "path", "measures": "state", "commands": "acceleration", "preview": 0}
        return {**own, "reads_path": False, "every": 1, "rig": ["gravity"], **file}
    controller = load_controller(law)
    design = controller_design(law, scenario)
    assert isinstance(design, LawDesign)  # of what is not of the flat family
    known = nominal_crane(scenario, design, controller, drive, plan_reference(scenario))
    watched = _Watched(known.rig, set())
    path = _WatchedPath(known.reference)
    controller.prepare(known._replace(rig=watched, reference=path))  # type: ignore[arg-type]
    asked = {name for name in watched.asked if not _leaves_cold(controller, known, name)}
    masses = ["masses"] if controller.command == "force" else []  # by which the loop knows what a force does
    return {
        "follows": controller.follows,
        "measures": controller.measures,
        "commands": controller.command,
        "preview": controller.preview,
        "reads_path": path.asked,
        "every": controller.every,
        "rig": sorted(asked) + masses,
        **file,
    }

"""What a controller declares: what it reads of crane and path, and which of its numbers tuning may change.

Those are settings of a scenario, each within bounds, on logarithmic scales. All are numbers on the laboratory
rig; on a similar crane they go by a power of its length, as defaults do.
"""

from collections.abc import Mapping, Sequence
from math import copysign, log
from typing import Any, NamedTuple

from cranectl.controllers.registry import checked_controller, controller_digests, load_controller
from cranectl.scenario.design import DesignSettings
from cranectl.scenario.similarity import rounded, scale_of
from cranectl.support.documents import leaves

TUNED_DIGITS = 4  # of a tuned number: what is printed is what was run


class Variable(NamedTuple):
    """A number that tuning may change."""

    key: str  # dotted setting of a scenario
    start: float  # as it is untuned
    low: float  # bounds of its size, both positive; it keeps the sign of `start`
    high: float
    length_power: float = 0.0

    @property
    def place(self) -> float:
        """Where `start` lies between the bounds, on a logarithmic scale from 0 to 1; at an end if beyond."""
        inside = min(max(abs(self.start), self.low), self.high)
        return log(inside / self.low) / log(self.high / self.low)

    def at(self, position: float) -> float:
        """Return the number at a position from 0 to 1 of the range, to TUNED_DIGITS digits."""
        size = self.low * (self.high / self.low) ** position
        return copysign(float(f"{size:.{TUNED_DIGITS}g}"), self.start)

    def sized(self, value: float, length: float) -> float:
        """Scale `value` to a crane that is `length` times as large as the laboratory rig."""
        scaled = self.length_power and length != 1.0
        return rounded(value * length**self.length_power) if scaled else value


# Of the flat family by part: setting of its designs, bounds. A decade or so to each side of the thesis's.
DESIGNS: dict[str, dict[str, tuple[float, float]]] = {
    "pole-placement": {f"poles.{k}": (0.8, 8.0) for k in range(4)},
    "lqr": {
        "state_weights.0": (30.0, 30_000.0),
        **{f"state_weights.{k}": (0.03, 30.0) for k in (1, 2, 3)},
    },
    "hinf": {"hinf.bandwidth": (0.2, 4.0), "hinf.offset": (0.01, 0.5), "hinf.control_weight": (1e-6, 1e-2)},
    "loop-shaping": {"loop_shaping.proportional": (2.0, 200.0), "loop_shaping.integral": (8.0, 800.0)},
}


def variables_of(name: str) -> tuple[Variable, ...]:
    """Return what tuning may change of the controller `name`; raise InputError for an unknown one."""
    controller = load_controller(checked_controller(name))
    if controller.axis_design is not None:
        usual = dict(leaves({"design": DesignSettings().model_dump()}))
        bounds = {f"design.{key}": ends for part in name.split("+") for key, ends in DESIGNS[part].items()}
        return tuple(Variable(key, usual[key], *ends, scale_of(key).length) for key, ends in bounds.items())
    return tuple(
        Variable(
            f"controller.{name}.{parameter.name}",
            float(parameter.default),
            *parameter.search,
            parameter.length_power,
        )
        for parameter in controller.parameters
        if parameter.search is not None
    )


def assignments(variables: Sequence[Variable], values: Sequence[float], length: float = 1.0) -> list[str]:
    """Return settings `key=value` of a scenario that give `variables` their `values`.

    Variables at their start value are left out.

    `variables` are all of a controller, on a crane `length` times as large as the laboratory rig. A list is
    given as a whole.
    """
    sized = {
        variable.key: variable.sized(value, length) for variable, value in zip(variables, values, strict=True)
    }
    lists: dict[str, list[float]] = {}
    for key, value in sized.items():
        above, _, last = key.rpartition(".")
        if last.isdecimal():
            lists.setdefault(above, []).append(value)
    changed = [
        variable.key for variable, value in zip(variables, values, strict=True) if value != variable.start
    ]
    places = dict.fromkeys(above if (above := key.rpartition(".")[0]) in lists else key for key in changed)
    return [f"{key_path}={lists.get(key_path, sized.get(key_path))!r}" for key_path in places]


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


def information(name: str) -> dict[str, Any]:
    """Return what a controller follows, measures, commands, sees ahead and reads of the rig, as plain data.

    `reads_path`: its numbers are made from all of the path. This and `rig` are None if it does not declare
    what it reads.
    """
    controller = load_controller(name)
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
        "file": controller_digests([name]).get(f"law {name}", ""),
    }

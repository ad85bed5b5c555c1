"""Read what a controller declares: its information about crane and path, and its numbers that can be tuned.

The numbers are settings of a scenario, with bounds and a logarithmic scale. They hold on the laboratory rig;
on a similar crane each is scaled by a power of the crane's relative length, as defaults are.
"""

from collections.abc import Mapping, Sequence
from math import copysign, log
from typing import Any, NamedTuple

from cranectl.controllers.registry import checked_controller, controller_digests, load_controller
from cranectl.scenario.design import DesignSettings
from cranectl.scenario.similarity import rounded, scale_of
from cranectl.support.documents import leaves

TUNED_DIGITS = 4  # digits of a tuned number, so that the printed number is the one that was run


class Variable(NamedTuple):
    """A number that tuning may change."""

    key: str  # dotted setting of a scenario
    start: float  # value without tuning
    low: float  # bounds of its absolute value, both positive; it keeps the sign of `start`
    high: float
    length_power: float = 0.0

    @property
    def start_position(self) -> float:
        """Position of `start` between the bounds, on a logarithmic scale from 0 to 1; clipped to them."""
        inside = min(max(abs(self.start), self.low), self.high)
        return log(inside / self.low) / log(self.high / self.low)

    def at(self, position: float) -> float:
        """Return the number at a position from 0 to 1 between the bounds, to TUNED_DIGITS digits."""
        size = self.low * (self.high / self.low) ** position
        return copysign(float(f"{size:.{TUNED_DIGITS}g}"), self.start)

    def sized(self, value: float, length: float) -> float:
        """Scale `value` to a crane `length` times as large as the laboratory rig."""
        scaled = self.length_power and length != 1.0
        return rounded(value * length**self.length_power) if scaled else value


# Bounds of the flat family's settings, by design: about a decade to each side of the thesis's values.
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
    """Return the numbers of the controller `name` that tuning may change; raise InputError if unknown."""
    controller = load_controller(checked_controller(name))
    if controller.axis_design is not None:
        default = dict(leaves({"design": DesignSettings().model_dump()}))
        bounds = {f"design.{key}": ends for part in name.split("+") for key, ends in DESIGNS[part].items()}
        return tuple(Variable(key, default[key], *ends, scale_of(key).length) for key, ends in bounds.items())
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
    """Return settings `key=value` of a scenario that give a controller's `variables` their `values`.

    The crane is `length` times as large as the laboratory rig. Variables at their start value are left out,
    except in a list, which is stated whole.
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
    keys = dict.fromkeys(above if (above := key.rpartition(".")[0]) in lists else key for key in changed)
    return [f"{key}={lists.get(key, sized.get(key))!r}" for key in keys]


def information_class(facts: Mapping[str, Any]) -> str:
    """Summarise `information` in one phrase: what the controller follows, measures and knows."""
    known = facts["rig"]
    more = {
        "preview": facts["preview"] or facts["reads_path"],
        "masses": known and any("mass" in name for name in known),
        "drives": known and "time_constants" in known,
        "limits": known and "limits" in known,
        "rig not declared": known is None,
    }
    follows = "set points" if facts["follows"] == "set-point" else "path"
    return ", ".join([follows, facts["measures"], *(name for name, is_known in more.items() if is_known)])


def information(name: str) -> dict[str, Any]:
    """Return what a controller follows, measures, commands, previews and reads of the rig, as plain data.

    `reads_path` is True if its design uses the whole path. `reads_path` and `rig` are None if the controller
    does not declare what it reads.
    """
    controller = load_controller(name)
    reads = controller.reads
    masses = ["masses"] if controller.command == "force" else []  # the loop needs them to interpret a force
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

"""Read what a controller declares: its information about crane and path, and the numbers that tuning changes.

The numbers are settings of a scenario, with bounds and a logarithmic scale. They hold on the laboratory rig.
On a similar crane each is scaled by a power of the crane's relative length, as defaults are.
"""

import ast
from collections.abc import Iterator, Mapping, Sequence
from math import copysign, log
from typing import Any, NamedTuple

from cranectl.controllers import ALL_CONTROLLERS
from cranectl.scenario import DesignSettings, Scaled
from cranectl.support import Tree
from cranectl.tools.benchmark.settings import Benchmark

TUNED_DIGITS = 4  # digits of a tuned number, so that the printed number is the one that was run


class Variable(NamedTuple):
    """A number that tuning may change."""

    key: str  # dotted setting of a scenario
    start: float  # value without tuning
    low: float  # bounds of the absolute value, both positive; the sign is that of `start`
    high: float
    length_power: float = 0.0  # power of the crane's relative length by which the number scales

    @property
    def start_position(self) -> float:
        """Position of `start` between the bounds, from 0 to 1 on a logarithmic scale; clipped to them."""
        clipped = min(max(abs(self.start), self.low), self.high)
        return log(clipped / self.low) / log(self.high / self.low)

    def value_at(self, position: float) -> float:
        """Return the value at a position from 0 to 1 between the bounds, with TUNED_DIGITS digits."""
        size = self.low * (self.high / self.low) ** position
        return copysign(float(f"{size:.{TUNED_DIGITS}g}"), self.start)

    def scale(self, value: float, length: float) -> float:
        """Scale `value` to a crane `length` times as large as the laboratory rig."""
        return Scaled(self.length_power).sized(value, length)


# Bounds of the flat family's settings, by design: about a tenth to ten times the thesis's values, and wider
# where a narrower search ended at its bound.
DESIGN_BOUNDS: dict[str, dict[str, tuple[float, float]]] = {
    "pole-placement": {f"poles.{k}": (0.8, 24.0) for k in range(4)},
    "lqr": {
        "state_weights.0": (30.0, 100_000.0),
        "state_weights.1": (0.03, 100.0),
        "state_weights.2": (0.03, 30.0),
        "state_weights.3": (0.01, 30.0),
    },
    "hinf": {"hinf.bandwidth": (0.2, 4.0), "hinf.offset": (0.01, 0.5), "hinf.control_weight": (1e-6, 1e-2)},
    "loop-shaping": {"loop_shaping.proportional": (2.0, 600.0), "loop_shaping.integral": (8.0, 2400.0)},
}


def variables_of(name: str) -> tuple[Variable, ...]:
    """Return the numbers of the controller `name` that tuning may change; raise InputError if unknown."""
    controller = ALL_CONTROLLERS[ALL_CONTROLLERS.checked(name)]
    if controller.axis_design is not None:
        default = dict(Tree(DesignSettings().model_dump()).leaves())
        bounds = {key: ends for part in name.split("+") for key, ends in DESIGN_BOUNDS[part].items()}
        return tuple(
            Variable(f"design.{key}", default[key], *ends, DesignSettings.scale_of(key).length)
            for key, ends in bounds.items()
        )
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
    """Return settings `key=value` of a scenario that set a controller's `variables` to `values`.

    The values hold on the laboratory rig, and are scaled to a crane `length` times as large. Variables at
    their start value are omitted, except in a list, which is complete.
    """
    scaled = {
        variable.key: variable.scale(value, length) for variable, value in zip(variables, values, strict=True)
    }
    lists: dict[str, list[float]] = {}
    for key, value in scaled.items():
        parent, _, last = key.rpartition(".")
        if last.isdecimal():
            lists.setdefault(parent, []).append(value)
    changed = [
        variable.key for variable, value in zip(variables, values, strict=True) if value != variable.start
    ]
    keys = dict.fromkeys(parent if (parent := key.rpartition(".")[0]) in lists else key for key in changed)
    return [f"{key}={lists.get(key, scaled.get(key))!r}" for key in keys]


def information_class(facts: Mapping[str, Any]) -> str:
    """Summarise `facts` of `information` in a phrase: what the controller follows, measures and knows."""
    rig = facts["rig"]
    further = {
        "preview": facts["preview"] or facts["reads_path"],
        "masses": rig and any("mass" in name for name in rig),
        "drives": rig and "time_constants" in rig,
        "limits": rig and "limits" in rig,
        "rig not declared": rig is None,
    }
    follows = "set points" if facts["follows"] == "set-point" else "path"
    return ", ".join([follows, facts["measures"], *(name for name, is_known in further.items() if is_known)])


def information(name: str) -> dict[str, Any]:
    """Return what a controller follows, measures, commands, previews and reads of the rig, as plain data.

    `reads_path` is True if its design uses the whole path. `reads_path` and `rig` are None if the controller
    does not declare what it reads.
    """
    controller = ALL_CONTROLLERS[name]
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
        "file": ALL_CONTROLLERS.digests([name]).get(f"law {name}", ""),
    }


def controller_files(benchmark: Benchmark) -> dict[str, str]:
    """Return, by the name of a controller, its file as `benchmark` names it; the files are read, not run."""
    files: dict[str, str] = {}
    for entry in benchmark.laws:
        path, _, symbol = entry.partition(":")
        if symbol and (benchmark.file.parent / path).is_file():
            tree = ast.parse((benchmark.file.parent / path).read_bytes())
            files |= dict.fromkeys(_names_in(tree, symbol), entry)
    return files


def _names_in(tree: ast.Module, symbol: str) -> Iterator[str]:
    """Yield the name of the controller that a module assigns to `symbol`: its first text, or `name=`."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
            targets = [target.id for target in node.targets if isinstance(target, ast.Name)]
            values = [word.value for word in node.value.keywords if word.arg == "name"] or node.value.args[:1]
            if symbol in targets and values and isinstance(values[0], ast.Constant):
                yield str(values[0].value)

"""The rig that a user's model in MJCF has, as the lines of a rig file."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cranectl import plants
from cranectl import scenario as scenario_files

if TYPE_CHECKING:
    from cranectl.scenario import RigParameters

MIN_LIMIT = 1e-6  # the smallest limit that a rig can state
ASSUMED = "  # assumed, since the model limits it nowhere"


def model_settings(file: Path, rig: "RigParameters") -> dict[str, dict[str, Any]]:
    """Return fixed axes, numbers, limits, ranges and assumed ranges of a model, with the names in `rig`.

    Raises InputError if `file` is no such crane.
    """
    own = plants.open_model(file, rig.model_names)
    ranges, assumed = (
        {name: [float(f"{end:g}") for end in ends] for name, ends in found.items()}
        for found in plants.axis_ranges(own)
    )
    fixed = rig.model_dump(include={"axes", "rope"})  # empty if all axes move
    # To be copied. Only a trolley's motor may have no mass, and then needs no line.
    numbers = {name: float(f"{number:g}") for name, number in own.built_in.items() if number}
    return {
        "fixed": fixed,
        "numbers": numbers,
        "effects": {"effects.delay.seconds": own.delay} if own.delay else {},
        "limits": _drive_limits(own),
        "ranges": ranges,
        "assumed": assumed,
    }


def _drive_limits(own: Any) -> dict[str, list[float]]:
    """Return velocities and forces of the drives of a model that limits some of them."""
    none = scenario_files.DriveLimits.NO_LIMIT
    return {
        f"effects.limits.{kind}": [max(float(f"{limits.get(axis, none):g}"), MIN_LIMIT) for axis in range(3)]
        for kind, limits in plants.drive_limits(own).items()
        if limits
    }


def rig_lines(
    path: str, rig: "RigParameters", settings: dict[str, dict[str, Any]], *, all_names: bool = False
) -> Iterator[str]:
    """Yield what a rig file says of a model: its `path`, its settings, and names other than the default.

    `settings` are those of `model_settings`. With `all_names` the default names are told too.
    """
    yield f"model = {_quoted(path)}"
    for part, values in settings.items():
        for name, value in values.items():
            text = f"{value:g}" if isinstance(value, float) else json.dumps(value)
            if name.startswith("effects.limits"):
                text = f"[{', '.join(f'{number:g}' for number in value)}]"  # 1e+09 is no limit
            yield f"{name} = {text}{ASSUMED * (part == 'assumed')}"
    fields = type(rig.model_names).model_fields
    named = [(k, name) for k, name in rig.model_names if name and (all_names or name != fields[k].default)]
    yield from ("", "[plant.names]") if named else ()
    yield from (f"{key} = {_quoted(name)}" for key, name in named)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)

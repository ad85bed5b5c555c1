"""The rig that a user's model in MJCF has, as the lines of a rig file."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cranectl import plants

if TYPE_CHECKING:
    from cranectl.scenario import RigParameters

ASSUMED = "  # assumed, since the model limits it nowhere"


def model_settings(file: Path, rig: "RigParameters") -> dict[str, dict[str, Any]]:
    """Return fixed axes, numbers, ranges and assumed ranges of the model in `file`, with the names in `rig`.

    Raises InputError if it is no such crane.
    """
    own = plants.open_model(file, rig.model_names)
    ranges, assumed = (
        {name: [float(f"{end:g}") for end in ends] for name, ends in found.items()}
        for found in plants.axis_ranges(own)
    )
    return {
        "fixed": rig.model_dump(include={"axes", "rope"}),  # empty if all axes move
        # To be copied. Only a trolley's motor may have no mass, and then needs no line.
        "numbers": {name: float(f"{number:g}") for name, number in own.built_in.items() if number},
        "effects": {"effects.delay.seconds": own.delay} if own.delay else {},
        "ranges": ranges,
        "assumed": assumed,
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
            yield f"{name} = {text}{ASSUMED * (part == 'assumed')}"
    fields = type(rig.model_names).model_fields
    named = [(k, name) for k, name in rig.model_names if name and (all_names or name != fields[k].default)]
    yield from ("", "[plant.names]") if named else ()
    yield from (f"{key} = {_quoted(name)}" for key, name in named)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)

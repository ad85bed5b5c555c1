"""Numbers of rig, effects and start on which a compiled plant depends, and its memory as they make it.

A number becomes a parameter if the plant depends on it by sums, products and quotients alone. C code can then
do what Python does when it makes the plant anew. Any other number stays a constant, for example one that
decides how far a rope is stretched at the start.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.plants import PLANTS, Drive, PhysicsStep, Plant
from cranectl.scenario import NANOSECONDS, Scenario, Settings
from cranectl.signals import SignalGroup
from cranectl.support import Array, Block
from cranectl.tools.export.description import FmuVariable
from cranectl.tools.export.traced import Traced

START = "start"  # prefix of the names of numbers of the state at the start


class Memory(NamedTuple):
    """The memory of a compiled plant: the block of its handle, then its arrays."""

    words: list[int]
    addresses: tuple[int, ...]  # places of addresses in it; there it has the places of arrays


class PlantNumbers:
    """A plant that is made with other numbers, which have the names of settings; lists count from 1."""

    def __init__(self, scenario: Scenario, plant: str, drive: Drive, start: Array) -> None:
        """Prepare the plant of `scenario` that starts at the state `start` (10,)."""
        self.scenario, self.drive, self.start = scenario, drive, start
        self.make_plant = PLANTS.entry(plant).load()
        effects = scenario.effects
        groups = [
            ("rig", scenario.rig),
            *((f"effects.{name}", getattr(effects, name)) for name in effects.names),
        ]
        known = [variable for prefix, settings in groups for variable in _variables(prefix, settings)]
        for signal, number in zip(SignalGroup.STATE.signals, start.tolist(), strict=True):
            variable = FmuVariable.of_signal(f"{START}.{signal.name}", "parameter", signal, number)
            known.append(variable._replace(description=f"at the start: {signal.description}"))
        self.known = {variable.name: variable for variable in known}

    def plant(self, numbers: Mapping[str, Any]) -> Plant:
        """Return the plant made with other numbers of rig and effects."""
        effects, steps = self.scenario.effects, PhysicsStep(self.scenario, self.drive).per_period
        parts = {
            name: _replaced(getattr(effects, name), f"effects.{name}", numbers) for name in effects.names
        }
        return self.make_plant(
            _replaced(self.scenario.rig, "rig", numbers),
            drive=self.drive,
            step=self.scenario.period_ns / NANOSECONDS / steps,
            substeps=steps,
            effects=effects.model_copy(update=parts).in_air,
        )

    def memory(self, numbers: Mapping[str, float]) -> Memory:
        """Return the memory of the plant at the start, made with other numbers."""
        plant, start = self.plant(numbers), self.start.copy()
        for k, name in enumerate(SignalGroup.STATE.names):
            start[k] = numbers.get(f"{START}.{name}", start[k])
        plant.reset(start)
        words: list[int] = []
        arrays: dict[int, NDArray[Any]] = {}
        for place, leaf in Block.places(plant.handle):
            if isinstance(leaf, np.ndarray):
                arrays[place] = leaf
                words += (0, *leaf.shape, *leaf.strides)
            else:
                words.append(_bits(leaf))
        for place, array in arrays.items():
            words[place] = len(words)
            content = array.tobytes()
            padded = content.ljust(-(-len(content) // 8) * 8, b"\0")
            words += np.frombuffer(padded, dtype=np.uint64).tolist()
        return Memory(words, tuple(arrays))

    def expressions(self, numbers: Mapping[str, Traced]) -> dict[int, Traced]:
        """Return the numbers of the memory that `numbers` decide, by place.

        Raises TypeError if one of them takes part in more than sums, products and quotients.
        """
        handle = self.plant(numbers).handle
        leaves_by_place = dict(Block.places(handle))
        found = {place: leaf for place, leaf in leaves_by_place.items() if isinstance(leaf, Traced)}
        state = next(place for place, leaf in leaves_by_place.items() if leaf is handle.state)
        first = self.memory({}).words[state]
        for k, name in enumerate(SignalGroup.STATE.names):
            number = numbers.get(f"{START}.{name}")
            if number is not None:  # a number that is 0 is false
                found[first + k] = number
        return found

    def sorted_out(self) -> tuple[list[FmuVariable], list[FmuVariable]]:
        """Return the numbers that can be parameters, and the others on which the plant depends."""
        parameters, constants, memory = [], [], self.memory({})
        for name, variable in self.known.items():
            other = variable.start + max(0.25 * abs(variable.start), 0.01)
            changed = self.memory({name: other})
            if memory == changed:
                continue
            if self._is_followed(memory, changed, name, other):
                parameters.append(variable)
            else:
                constants.append(variable._replace(causality="constant"))
        return parameters, constants

    def _is_followed(self, memory: Memory, changed: Memory, name: str, value: float) -> bool:
        """Return True if expressions of one number give the memory that has changed with it."""
        try:
            expressions = self.expressions({name: Traced(value, "")})
        except TypeError:
            return False
        words = memory.words.copy()
        for place, number in expressions.items():
            words[place] = _bits(number.value)
        return memory._replace(words=words) == changed


def _variables(prefix: str, settings: Settings) -> Iterator[FmuVariable]:
    """Yield the numbers with a fraction of some settings, with unit and bounds."""
    schema = type(settings).model_json_schema()["properties"]
    for name, field in type(settings).model_fields.items():
        value, (text, unit) = getattr(settings, name), _text_and_unit(field.description or name)
        numbers = {f"{prefix}.{name}": (value, schema[name])}
        if isinstance(value, tuple):
            pairs = zip(value, schema[name].get("prefixItems", ()), strict=False)
            numbers = {f"{prefix}.{name}[{k}]": pair for k, pair in enumerate(pairs, 1)}
        for key, (number, bounds) in numbers.items():
            if isinstance(number, float):
                lowest, highest = bounds.get("minimum"), bounds.get("maximum")
                yield FmuVariable(key, "parameter", unit, text, number, lowest, highest)


def _text_and_unit(description: str) -> tuple[str, str]:
    """Return what the description of a field says of its number, and its unit."""
    text = description.partition(";")[0]
    unit = re.search(r" *\[([^]]+)]", text)
    return (text.replace(unit[0], ""), unit[1]) if unit else (text, "1")


def _replaced(settings: Any, prefix: str, numbers: Mapping[str, Any]) -> Any:
    """Return a copy of settings with other numbers, unchecked."""
    update = {}
    for name in type(settings).model_fields:
        value, key = getattr(settings, name), f"{prefix}.{name}"
        if isinstance(value, tuple):
            update[name] = tuple(numbers.get(f"{key}[{k + 1}]", number) for k, number in enumerate(value))
        elif key in numbers:
            update[name] = numbers[key]
    return settings.model_copy(update=update)


def _bits(number: float) -> int:
    """Return the 8 bytes of a number as an integer."""
    kind: Any = np.float64 if isinstance(number, float | np.floating) else np.int64
    return int(np.array(number, dtype=kind).view(np.uint64))

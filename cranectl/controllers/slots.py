"""Name the parts of a controller's parameters and memory: offsets, initial numbers and logged signals.

    MEMORY = Slots(error=3, begun=1)

    def step(parameters, measured, reference, memory, command):
        memory[MEMORY.error + axis] = ...        # MEMORY.error is 0, MEMORY.begun is 3, MEMORY.size is 4

Offsets are integers in a tuple, which Numba treats as constants in compiled code.
"""

from collections.abc import Iterable
from itertools import accumulate
from typing import Any

import numpy as np

from cranectl.controllers.controller import Logged
from cranectl.signals import Signal
from cranectl.support import Array

RESERVED = ("size", "array", "logged", "count", "index")  # attributes with another meaning


class Slots(tuple[int, ...]):
    """Offsets of named slots in a flat array, each as an attribute, and the `size` of the array.

    Parameters
    ----------
    **sizes : int
        How many numbers each slot has, in order. The last may have 0; then `array` sets its size.
    """

    _fields: tuple[str, ...] = ()  # with it Numba reads attributes as of a named tuple

    def __new__(cls, **sizes: int) -> "Slots":
        """Raise ValueError for a reserved name, and for a size that is not a positive integer."""
        for place, (name, size) in enumerate(sizes.items(), 1):
            if name in RESERVED or name.startswith("_"):
                raise ValueError(f"a slot named '{name}', which must be none of {', '.join(RESERVED)}, _...")
            if not isinstance(size, int) or size < (place < len(sizes)):  # only the last may have 0
                raise ValueError(f"the slot '{name}' has {size} numbers, it must have 1 or more")
        kind = type("Slots", (cls,), {"_fields": (*sizes, "size")})
        return tuple.__new__(kind, accumulate(sizes.values(), initial=0))

    def __getattr__(self, name: str) -> int:
        """Return the offset of a slot."""
        if name in self._fields:
            return self[self._fields.index(name)]
        raise AttributeError(f"there is no slot '{name}', there are {', '.join(self._fields[:-1])}")

    def _asdict(self) -> dict[str, int]:
        """Return offsets by name; Numba takes a tuple with this method for a named tuple."""
        return dict(zip(self._fields, self, strict=True))

    def array(self, **values: Any) -> Array:
        """Return the flat array with the numbers of each slot in `values`, zeros in all other slots.

        Raises ValueError for an unknown slot, and for a wrong number of values.
        """
        if unknown := set(values) - set(self._fields[:-1]):
            raise ValueError(f"no slot '{min(unknown)}', there are {', '.join(self._fields[:-1])}")
        parts = []
        for name, start, end in zip(self._fields, self, self[1:], strict=False):  # without the field `size`
            numbers = np.asarray(values.get(name, np.zeros(end - start)), dtype=float).ravel()
            if len(numbers) != end - start and end != start:
                raise ValueError(f"{len(numbers)} numbers for the slot '{name}', which has {end - start}")
            parts.append(numbers)
        return np.concatenate(parts)

    def logged(self, **signals: Iterable[Signal]) -> tuple[Logged, ...]:
        """Return the numbers that are recorded: the first ones of each slot, one for each of its signals."""
        return tuple(
            Logged(getattr(self, name) + k, signal)
            for name, of_slot in signals.items()
            for k, signal in enumerate(of_slot)
        )


def per_axis(name: str, symbol: str, unit: str, description: str, axes: str = "xy") -> tuple[Signal, ...]:
    """Return a signal for each letter of `axes`; the letter ends its name, symbol and description."""
    return tuple(Signal(f"{name}_{a}", f"{symbol}_{a}", unit, f"{description}, {a}") for a in axes)

"""Tell where each number of a rig comes from: a file, the size of the crane, or the laboratory rig."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cranectl.scenario.effects import NO_EFFECTS
from cranectl.scenario.load import rig_files, rig_table
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.settings import describe, override
from cranectl.scenario.similarity import scale_of
from cranectl.support import InputError, Shipped, Tree

SCALED, ASSUMED = "scaled", "assumed"
OF_DRAWINGS = ("look.", "plant.", "model")  # told only where they are stated


class RigNumber(NamedTuple):
    """A number or list of a rig, and where it comes from."""

    name: str  # dotted, as in a rig file
    value: Any
    origin: str  # SCALED, ASSUMED, or what states it: a file, a shipped rig, --set
    meaning: str

    @property
    def is_stated(self) -> bool:
        """Whether somebody states the number."""
        return self.origin not in (SCALED, ASSUMED)


class RigOrigins(NamedTuple):
    """A rig with the origin of its numbers, and the factors by which those that nobody states are scaled."""

    rig: RigParameters  # the rig
    numbers: tuple[RigNumber, ...]  # its numbers, each with its origin
    length: float  # size over the laboratory rig's
    mass: float  # mass over the laboratory rig's

    @property
    def stated(self) -> int:
        """How many numbers a file or `--set` states."""
        return sum(number.is_stated for number in self.numbers)

    @property
    def scaled(self) -> int:
        """How many numbers are scaled to the size of the crane."""
        return sum(number.origin == SCALED for number in self.numbers)

    @property
    def assumed(self) -> int:
        """How many numbers are those of the laboratory rig."""
        return sum(number.origin == ASSUMED for number in self.numbers)

    @classmethod
    def read(cls, name_or_path: str | Path, overrides: Sequence[str] = ()) -> "RigOrigins":
        """Return a rig by its name or path, changed by `overrides`, with the origin of each number.

        Raises InputError for a rig that runs refuse, and for overrides of anything else.
        """
        for assignment in overrides:
            if not assignment.startswith("rig."):
                raise InputError(
                    f"--set {assignment} of a rig",
                    allowed="numbers of the rig, such as rig.load_mass=2.5",
                    remedy="leave this --set out",
                )
        whole = rig_table(name_or_path)
        table = override({"rig": whole}, overrides)["rig"]
        rig = RigParameters.from_table(table, str(name_or_path))
        rig.check_size(NO_EFFECTS)
        length = whole["rope_range"][1] / RigParameters().rope_range[1]
        mass = whole["rated_load"] / RigParameters().rated_load
        stated = _stated(name_or_path)
        stated |= {text.partition("=")[0].strip().removeprefix("rig."): "--set" for text in overrides}
        numbers = []
        for name, value in Tree(rig.model_dump(mode="json")).leaves(is_leaf=_is_number):
            is_scaled = bool(np.any(value)) and _is_scaled(name, length, mass)
            origin = _origin(name, stated) or (SCALED if is_scaled else ASSUMED)
            number = RigNumber(name, value, origin, "")
            if number.is_stated or not name.startswith(OF_DRAWINGS):
                numbers.append(number._replace(meaning=_meaning(name, stated=number.is_stated)))
        return cls(rig, tuple(numbers), length, mass)


def _stated(name_or_path: str | Path) -> dict[str, str]:
    """Return what states each number of a rig, by dotted name."""
    files = [*rig_files(name_or_path)][::-1]
    stated = {"rated_load": "load_mass"} if "load_mass" in files[0][1] else {}  # as `rig_table` takes it
    for path, table in files:
        source = path.stem if path.parent == Shipped.RIGS.folder else str(path)
        stated |= dict.fromkeys((name for name, _ in Tree(table).leaves(is_leaf=_is_number)), source)
    return stated


def _is_number(value: Any) -> bool:
    """Return True unless a value is a table; lists are shown as wholes."""
    return not isinstance(value, dict)


def _origin(name: str, stated: Mapping[str, str]) -> str:
    """Return the last of `stated` that is `name`, a table of it or an entry of it; or an empty text."""
    found = [
        of for key, of in stated.items() if f"{name}.".startswith(f"{key}.") or key.startswith(f"{name}.")
    ]
    return found[-1] if found else ""


def _is_scaled(name: str, length: float, mass: float) -> bool:
    """Return True if a number, or one in a list, is larger or smaller on a crane of this size."""
    scales = map(scale_of, (name, *(f"{name}.{k}" for k in range(3))))
    return any(scale.factor(length, mass) != 1.0 for scale in scales)


def _meaning(name: str, *, stated: bool) -> str:
    """Return what a number is, and unless it is stated the reason for its value."""
    meaning = describe(RigParameters, name.split("."))
    return meaning.partition(";")[0].partition("assumed:")[0].strip() if stated else meaning

"""Convert the units of FMU variables to SI, by the FMU's own definitions of units."""

import re
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

from cranectl.loaders import ControllerFile
from cranectl.signals import SignalGroup
from cranectl.support import InputError

# Exponents of kg, m and s in the units of signals; an angle counts as a number, as in SI.
DIMENSIONS = {"m": (0, 1, 0), "rad": (0, 0, 0), "N": (1, 1, -2)}
DIMENSIONS |= {f"m/s{n}": (0, 1, -k) for k, n in enumerate(("", "²", "³", "⁴"), 1)}
DIMENSIONS |= {"rad/s": (0, 0, -1), "rad/s²": (0, 0, -2)}
OTHERS = ("A", "K", "mol", "cd")  # no signal has a unit with these
_POWERS = str.maketrans("²³⁴", "234")


class Conversion(NamedTuple):
    """The units that an FMU and the table beside it define for exchanged variables."""

    file: ControllerFile
    source: str  # the TOML file beside the FMU
    definitions: Mapping[str, Any]  # unit definitions of FMPy, by name of the unit
    stated: Mapping[str, float]  # units from that table, by name of the variable

    def factor(self, variable: Any, unit: str, signal: str) -> float:
        """Return how many `unit` of `signal` one unit of the FMU's variable is.

        Raises InputError for a unit of another kind, or one that the FMU does not define.
        """
        if variable.name in self.stated:
            return self.stated[variable.name]
        unit_name = variable.unit or getattr(variable.declaredType, "unit", None) or ""
        if not unit_name or _plain(unit_name) == _plain(unit):
            return 1.0
        base = getattr(self.definitions.get(unit_name), "baseUnit", None)
        if base is None:
            raise self._wrong(variable, f"in '{unit_name}', which it does not define", unit, signal)
        dimensions = tuple(getattr(base, name) for name in ("kg", "m", "s"))
        if dimensions != DIMENSIONS[unit] or any(getattr(base, name) for name in OTHERS):
            raise self._wrong(variable, f"in '{unit_name}', no unit of this kind", unit, signal)
        if base.offset or not (isfinite(base.factor) and base.factor > 0.0):
            scale = f"{base.factor:g} {unit} and an offset of {base.offset:g}"
            raise self._wrong(variable, f"in '{unit_name}', defined as {scale}", unit, signal)
        return float(base.factor)

    def check_stated(self, variables: Sequence[Any]) -> None:
        """Raise InputError for a unit stated of a variable that is not exchanged."""
        names = [variable.name for variable in variables]
        for name, value in self.stated.items():
            if name not in names:
                raise InputError(
                    f"{self.source}: units: {name} is no variable that a signal is connected to",
                    allowed=", ".join(names),
                    remedy="correct the name, or leave the line out",
                )
            if not (isfinite(value) and value != 0.0):
                raise InputError(
                    f"{self.source}: units: {name} = {value:g}",
                    allowed="how many SI units one unit is, finite and not 0",
                    remedy="give the SI value of one unit, 0.001 for mm",
                )

    def _wrong(self, variable: Any, what: str, unit: str, signal: str) -> InputError:
        name = variable.name
        found = f"{self.file.reference}: {variable.causality} '{name}' is {what}; {signal} is in {unit}"
        for kind in ("acceleration", "velocity", "force") if signal.startswith("command.") else ():
            if _plain(SignalGroup.command(kind).signals[0].unit) == _plain(variable.unit or ""):
                return InputError(
                    found,
                    allowed=f"{unit}, or a table beside the FMU that says what it commands",
                    remedy=f"write command = '{kind}' into {self.source}",
                )
        return InputError(
            found,
            allowed=f"{unit}, or a unit that the FMU defines by it",
            remedy=f"say in {self.source} how many {unit} one unit is: [units] '{name}' = 1.0",
        )


def _plain(unit: str) -> str:
    """Return a unit in one spelling: people and tools write m/s², m/s2, m/s^2, m/s**2 or m.s-2."""
    text = re.sub(r"\s|\^|\*\*|[()]", "", unit.translate(_POWERS))
    return re.sub(r"[.·*]s-(\d)", lambda power: f"/s{power[1].removeprefix('1')}", text)

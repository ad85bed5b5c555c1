"""Show values with SI prefixes: 0.0123 m as 12.3 mm, with one unit for a column or an axis."""

import math
import re
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from typing import ClassVar

PREFIXES = {6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p"}  # by power of ten
FORCES = ("N", "Nm", "J", "W")  # thousands of these are shown as k; a path of 1200 m is not 1.2 km
PLAIN = ("°", "1", "%", "", "kg")  # units without a prefix
PREFIXED = re.compile(r"[cdhkMmµun](m|s|g|N|rad|A|V|W|J|Pa|Hz)\b")  # nor do those that have one, as mm
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number with its unit, and its texts."""

    value: float  # in `unit`
    unit: str = ""  # of the value, such as m/s; empty for a pure number

    PROCESSOR_ROUNDING: ClassVar = 1e-9  # m, rad, N, ...: smaller differences between runs depend on it

    def scale(self) -> tuple[float, str]:
        """Return the factor to the unit in which values up to this one are shown, and that unit."""
        size = abs(self.value)
        if self.unit in PLAIN or PREFIXED.match(self.unit) or not 0.0 < size < math.inf:
            return 1.0, self.unit
        highest = max(PREFIXES) if self.unit in FORCES else 0
        rounded = float(f"{size:.2e}")  # 0.9999 mm is shown as 1 mm
        power = min(max(3 * math.floor(math.log10(rounded) / 3), min(PREFIXES)), highest)
        return 10.0**-power, PREFIXES[power] + self.unit

    def __str__(self) -> str:
        """Return the value with three digits."""
        return self.text()

    def text(self, digits: int = 3) -> str:
        """Return the value with `digits` digits and a prefixed unit, or with a power of ten."""
        factor, prefixed = self.scale()
        size = abs(factor * self.value)
        if 0.0 < size < 1e-3:
            mantissa, _, exponent = f"{self.value:.{digits - 1}e}".partition("e")
            number, prefixed = f"{mantissa} · 10{str(int(exponent)).translate(_SUPERSCRIPTS)}", self.unit
        elif 1e3 <= size < math.inf:
            number = f"{factor * self.value:.0f}"
        else:
            number = f"{factor * self.value:z#.{digits}g}"
        space = "" if self.unit in ("°", "") else " "
        return f"{number.rstrip('.')}{space}{prefixed}"

    def difference(self) -> str:
        """Return a difference between two runs with its unit, as `text`; < 1 nm where it is rounding."""
        if abs(self.value) < self.PROCESSOR_ROUNDING:
            return f"< {Quantity(self.PROCESSOR_ROUNDING, self.unit).text(1)}"
        return self.text()

    def si_difference(self) -> str:
        """Return a difference between two runs as text, in SI units: 2.2e-03, or < 1e-09.

        Below 1e-9 it is made of rounding: its digits change with the processor, its size does not matter.
        """
        rounding = self.PROCESSOR_ROUNDING
        return f"< {rounding:.0e}" if abs(self.value) < rounding else f"{self.value:.1e}"

    def setting(self) -> str:
        """Return a time as a setting that can be typed: six digits may leave the grid of nanoseconds."""
        return f"{self.value:.12g}"

    def at_least(self, digits: int = 3) -> str:
        """Return a lower limit rounded up to `digits` digits, so that the text keeps the limit."""
        return self._rounded(ROUND_CEILING, digits)

    def at_most(self, digits: int = 3) -> str:
        """Return an upper limit rounded down to `digits` digits, so that the text keeps the limit."""
        return self._rounded(ROUND_FLOOR, digits)

    def _rounded(self, rounding: str, digits: int) -> str:
        exact = Decimal(repr(self.value))
        last = Decimal(1).scaleb(exact.adjusted() - digits + 1)
        return f"{float(exact.quantize(last, rounding)):.{digits}g}"

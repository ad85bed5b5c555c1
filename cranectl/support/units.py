"""Show values with SI prefixes: 0.0123 m as 12.3 mm, with one unit for a column or an axis.

Settings are shown without needless digits: 600000.0 as 600000, 1000000000.0 as 1e9.
"""

import math
import re
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

PREFIXES = {6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p"}  # by power of ten
FORCES = ("N", "Nm", "J", "W")  # thousands of these are shown as k; a path of 1200 m is not 1.2 km
PROCESSOR_ROUNDING = 1e-9  # m, rad, N, ...: differences between runs that are smaller depend on the processor
PLAIN = ("°", "1", "%", "", "kg")  # units without a prefix
PREFIXED = re.compile(r"[cdhkMmµun](m|s|g|N|rad|A|V|W|J|Pa|Hz)\b")  # nor do those that have one, as mm


def scaled(unit: str, largest: float) -> tuple[float, str]:
    """Return the factor to the unit in which values up to `largest` are shown, and that unit."""
    size = abs(largest)
    if unit in PLAIN or PREFIXED.match(unit) or not 0.0 < size < math.inf:
        return 1.0, unit
    highest = max(PREFIXES) if unit in FORCES else 0
    rounded = float(f"{size:.2e}")  # 0.9999 mm is shown as 1 mm
    power = min(max(3 * math.floor(math.log10(rounded) / 3), min(PREFIXES)), highest)
    return 10.0**-power, PREFIXES[power] + unit


def exact_seconds(seconds: float) -> str:
    """Return a time as a setting that can be typed: six digits may leave the grid of nanoseconds."""
    return f"{seconds:.12g}"


def at_least(value: float, digits: int = 3) -> str:
    """Return a lower limit rounded up to `digits` digits, so that the text keeps the limit."""
    return _rounded_text(value, ROUND_CEILING, digits)


def at_most(value: float, digits: int = 3) -> str:
    """Return an upper limit rounded down to `digits` digits, so that the text keeps the limit."""
    return _rounded_text(value, ROUND_FLOOR, digits)


def _rounded_text(value: float, rounding: str, digits: int) -> str:
    exact = Decimal(repr(value))
    last = Decimal(1).scaleb(exact.adjusted() - digits + 1)
    return f"{float(exact.quantize(last, rounding)):.{digits}g}"


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """Return `value` with `digits` digits and a prefixed unit, or with a power of ten."""
    factor, prefixed = scaled(unit, value)
    size = abs(factor * value)
    if 0.0 < size < 1e-3:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        number, prefixed = f"{mantissa} · 10{str(int(exponent)).translate(_SUPERSCRIPTS)}", unit
    else:
        number = f"{factor * value:.0f}" if 1e3 <= size < math.inf else f"{factor * value:z#.{digits}g}"
    space = "" if unit in ("°", "") else " "
    return f"{number.rstrip('.')}{space}{prefixed}"


def difference_text(value: float) -> str:
    """Return a difference between two runs as text, in SI units: 2.2e-03, or < 1e-09.

    Below 1e-9 it is made of rounding: its digits change with the processor, its size does not matter.
    """
    return f"< {PROCESSOR_ROUNDING:.0e}" if value < PROCESSOR_ROUNDING else f"{value:.1e}"


def difference_in(value: float, unit: str) -> str:
    """Return a difference between two runs with its unit, as `quantity`; < 1 nm where it is rounding."""
    if abs(value) < PROCESSOR_ROUNDING:
        return f"< {quantity(PROCESSOR_ROUNDING, unit, 1)}"
    return quantity(value, unit)


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

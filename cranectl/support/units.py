"""Values as people tell them: with SI prefixes, 0.0123 m as 12.3 mm, one unit for a column or an axis.

And settings without the tails of their type: 600000.0 as 600000, 1000000000.0 as 1e9.
"""

import json
import math
import re
from typing import Any

PREFIXES = {6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p"}  # by power of ten
FORCES = ("N", "Nm", "J", "W")  # of which thousands are told as k; a path of 1200 m is not 1.2 km
PLAIN = ("°", "1", "%", "", "kg")  # which take no prefix


def scaled(unit: str, largest: float) -> tuple[float, str]:
    """The factor that brings values in `unit` up to `largest` to the unit that is told, and that unit."""
    size = abs(largest)
    if unit in PLAIN or not 0.0 < size < math.inf:
        return 1.0, unit
    highest = max(PREFIXES) if unit in FORCES else 0
    rounded = float(f"{size:.2e}")  # 0.9999 mm is told as 1 mm
    power = min(max(3 * math.floor(math.log10(rounded) / 3), min(PREFIXES)), highest)
    return 10.0**-power, PREFIXES[power] + unit


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """`value` in `unit` with so many digits and its prefix, 12.3 mm; powers of ten where no prefix fits."""
    factor, prefixed = scaled(unit, value)
    size = abs(factor * value)
    if 0.0 < size < 1e-3:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        number, prefixed = f"{mantissa} · 10{str(int(exponent)).translate(_SUPERSCRIPTS)}", unit
    else:
        number = f"{factor * value:.0f}" if 1e3 <= size < math.inf else f"{factor * value:z#.{digits}g}"
    space = "" if unit in ("°", "") else " "
    return f"{number.rstrip('.')}{space}{prefixed}"


def plain(setting: Any) -> str:
    """A value from TOML or JSON; numbers that take more than ten digits have six, texts are as they are."""
    if isinstance(setting, list | tuple):
        return f"[{', '.join(map(plain, setting))}]"
    if not isinstance(setting, float):
        return setting if isinstance(setting, str) else json.dumps(setting, ensure_ascii=False)
    texts = [f"{setting:z.{digits}g}" for digits in range(6, 11)]
    shortest = next((text for text in texts if float(text) == setting), texts[0])
    return re.sub(r"e\+?(-?)0*", r"e\1", shortest)


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

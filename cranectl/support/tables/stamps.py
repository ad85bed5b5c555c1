"""Read time stamps as people and programs write them: ISO 8601, German, American, time of day."""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.support.arrays import Array

DAY = 86_400.0  # [s]
CENTURY = 2000  # of years with two digits
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
# Date and time, or a time of day; RE2 and Python read this pattern alike.
PATTERN = (
    r"^\s*(?:(?P<first>\d{1,4})(?P<mark>[-./])(?P<second>\d{1,2}|[A-Za-z]{3})[-./](?P<third>\d{1,4})[T ,]+)?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<second_of_minute>\d{2}(?:[.,:]\d+)?))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|UTC|(?P<zone>[+-]\d{2}):?(?P<zone_minute>\d{2}))?\s*$"
)
_STAMP = re.compile(PATTERN)


def is_stamp(cell: str) -> bool:
    """Return True for a time stamp or a time of day."""
    return bool(_STAMP.match(cell))


def seconds_of_stamps(column: Any) -> Array | None:
    """Return a column of texts (N,) as seconds after the first stamp, or None if one is no time stamp.

    Cells without a value are NaN. If days and months could be exchanged, the order that gives the shorter
    time is taken. A time of day that falls back by more than half a day belongs to the next day.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    known = np.asarray(column.is_valid())
    texts = column.drop_null().combine_chunks()
    parts = pc.extract_regex(texts, PATTERN)
    if not len(texts) or parts.null_count:
        return None

    def text(name: str) -> Any:
        return pc.struct_field(parts, name)

    def number(name: str) -> Array:
        digits = pc.replace_substring_regex(text(name), "[,:]", ".")
        filled = pc.if_else(pc.equal(digits, ""), "0", digits)
        return filled.cast(pa.float64()).to_numpy(zero_copy_only=False)  # type: ignore[no-any-return]

    hours = number("hour")
    half = pc.utf8_lower(text("half"))
    has_half = np.asarray(pc.not_equal(half, ""))
    is_afternoon = np.asarray(pc.starts_with(half, "p"))
    hours = np.where(has_half, hours % 12.0, hours) + 12.0 * is_afternoon  # 12 am is 0, 12 pm is 12
    # The sign is in the hours, also in those of -00:30, which are -0.0.
    zone_minutes = np.copysign(number("zone_minute"), number("zone")) + 60.0 * number("zone")
    of_day = 3600.0 * hours + 60.0 * (number("minute") - zone_minutes) + number("second_of_minute")
    if (np.asarray(pc.equal(text("mark"), ""))).any():
        days = np.concatenate([[0.0], np.cumsum(np.diff(of_day) < -0.5 * DAY)])
    else:
        ordinals = _days(text("first").to_pylist(), text("second").to_pylist(), text("third").to_pylist())
        if ordinals is None:
            return None
        days = (ordinals - ordinals[0]).astype(np.float64)
    seconds = np.full(len(known), np.nan)
    seconds[known] = DAY * days + (of_day - of_day[0])
    return seconds


def _days(first: list[str], second: list[str], third: list[str]) -> NDArray[np.int64] | None:
    """Return dates (N,) as days since 1970, or None if there are none such."""
    dates = list(zip(first, second, third, strict=True))
    numbers: dict[tuple[str, str, str], list[int]] = {date: [] for date in dates}
    orders = ("year", "day", "month")
    for date in numbers:
        numbers[date] = [_ordinal(date, order) for order in orders]
    possible = [
        [found[k] for found in numbers.values()]
        for k in range(len(orders))
        if all(found[k] >= 0 for found in numbers.values())
    ]
    if not possible:
        return None
    shortest = min(possible, key=lambda days: max(days) - min(days))
    by_date = dict(zip(numbers, shortest, strict=True))
    return np.array([by_date[date] for date in dates])


def _ordinal(date: tuple[str, str, str], begins: str) -> int:
    """Return a date as days since 1970, -1 if it has another order; it begins with year, day or month."""
    a, b, c = date
    year, month, day = {"year": (a, b, c), "day": (c, b, a), "month": (c, a, b)}[begins]
    if (begins == "year") != (len(a) == 4) or len(year) not in (2, 4) or not day.isdecimal():
        return -1
    try:
        number = MONTHS.index(month.lower()) + 1 if month.lower() in MONTHS else int(month)
        full_year = int(year) + (CENTURY if len(year) == 2 else 0)
        return int(np.datetime64(f"{full_year:04d}-{number:02d}-{int(day):02d}").astype(np.int64))
    except ValueError:
        return -1

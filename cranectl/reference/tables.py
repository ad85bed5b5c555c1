"""Read the columns of a motion and their units from CSV and Parquet files.

Nothing is guessed: a column that is not clear is refused, in the words of the file.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from cranectl.support import Array, FileKind, InputError, ReadColumn, TableHead

MAX_FILE_ROWS = 2_000_000
PARQUET_MAGIC = b"PAR1"
UTF_16 = "text in UTF-16"  # which is read
# Names of units in the headers and metadata of other tools.
UNIT_ALIASES = {"sec": "s", "second": "s", "seconds": "s", "m/sec": "m/s"}
UNIT_ALIASES |= {f"{m}{end}": unit for unit, m in (("m", "met"), ("cm", "centimet"), ("mm", "millimet"))
            for end in ("er", "re", "ers", "res")}  # fmt: skip
# Units that headers may name but that cannot be read, by the first unit of the same quantity.
FOREIGN_UNITS = {
    "s": ("min", "minutes", "h", "hours"),
    "m": ("in", "inch", "inches", "ft", "foot", "feet", "yd", "um", "µm", "km"),
    "m/s": ("cm/s", "km/h", "in/s", "ft/s", "mm/min"),
}
ALLOWED_FILES = (
    "a CSV file with the names of its columns in the first line, a Parquet file, or a log of cranectl"
)
# A single letter after '_' is no unit: x_m may mean the measured x.
_UNIT = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$|/\s*(\w+)\s*$|_(mm|ms|us|ns)$")


class FileColumn(NamedTuple):
    """One column of a file."""

    values: Array  # (N,)
    unit: str  # as stated in the file, else empty


def read_columns(
    content: bytes, column_names: Mapping[str, str], units: Mapping[str, Sequence[str]], where: str
) -> dict[str, FileColumn]:
    """Return the columns of a file by kind: time, x, y, z, speed.

    `column_names` has the name of each column by kind. `units` has the units that each kind allows, one of
    which may stand in brackets behind a column's name, or in a line of units. Error messages begin with
    `where`. Raises InputError for another kind of file, a column that is missing or holds no numbers, and
    rows of different lengths.
    """
    head = _read_head(content, where)
    _check_names(head.names, column_names, where)
    return {kind: _read_column(head, kind, name, units[kind]) for kind, name in column_names.items()}


def _read_head(content: bytes, where: str) -> TableHead:
    import pyarrow as pa

    if content.startswith(PARQUET_MAGIC):
        with TableHead.reading(where):
            return TableHead.of_parquet(pa.BufferReader(content), where, longest=MAX_FILE_ROWS)
    if (kind := FileKind.named(content)) and kind != UTF_16:
        raise InputError(
            f"{where} is {kind}", allowed=ALLOWED_FILES, remedy="save it as CSV in UTF-8, or as Parquet"
        )
    with TableHead.reading(where):
        return TableHead.of_text(content, where, needs_names=True, longest=MAX_FILE_ROWS)


def _read_column(head: TableHead, kind: str, name: str, units: Sequence[str]) -> FileColumn:
    """Return one column, with the unit that the file states beside or in its name."""
    index = head.names.index(name)
    read = head.read(index, is_clock=kind == "time")
    if read.is_time and kind != "time":
        raise ReadColumn.not_numbers(head.where, name, "time stamps")
    unit = canonical_unit(head.unit(index)) or _unit_of(name, units)
    return FileColumn(read.values, "s" if read.is_time else unit)


def _unit_of(name: str, units: Sequence[str]) -> str:
    """Return the unit in a name such as 'x [mm]', 'x (mm)', 'x/mm' or 'x_mm', or "" if there is none.

    `units` are the readable units of the column's quantity.
    """
    match = _UNIT.search(name)
    unit = canonical_unit(next(filter(None, match.groups()), "")) if match else ""
    return unit if unit in (*units, *FOREIGN_UNITS[units[0]]) else ""


def canonical_unit(unit: str) -> str:
    """Return the name that cranectl uses for a unit."""
    return UNIT_ALIASES.get(unit.lower(), unit)


def _check_names(names: Sequence[str], column_names: Mapping[str, str], where: str) -> None:
    counts = Counter(names)
    for kind, name in column_names.items():
        if name not in counts:
            constant = ", with a number if all rows have the same" if kind in "xyz" else ""
            remedy = f"map it: columns = {{{kind} = '…'}}{constant}"
            error = InputError.unknown("column", name, names, remedy=remedy)
            raise InputError(
                f"{where}: {error.found}, for {kind}", allowed=error.allowed, remedy=error.remedy
            )
        if counts[name] > 1:
            raise InputError(
                f"{where}: {counts[name]} columns are called '{name}'",
                allowed="one column of each requested name",
                remedy="give the others another name",
            )

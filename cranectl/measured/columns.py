"""Columns of numbers: what a reader returns, whatever the type of its file."""

import shlex
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from cranectl.reference.files import SI_FACTORS
from cranectl.reference.tables import is_number, is_time
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError, unknown_name

HEAD_BYTES = 2**16  # bytes in which names, separator and decimal point are looked for
DEEPEST = 4  # level of fields in structures and messages that is read
MAX_COLUMN_LENGTH = 20_000_000

READABLE = "CSV, Parquet, MCAP, MATLAB (.mat), Excel (.xlsx) or a ROS bag"

Key = int | str  # of a column: its number from 1 on, or its name


class ReadColumn(NamedTuple):
    """One column of a file."""

    values: Array  # (N,) NaN for missing cells
    is_time: bool = False  # whether they are time stamps, in seconds after the first


class TableHead(NamedTuple):
    """What a file holds, before its numbers are read."""

    names: tuple[str, ...]  # of the columns; their numbers where the file has no names
    read: Callable[[int], ReadColumn]  # a column by its index from 0 on

    def column(self, key: Key, where: str) -> int:
        """Return the index of a column; raise InputError if it is missing or its name is not unique."""
        if isinstance(key, int):
            if key <= len(self.names):
                return key - 1
            raise InputError(
                f"{where}: column {key} of {len(self.names)}",
                allowed=f"numbers from 1 to {len(self.names)}",
                remedy=f"cranectl new map {shlex.quote(where)} shows what the file holds",
            )
        if (times := self.names.count(key)) > 1:
            numbers = [k for k, name in enumerate(self.names, 1) if name == key]
            raise InputError(
                f"{where}: {times} columns are called '{key}'",
                allowed="columns with names of their own, or numbers",
                remedy=f"write column = {numbers[0]}, or {numbers[1]}",
            )
        if not times:
            raise unknown_name(f"column of {where}:", key, self.names)
        return self.names.index(key)


def check_rows(rows: int, where: str) -> None:
    """Raise InputError if a file with so many rows would need too much memory."""
    if rows > MAX_COLUMN_LENGTH:
        raise InputError(
            f"{where} has {rows} rows",
            allowed=f"at most {MAX_COLUMN_LENGTH}",
            remedy="leave out rows, for example every second one",
        )


def not_numbers(where: str, name: str, holds: str) -> InputError:
    """Return the error for a column that holds something else than numbers."""
    return InputError(
        f"{where}: column '{name}' holds {holds}",
        allowed="numbers; a clock may also have time stamps",
        remedy="map another column, or write numbers",
    )


def from_arrow(column: Any, name: str, where: str) -> ReadColumn:
    """Return a column of Arrow as numbers; raise InputError if it has none."""
    import pyarrow as pa

    kind = column.type
    if is_time(kind):
        ticks = column.cast(pa.int64()).to_numpy()
        return ReadColumn((ticks - ticks[:1]) * SI_FACTORS[kind.unit], is_time=True)
    if not is_number(kind):
        text = next((cell for cell in column.to_pylist()[:1000] if isinstance(cell, str)), "")
        raise not_numbers(where, name, f"the text '{text[:40]}'" if text else f"values of the type {kind}")
    return ReadColumn(column.cast(pa.float64()).to_numpy())


def from_arrays(where: str, arrays: Mapping[str, Array]) -> TableHead:
    """Return the head of a file that is in memory; its columns may have different lengths."""
    names = tuple(arrays)
    if not names:
        raise InputError(f"{where} has no columns of numbers", allowed=READABLE, remedy="save it as CSV")
    check_rows(max(map(len, arrays.values())), where)
    return TableHead(names, lambda column: ReadColumn(arrays[names[column]]))

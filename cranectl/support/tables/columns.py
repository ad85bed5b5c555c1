"""Columns of numbers: what a reader returns, whatever the type of its file."""

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cranectl.support.arrays import Array
from cranectl.support.errors import InputError, describe_error
from cranectl.support.tables.stamps import seconds_of_stamps

MAX_COLUMN_LENGTH = 20_000_000  # rows
MAX_EXACT_INTEGER = 2**53  # up to here a float represents every integer
TICK_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # [s], of time stamps
READABLE = "CSV, Parquet, MCAP, MATLAB (.mat), HDF5, Excel (.xlsx) or a ROS bag"  # for messages

Key = int | str  # of a column: its number from 1 on, or its name


class ReadColumn(NamedTuple):
    """One column of a file."""

    values: Array  # (N,) NaN for missing cells
    is_time: bool = False  # whether they are time stamps, in seconds after the first


@dataclass(frozen=True)
class TableHead:
    """What a file holds, before its numbers are read."""

    where: str  # the file, for messages
    names: tuple[str, ...]  # of the columns; their numbers where the file has no names
    load: Callable[[int, bool], ReadColumn]  # a column by its index from 0 on, and whether it is a clock
    units: tuple[str, ...] = ()  # as the file states them beside the names; empty if it states none
    left_out: tuple[str, ...] = ()  # what the file holds and the columns do not, in words
    is_ordered: bool = True  # False for messages, which are in the order of their arrival

    def read(self, column: int, *, is_clock: bool = False) -> ReadColumn:
        """Return a column by its index from 0 on.

        Of a clock only differences count, so whole numbers that a float cannot represent are read as
        differences from the first. Raises InputError if the column holds no numbers or cannot be read.
        """
        with reported(self.where):
            return self.load(column, is_clock)

    def unit(self, column: int) -> str:
        """Return the unit that the file states for a column, or an empty text."""
        return self.units[column] if self.units else ""

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
            raise InputError.unknown(f"column of {where}:", key, self.names)
        return self.names.index(key)


@contextmanager
def reported(where: str, kind: str = "") -> Iterator[None]:
    """Raise InputError for the errors of libraries that read a broken file; `kind` says what it is."""
    try:
        yield
    except (InputError, MemoryError):
        raise
    except ImportError as error:
        package = "mat-io" if error.name == "matio" else error.name
        raise InputError(
            f"{where}: this kind of file needs {package}, which is not installed",
            allowed="CSV, Parquet, MCAP and MATLAB files up to version 7 without it",
            remedy="pip install 'cranectl[import]', or save the file as CSV",
        ) from None
    except Exception as error:  # files may break a library in any way
        raise InputError(
            f"cannot read {where}{f', {kind}' if kind else ''}: {describe_error(error)[:300]}",
            allowed="a whole file, as its program writes it",
            remedy="write the file again, for example as CSV",
        ) from None


def check_rows(rows: int, where: str, longest: int = MAX_COLUMN_LENGTH) -> None:
    """Raise InputError if a file with so many rows would need too much memory."""
    if rows > longest:
        raise InputError(
            f"{where} has {rows} rows",
            allowed=f"at most {longest}",
            remedy="leave out rows, for example every second one",
        )


def not_numbers(where: str, name: str, holds: str) -> InputError:
    """Return the error for a column that holds something else than numbers."""
    return InputError(
        f"{where}: column '{name}' holds {holds}",
        allowed="numbers, with a point before decimals or with ; between columns and a comma; "
        "a clock may also have time stamps",
        remedy="map another column, or write numbers",
    )


def from_arrow(column: Any, name: str, where: str, *, is_clock: bool = False) -> ReadColumn:
    """Return a column of Arrow as numbers; raise InputError if it has none."""
    import pyarrow as pa

    kind = column.type
    if is_time(kind):
        return ReadColumn(_after_first(column.cast(pa.int64())) * TICK_SECONDS[kind.unit], is_time=True)
    if pa.types.is_string(kind) and (seconds := seconds_of_stamps(column)) is not None:
        return ReadColumn(seconds, is_time=True)
    if not is_number(kind):
        raise not_numbers(where, name, _describe(column))
    try:
        return ReadColumn(column.cast(pa.float64()).to_numpy())
    except pa.ArrowInvalid:  # whole numbers that a float cannot represent
        if is_clock:
            return ReadColumn(_after_first(column.cast(pa.int64())))
    raise not_numbers(where, name, f"whole numbers above {MAX_EXACT_INTEGER}, which a float rounds")


def _after_first(ticks: Any) -> Array:
    """Return whole numbers (N,) as differences from the first that is there, exact at any size."""
    import pyarrow as pa
    import pyarrow.compute as pc

    known = ticks.drop_null()
    if not len(known):
        return np.full(len(ticks), np.nan)
    after: Array = pc.subtract(ticks, known[0]).cast(pa.float64(), safe=False).to_numpy()
    return after


def is_time(kind: Any) -> bool:
    """Return True for an Arrow type of time stamps or durations."""
    import pyarrow as pa

    return bool(pa.types.is_timestamp(kind) or pa.types.is_duration(kind))


def is_number(kind: Any) -> bool:
    """Return True for an Arrow type of numbers."""
    import pyarrow as pa

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))


def _describe(column: Any) -> str:
    """Describe a column without numbers: its first text, or its type."""
    import pyarrow as pa

    if pa.types.is_null(column.type):
        return "no values"
    text = next((cell for cell in column.slice(0, 1000).to_pylist() if isinstance(cell, str)), "")
    return f"the text '{text[:40]}'" if text else f"values of the type {column.type}"


def read_parquet(source: Any, where: str, *, longest: int = MAX_COLUMN_LENGTH) -> TableHead:
    """Return the head of a Parquet file: a path, or a buffer of Arrow.

    Types are checked before a column is read, since compressed text can be huge.
    """
    from pyarrow import parquet

    with parquet.ParquetFile(source) as file:
        schema = file.schema_arrow
        check_rows(file.metadata.num_rows, where, longest)

    def load(column: int, is_clock: bool) -> ReadColumn:
        field = schema.field(column)
        if not (is_number(field.type) or is_time(field.type)):
            raise not_numbers(where, field.name, f"values of the type {field.type}")
        with parquet.ParquetFile(source) as file:
            read = file.read(columns=[field.name], use_threads=False)
        return from_arrow(read.column(0), field.name, where, is_clock=is_clock)

    return TableHead(where, tuple(schema.names), load, tuple(_stated_unit(field) for field in schema))


def _stated_unit(field: Any) -> str:
    """Return the unit in the metadata of a column, or an empty text."""
    metadata = {key.lower(): value for key, value in (field.metadata or {}).items()}
    unit: bytes = metadata.get(b"unit") or metadata.get(b"units") or b""
    return unit.decode("utf-8", "replace").strip()


def from_arrays(
    where: str, arrays: Mapping[str, Array], *, left_out: Sequence[str] = (), is_ordered: bool = True
) -> TableHead:
    """Return the head of a file that is in memory; its columns may have different lengths."""
    names = tuple(arrays)
    if not names:
        raise InputError(
            f"{where} has no columns of numbers" + (f"; it has {', '.join(left_out)}" if left_out else ""),
            allowed=READABLE,
            remedy="save it as CSV",
        )
    check_rows(max(map(len, arrays.values())), where)
    return TableHead(
        where,
        names,
        lambda column, _: ReadColumn(arrays[names[column]]),
        left_out=tuple(left_out),
        is_ordered=is_ordered,
    )

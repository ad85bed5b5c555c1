"""Read columns of numbers and their units from CSV and Parquet files.

Nothing is guessed: a column that is not clear is refused, in the words of the file.
"""

import contextlib
import csv
import io
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cranectl.support.arrays import Array
from cranectl.support.documents import format_of
from cranectl.support.errors import InputError, unknown_name

MAX_FILE_ROWS = 2_000_000
SEPARATORS = ";\t,"  # by priority where a line has them equally often, since a comma may be decimal
PARQUET_MAGIC = b"PAR1"
TICK_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # [s], of time stamps
MAX_EXACT_INTEGER = 2**53  # up to here a float represents every integer
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
COMMENT = re.compile(r"\s*(#|//|%|sep=.$)")  # Excel writes the last
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
    which may stand in brackets behind a column's name. Error messages begin with `where`. Raises InputError
    for another kind of file, a column that is missing or holds no numbers, and rows of different lengths.
    """
    import pyarrow as pa

    is_parquet = content.startswith(PARQUET_MAGIC)
    if not is_parquet and (kind := format_of(content)):
        raise InputError(
            f"{where} is {kind}", allowed=ALLOWED_FILES, remedy="save it as CSV in UTF-8, or as Parquet"
        )
    try:
        read = _read_parquet if is_parquet else _read_csv
        table, stated_units = read(content, column_names, where)
        columns = {
            kind: _to_numbers(
                kind, name, table[name], stated_units.get(name) or _unit_of(name, units[kind]), where
            )
            for kind, name in column_names.items()
        }
    except (pa.ArrowException, KeyError, OSError, ValueError, IndexError) as error:
        raise InputError(
            f"cannot read {where}: {error}", allowed=ALLOWED_FILES, remedy="write the file again"
        ) from None
    del table
    pa.default_memory_pool().release_unused()  # else it keeps as much memory as the numbers take
    return columns


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


def _to_numbers(kind: str, name: str, column: Any, unit: str, where: str) -> FileColumn:
    import pyarrow as pa

    if kind == "time" and is_time(column.type):
        ticks = column.cast(pa.int64()).to_numpy()
        return FileColumn((ticks - ticks[:1]) * TICK_SECONDS[column.type.unit], "s")
    if not is_number(column.type):
        raise InputError(
            f"{where}: column '{name}' holds {_describe_column(column)}",
            allowed="numbers" + (", or time stamps as in ISO 8601" if kind == "time" else ""),
            remedy="write numbers, with a point before decimals, or with ; between columns and a comma",
        )
    values = (column.cast(pa.float64()) if pa.types.is_decimal(column.type) else column).to_numpy()
    if (
        values.dtype.kind in "iu"
        and kind == "time"
        and len(values)
        and abs(int(values[0])) > MAX_EXACT_INTEGER
    ):
        values = values - values[0]  # as integers: only differences of times count
    return FileColumn(values.astype(np.float64), unit)


def is_time(kind: Any) -> bool:
    """Return True for an Arrow type of time stamps or durations."""
    import pyarrow as pa

    return bool(pa.types.is_timestamp(kind) or pa.types.is_duration(kind))


def is_number(kind: Any) -> bool:
    """Return True for an Arrow type of numbers."""
    import pyarrow as pa

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))


def _describe_column(column: Any) -> str:
    """Describe a column without numbers: its first value that is no number, or its type."""
    import pyarrow as pa

    if pa.types.is_null(column.type):
        return "no values"
    if not pa.types.is_string(column.type):
        return f"values of the type {column.type}"
    for row, value in enumerate(column.to_pylist()):
        if value is not None and ("," in value or not is_numeric(value)):
            return f"the text '{value[:40]}', in row {row + 1}"
    return "text"


def is_data(line: str) -> bool:
    """Return True for a line of CSV that is neither blank nor a comment."""
    return bool(line.strip()) and not COMMENT.match(line)


def is_numeric(cell: str) -> bool:
    """Return True if a cell is a number, with a point or a comma before decimals."""
    with contextlib.suppress(ValueError):
        float(cell.strip().replace(",", "."))
        return True
    return False


def _read_parquet(content: bytes, column_names: Mapping[str, str], where: str) -> tuple[Any, dict[str, str]]:
    """Read the requested columns after a check of types, since compressed text can be huge."""
    import pyarrow as pa
    from pyarrow import parquet

    file = parquet.ParquetFile(pa.BufferReader(content))
    if file.metadata.num_rows > MAX_FILE_ROWS:
        raise ValueError(f"it has {file.metadata.num_rows} rows, more than {MAX_FILE_ROWS}")
    schema = file.schema_arrow
    _check_names(schema.names, column_names, where)
    units = {}
    for kind, name in column_names.items():
        field = schema.field(name)
        if not (is_number(field.type) or (kind == "time" and is_time(field.type))):
            raise InputError(
                f"{where}: column '{name}' holds values of the type {field.type}",
                allowed="numbers" + (", time stamps or durations" if kind == "time" else ""),
                remedy="write the column as floating point numbers",
            )
        metadata = {key.lower(): value for key, value in (field.metadata or {}).items()}
        unit = metadata.get(b"unit") or metadata.get(b"units") or b""
        units[name] = canonical_unit(unit.decode("utf-8", "replace").strip())
    return file.read(columns=list(column_names.values())), units


def _read_csv(content: bytes, column_names: Mapping[str, str], where: str) -> tuple[Any, dict[str, str]]:
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(
            f"{where} is no text in UTF-8: byte {error.start}, in line {line}",
            allowed=ALLOWED_FILES,
            remedy="save it as CSV in UTF-8, or as Parquet",
        ) from None
    names, separator, first = _read_header(lines, where)
    _check_names(names, column_names, where)
    text = "\n".join(lines[first:])
    del lines  # a million strings take more memory than everything else
    point = re.compile(rf"(?:^|{separator})[ +-]*\d*\.\d*(?:[eE][+-]?\d+)? *(?:{separator}|$)", re.MULTILINE)
    has_decimal_comma = separator != "," and not point.search(text)
    invalid_rows: list[Any] = []

    def record_invalid(row: Any) -> str:
        invalid_rows.append(row)
        return "error"

    try:
        table = (
            arrow_csv.read_csv(
                pa.BufferReader(text.encode()),
                read_options=arrow_csv.ReadOptions(column_names=names, use_threads=False),
                parse_options=arrow_csv.ParseOptions(delimiter=separator, invalid_row_handler=record_invalid),
                convert_options=arrow_csv.ConvertOptions(
                    decimal_point="," if has_decimal_comma else ".",
                    include_columns=list(dict.fromkeys(column_names.values())),
                ),
            )
            if text.strip()
            else pa.table({name: pa.nulls(0) for name in column_names.values()})
        )
    except pa.ArrowInvalid:
        if not invalid_rows:
            raise
        row = invalid_rows[0]
        where_in_file = f"line {first + row.number}" if row.number else "a line"
        raise InputError(
            f"{where}: {where_in_file} has {row.actual_columns} cells, "
            f"the line of names has {row.expected_columns}: "
            f"{row.text[:60]}",
            allowed=f"as many cells in each line, '{separator}' between them".replace("\t", "tab"),
            remedy="correct that line, or leave it out",
        ) from None
    return table, {}


def _read_header(lines: Sequence[str], where: str) -> tuple[list[str], str, int]:
    """Return the column names, the separator, and the number of lines before the numbers."""
    first = next((k for k, line in enumerate(lines) if is_data(line)), len(lines))
    rows = [line for line in lines[first : first + 2] if line.strip()]
    line = rows[0] if rows else ""
    separator = max(SEPARATORS, key=line.count)
    cells = split_cells(line, separator)
    if cells and not all(map(is_numeric, cells)):
        return _check_separator(cells, line, where), separator, first + 1
    if first:  # the last comment may be the line of names
        comment = COMMENT.sub("", lines[first - 1], count=1)
        names = split_cells(comment, max(SEPARATORS, key=comment.count))
        if comment.strip() and (len(names) == len(cells) or not cells):
            separator = separator if cells else max(SEPARATORS, key=comment.count)
            return _check_separator(names, comment, where), separator, first
    if cells == [str(k) for k in range(len(cells))]:  # pandas writes these for unnamed columns
        return cells, separator, first + 1
    begins = "begins with a comment and " if first else ""
    example = separator.join(("time", "x", "y", "z"))
    raise InputError(
        f"{where} {begins}has no line of names: its first line of cells is '{line[:60]}'",
        allowed=ALLOWED_FILES,
        remedy=f"write a line of names before it, such as {example}",
    )


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line of CSV, without blanks around them."""
    return [cell.strip() for cell in next(csv.reader(io.StringIO(line), delimiter=separator), [])]


def _check_separator(names: list[str], line: str, where: str) -> list[str]:
    """Return `names`; raise InputError where blanks or bars seem to separate them."""
    if len(names) == 1 and len(re.split(r"[|\s]+", names[0])) > 2:
        raise InputError(
            f"{where}: blanks or bars separate the names in its first line, '{line[:60]}'",
            allowed="a comma, a semicolon or a tab between columns",
            remedy="write the file with one of these between its columns",
        )
    return names


def _check_names(names: Sequence[str], column_names: Mapping[str, str], where: str) -> None:
    counts = Counter(names)
    for kind, name in column_names.items():
        if name not in counts:
            constant = ", with a number if all rows have the same" if kind in "xyz" else ""
            remedy = f"map it: columns = {{{kind} = '…'}}{constant}"
            error = unknown_name("column", name, names, remedy=remedy)
            raise InputError(
                f"{where}: {error.found}, for {kind}", allowed=error.allowed, remedy=error.remedy
            )
        if counts[name] > 1:
            raise InputError(
                f"{where}: {counts[name]} columns are called '{name}'",
                allowed="one column of each requested name",
                remedy="give the others another name",
            )

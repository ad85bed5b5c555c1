"""Columns of numbers from CSV and Parquet files, with what the files say of their units.

Nothing is taken from a file by guess: what cannot be one of its columns is refused in the words of the file.
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

MOST_ROWS = 2_000_000
SEPARATORS = ";\t,"  # the first of those that a line has equally often: a comma may be decimal
PARQUET = b"PAR1"
TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # [s], of time stamps
EXACT_INTEGERS = 2**53  # beyond, a float is not every whole number
# What units are called in the headers and metadata of other tools.
ALIASES = {"sec": "s", "second": "s", "seconds": "s", "m/sec": "m/s"}
ALIASES |= {f"{m}{end}": unit for unit, m in (("m", "met"), ("cm", "centimet"), ("mm", "millimet"))
            for end in ("er", "re", "ers", "res")}  # fmt: skip
# Units that a header can name and that are not read here, by the first that is.
OTHER_UNITS = {
    "s": ("min", "minutes", "h", "hours"),
    "m": ("in", "inch", "inches", "ft", "foot", "feet", "yd", "um", "µm", "km"),
    "m/s": ("cm/s", "km/h", "in/s", "ft/s", "mm/min"),
}
ALLOWED = "a CSV file with the names of its columns in the first line, a Parquet file, or a log of cranectl"
_COMMENT = re.compile(r"\s*(#|//|%|sep=.$)")  # the last is Excel's
# A single letter after '_' is no unit: x_m may be what was measured.
_UNIT = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$|/\s*(\w+)\s*$|_(mm|ms|us|ns)$")


class FileColumn(NamedTuple):
    """One column of a file."""

    values: Array  # (N,)
    unit: str  # as the file says; empty if it does not


def read_columns(
    content: bytes, named: Mapping[str, str], units: Mapping[str, Sequence[str]], where: str
) -> dict[str, FileColumn]:
    """Return the columns of a file by what they are.

    Parameters
    ----------
    content : bytes
        Of the file.
    named : mapping
        The name of each column by what it is: time, x, y, z, speed.
    units : mapping
        The units that each can have, which may stand in brackets behind its name.
    where : str
        What errors begin with.

    Raises
    ------
    InputError
        For another kind of file, a column that is missing or no numbers, and rows of other lengths.
    """
    import pyarrow as pa

    packed = content.startswith(PARQUET)
    if not packed and (kind := format_of(content)):
        raise InputError(
            f"{where} is {kind}", allowed=ALLOWED, remedy="save it as CSV in UTF-8, or as Parquet"
        )
    try:
        read = _parquet if packed else _csv
        table, unit_texts = read(content, named, where)
        columns = {
            kind: _numbers(
                kind, name, table[name], unit_texts.get(name) or _unit_of(name, units[kind]), where
            )
            for kind, name in named.items()
        }
    except (pa.ArrowException, KeyError, OSError, ValueError, IndexError) as error:
        raise InputError(
            f"cannot read {where}: {error}", allowed=ALLOWED, remedy="write the file again"
        ) from None
    del table
    pa.default_memory_pool().release_unused()  # it keeps as much as the numbers take
    return columns


def _unit_of(name: str, units: Sequence[str]) -> str:
    """Return the unit in a name such as 'x [mm]', 'x (mm)', 'x/mm' or 'x_mm', if it is one of a quantity.

    `units`: those of the quantity that are read.
    """
    match = _UNIT.search(name)
    unit = known_unit(next(filter(None, match.groups()), "")) if match else ""
    return unit if unit in (*units, *OTHER_UNITS[units[0]]) else ""


def known_unit(unit: str) -> str:
    """Return a unit by the name that it has here."""
    return ALIASES.get(unit.lower(), unit)


def _numbers(kind: str, name: str, column: Any, unit: str, where: str) -> FileColumn:
    import pyarrow as pa

    if kind == "time" and _is_instant(column.type):
        ticks = column.cast(pa.int64()).to_numpy()
        return FileColumn((ticks - ticks[:1]) * TICKS[column.type.unit], "s")
    if not _is_number(column.type):
        raise InputError(
            f"{where}: column '{name}' holds {_said(column)}",
            allowed="numbers" + (", or time stamps as in ISO 8601" if kind == "time" else ""),
            remedy="write numbers, with a point before decimals, or with ; between columns and a comma",
        )
    values = (column.cast(pa.float64()) if pa.types.is_decimal(column.type) else column).to_numpy()
    if values.dtype.kind in "iu" and kind == "time" and len(values) and abs(int(values[0])) > EXACT_INTEGERS:
        values = values - values[0]  # only differences of times count
    return FileColumn(values.astype(np.float64), unit)


def _is_instant(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_timestamp(kind) or pa.types.is_duration(kind))


def _is_number(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))


def _said(column: Any) -> str:
    """Return what a column without numbers holds: the first value that is none, or the type."""
    import pyarrow as pa

    if pa.types.is_null(column.type):
        return "no values"
    if not pa.types.is_string(column.type):
        return f"values of the type {column.type}"
    for row, value in enumerate(column.to_pylist()):
        if value is not None and ("," in value or not _is_numeric(value)):
            return f"the text '{value[:40]}', in row {row + 1}"
    return "text"


def _is_numeric(cell: str) -> bool:
    with contextlib.suppress(ValueError):
        float(cell.strip().replace(",", "."))
        return True
    return False


def _parquet(content: bytes, named: Mapping[str, str], where: str) -> tuple[Any, dict[str, str]]:
    """Read only the columns asked for, and these only if they are numbers: what is packed can be huge."""
    import pyarrow as pa
    from pyarrow import parquet

    file = parquet.ParquetFile(pa.BufferReader(content))
    if file.metadata.num_rows > MOST_ROWS:
        raise ValueError(f"it has {file.metadata.num_rows} rows, more than {MOST_ROWS}")
    schema = file.schema_arrow
    _check_names(schema.names, named, where)
    units = {}
    for kind, name in named.items():
        field = schema.field(name)
        if not (_is_number(field.type) or (kind == "time" and _is_instant(field.type))):
            raise InputError(
                f"{where}: column '{name}' holds values of the type {field.type}",
                allowed="numbers" + (", time stamps or durations" if kind == "time" else ""),
                remedy="write the column as floating point numbers",
            )
        metadata = {key.lower(): value for key, value in (field.metadata or {}).items()}
        unit = metadata.get(b"unit") or metadata.get(b"units") or b""
        units[name] = known_unit(unit.decode("utf-8", "replace").strip())
    return file.read(columns=list(named.values())), units


def _csv(content: bytes, named: Mapping[str, str], where: str) -> tuple[Any, dict[str, str]]:
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(
            f"{where} is no text in UTF-8: byte {error.start}, in line {line}",
            allowed=ALLOWED,
            remedy="save it as CSV in UTF-8, or as Parquet",
        ) from None
    names, separator, first = _header(lines, where)
    _check_names(names, named, where)
    text = "\n".join(lines[first:])
    del lines  # a million texts take more memory than all else
    point = re.compile(rf"(?:^|{separator})[ +-]*\d*\.\d*(?:[eE][+-]?\d+)? *(?:{separator}|$)", re.MULTILINE)
    commas = separator != "," and not point.search(text)
    wrong: list[Any] = []

    def refuse(row: Any) -> str:
        wrong.append(row)
        return "error"

    try:
        table = (
            arrow_csv.read_csv(
                pa.BufferReader(text.encode()),
                read_options=arrow_csv.ReadOptions(column_names=names, use_threads=False),
                parse_options=arrow_csv.ParseOptions(delimiter=separator, invalid_row_handler=refuse),
                convert_options=arrow_csv.ConvertOptions(
                    decimal_point="," if commas else ".", include_columns=list(dict.fromkeys(named.values()))
                ),
            )
            if text.strip()
            else pa.table({name: pa.nulls(0) for name in named.values()})
        )
    except pa.ArrowInvalid:
        if not wrong:
            raise
        row = wrong[0]
        where_in_file = f"line {first + row.number}" if row.number else "a line"
        raise InputError(
            f"{where}: {where_in_file} has {row.actual_columns} cells, "
            f"the line of names has {row.expected_columns}: "
            f"{row.text[:60]}",
            allowed=f"as many cells in each line, '{separator}' between them".replace("\t", "tab"),
            remedy="correct that line, or leave it out",
        ) from None
    return table, {}


def _header(lines: Sequence[str], where: str) -> tuple[list[str], str, int]:
    """Return the names, the separator, and how many lines come before the numbers."""
    first = next((k for k, line in enumerate(lines) if line.strip() and not _COMMENT.match(line)), len(lines))
    rows = [line for line in lines[first : first + 2] if line.strip()]
    line = rows[0] if rows else ""
    separator = max(SEPARATORS, key=line.count)
    cells = _cells(line, separator)
    if cells and not all(map(_is_numeric, cells)):
        return _whole(cells, line, where), separator, first + 1
    for before in reversed(range(first)):  # the last comment may be the line of names
        comment = _COMMENT.sub("", lines[before], count=1)
        named = _cells(comment, max(SEPARATORS, key=comment.count))
        if comment.strip() and (len(named) == len(cells) or not cells):
            separator = separator if cells else max(SEPARATORS, key=comment.count)
            return _whole(named, comment, where), separator, first
        break
    if [cell.strip() for cell in cells] == [str(k) for k in range(len(cells))]:  # of pandas without names
        return cells, separator, first + 1
    begins = "begins with a comment and " if first else ""
    example = separator.join(("time", "x", "y", "z"))
    raise InputError(
        f"{where} {begins}has no line of names: its first line of cells is '{line[:60]}'",
        allowed=ALLOWED,
        remedy=f"write a line of names before it, such as {example}",
    )


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader(io.StringIO(line), delimiter=separator), [])]


def _whole(names: list[str], line: str, where: str) -> list[str]:
    """Return `names`; raise InputError where blanks or bars seem to part them, which CSV has not."""
    if len(names) == 1 and len(re.split(r"[|\s]+", names[0])) > 2:
        raise InputError(
            f"{where}: blanks or bars part the names in its first line, '{line[:60]}'",
            allowed="a comma, a semicolon or a tab between columns",
            remedy="write the file with one of these between its columns",
        )
    return names


def _check_names(names: Sequence[str], named: Mapping[str, str], where: str) -> None:
    counts = Counter(names)
    for kind, name in named.items():
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
                allowed="one column of each name that is asked for",
                remedy="give the others another name",
            )

"""Find the names, the units and the numbers of a table by the longest block of rows with equal columns.

Programs for measuring write lines about the measurement before the names, units below them, and texts such
as events behind the numbers.
"""

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from cranectl.support.errors import InputError
from cranectl.support.tables.stamps import is_stamp

BLANKS = " "  # any number of blanks between columns
SEPARATORS = (";", "\t", ",", BLANKS)  # by priority where all explain a file, since a comma may be decimal
COMMENT = re.compile(r"\s*(#|//|%|sep=.$)")  # Excel writes the last
NUMBER = re.compile(r"\s*[+-]?(\d+[.,]?\d*([eE][+-]?\d+)?|[.,]\d+([eE][+-]?\d+)?|nan|inf)\s*$", re.I | re.A)
WITH_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*$", re.A)
# Units that may stand in a line of their own; in brackets any word counts.
_UNITS = (
    "s sec second seconds ms us µs μs ns min h m meter metre cm mm um µm μm km in ft yd deg degree degrees ° "
    "grad rad mrad turn m/s mm/s cm/s m/min mm/min km/h deg/s °/s rad/s rpm 1/min m/s^2 m/s² m/s2 mm/s^2 "
    "mm/s² deg/s^2 rad/s^2 n kn nm knm kg g t v mv a ma w kw hz khz bar % count counts cnt inc ink bool °c "
    "c k - 1"
)
UNITS = frozenset(_UNITS.split())
_BRACKETS = re.compile(r"\s*[\[(](.*)[\])]\s*$")
SHARE_OF_NAMES = 0.5  # of the columns that must have names, for a line of names

ROWS = "rows of numbers, with a comma, a semicolon, a tab or blanks between columns"

Cells = Sequence[str]


class Header(NamedTuple):
    """Where a table has its names, units and numbers, as indices of its rows."""

    names: tuple[str, ...]  # empty if it has none
    units: tuple[str, ...]  # as many as names, or none
    start: int  # of the first row of numbers
    begin: int  # of the first row of names, units or numbers
    columns: int  # cells of most rows
    kinds: tuple[str, ...]  # of the cells in most rows: number, stamp, text or "" for missing ones

    @classmethod
    def find(cls, rows: Sequence[Cells | None], named_row: int | None = None) -> "Header | None":
        """Return where a table of cells has names and numbers, or None without a row of numbers.

        A row without cells, or with a comment, is None. `named_row` is the number of the row of names, from 1
        on, or 0 for none.
        """
        kinds = [tuple(map(kind_of, row)) if row else () for row in rows]
        if named_row:
            kinds[:named_row] = [()] * min(named_row, len(kinds))
        have_numbers = ["number" in row or "stamp" in row for row in kinds]
        columns = _usual_length(
            # A row without numbers ends a block, but its length must not be that of the table.
            [len(row) if has else -len(row) for row, has in zip(kinds, have_numbers, strict=True)]
        )
        if not columns:
            return None
        usual = _usual_kinds([row for row, has in zip(kinds, have_numbers, strict=True) if has], columns)
        full = [k for k, row in enumerate(kinds) if have_numbers[k] and len(row) >= columns]
        start = next((k for k in full if not _contradicts(kinds[k], usual)), full[0])
        names, units, begin = _names_above(rows, start, columns, named_row)
        return cls(names, units, start, begin, columns, usual)


class Layout(NamedTuple):
    """How the lines of a text hold a table."""

    header: Header
    separator: str
    has_comma: bool | None  # whether decimals have a comma; None if no number has decimals


def is_data(line: str) -> bool:
    """Return True for a line of CSV that is neither blank nor a comment."""
    return bool(line.strip()) and not COMMENT.match(line)


def is_numeric(cell: str) -> bool:
    """Return True if a cell is a number, with a point or a comma before decimals."""
    return bool(NUMBER.match(cell))


def kind_of(cell: str) -> str:
    """Return the kind of a cell: number, stamp, text or "" for a missing one."""
    if not cell:
        return ""
    return "number" if is_numeric(cell) else "stamp" if is_stamp(cell) else "text"


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without blanks around them."""
    if separator == BLANKS:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    return [cell.strip() for cell in next(csv.reader(io.StringIO(line), delimiter=separator), [])]


def find_layout(lines: Sequence[str], where: str, named_line: int | None = None) -> Layout:
    """Return the layout of the first lines of a text; `named_line` is the number of its line of names.

    Raises InputError if no line holds numbers.
    """
    best: tuple[tuple[float, bool, int], Layout] | None = None
    for separator in SEPARATORS:
        rows = [split_cells(line, separator) if is_data(line) else None for line in lines]
        header = Header.find(rows, named_line)
        if header is None:
            continue
        if not header.names and named_line is None:
            header = _named_by_comment(header, lines, separator)
        block = [row for row in rows[header.start :] if row and len(row) >= header.columns]
        kinds = [kind_of(cell) for row in block for cell in row if cell]
        share = (len(kinds) - kinds.count("text")) / max(len(kinds), 1)
        score = share, len(header.names) == header.columns, header.columns
        if best is None or score > best[0]:
            numbers = [cell for row in block for cell in row if is_numeric(cell)]
            commas = any(WITH_COMMA.match(cell) for cell in numbers)
            points = any("." in cell for cell in numbers)
            has_comma = commas and not points if commas or points else None
            best = score, Layout(header, separator, False if separator == "," else has_comma)
    if best is None:
        raise _no_numbers(lines, where)
    return best[1]


def _usual_length(lengths: Sequence[int]) -> int:
    """Return the cells of the rows in the longest block of rows with as many.

    Of equal blocks, that of the most rows in all and then of the most cells is taken. A negative number of
    cells is that of a row without numbers. Rows without cells, such as blank lines and comments, do not end
    a block.
    """
    total = Counter(lengths)
    best, cells, rows = (0, 0, 0), 0, 0
    for length in filter(None, lengths):
        rows = rows + 1 if length == cells else 1
        cells = length
        best = max(best, (rows, total[length], cells)) if length > 0 else best
    return best[2]


def _usual_kinds(rows: Sequence[tuple[str, ...]], columns: int) -> tuple[str, ...]:
    """Return what each column holds in most of the rows that have a value there."""
    usual = []
    for k in range(columns):
        found = [row[k] for row in rows if len(row) == columns and row[k]]
        usual.append(max(("number", "stamp", "text"), key=found.count) if found else "")
    return tuple(usual)


def _contradicts(kinds: tuple[str, ...], usual: tuple[str, ...]) -> bool:
    """Return True if a row has a text where the others have numbers, as a line of names has."""
    return any(kind == "text" != other for kind, other in zip(kinds, usual, strict=False) if other)


def _row_before(rows: Sequence[Cells | None], start: int) -> int | None:
    """Return the index of the last row with cells before `start`."""
    return next((k for k in reversed(range(start)) if rows[k]), None)


def _names_above(
    rows: Sequence[Cells | None], start: int, columns: int, named_row: int | None
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Return the names and the units above the rows of numbers, and where they begin."""
    if named_row is not None:
        row = rows[named_row - 1] if 0 < named_row <= len(rows) else None
        below = rows[named_row] if row and named_row < start else None
        return tuple(row or ()), _units(below, columns), named_row - 1 if row else start
    above = _row_before(rows, start)
    row = rows[above] if above is not None else None
    if above is None or not row or not _is_names(row, columns):
        return (), (), start
    second = _row_before(rows, above)
    if (units := _units(row, columns)) and second is not None:
        names = rows[second]
        if names and _is_names(names, columns):
            return tuple(names), units, second
    return tuple(row), (), above


def _is_names(row: Cells, columns: int) -> bool:
    kinds = [kind_of(cell) for cell in row]
    if len(row) < columns:
        return len(row) >= max(SHARE_OF_NAMES * columns, 2) and set(kinds) == {"text"}
    return "text" in kinds


def _units(row: Cells | None, columns: int) -> tuple[str, ...]:
    """Return the units in a row, without brackets, or nothing if it holds something else."""
    units = [match[1].strip() if (match := _BRACKETS.match(cell)) else cell for cell in row or ()]
    is_unit = [not cell or bool(_BRACKETS.match(cell)) or cell.lower() in UNITS for cell in row or ()]
    return tuple(units) if len(units) >= columns and any(units) and all(is_unit) else ()


def _named_by_comment(header: Header, lines: Sequence[str], separator: str) -> Header:
    """Return a header with the names in the comment just before the numbers, if it has as many."""
    comment = COMMENT.sub("", lines[header.start - 1], count=1) if header.start else ""
    names = split_cells(comment, separator)
    fits = comment.strip() and len(names) == header.columns > 1 and _is_names(names, header.columns)
    return header._replace(names=tuple(names), begin=header.start - 1) if fits else header


def _no_numbers(lines: Sequence[str], where: str) -> InputError:
    first = next(filter(is_data, lines), "").strip()
    if len(re.split(r"\s*\|\s*", first)) > 2:
        return InputError(
            f"{where}: bars separate the columns of '{first[:60]}'",
            allowed=ROWS,
            remedy="write the file with one of these between its columns",
        )
    named = f"; its first line is '{first[:60]}'" if first else ""
    return InputError(f"{where} has no line of numbers{named}", allowed=ROWS, remedy="record it again")

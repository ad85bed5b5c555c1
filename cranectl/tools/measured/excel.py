"""Read the sheets of an Excel workbook, and name other archives that are no workbook."""

from array import array
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile, ZipFile

import numpy as np

from cranectl.support import Header, InputError, ReadColumn, TableHead

HEAD_ROWS = 1000  # in which the names are looked for
MAX_SHEET_COLUMNS = 16_384  # of Excel
WORKBOOK = "xl/workbook.xml"
# A member that tells what an archive is, and what it is called.
ARCHIVES = {
    "xl/workbook.bin": "a binary Excel workbook (.xlsb)",
    "content.xml": "an OpenDocument file, such as a workbook of LibreOffice (.ods)",
    "word/document.xml": "a Word document",
    "modelDescription.xml": "an FMU",
    "simulink/blockdiagram.xml": "a Simulink model",
}


class _Column(NamedTuple):
    """A column of a sheet."""

    values: Any  # numbers; NaN for missing cells and for texts
    texts: list[str]  # those that are no numbers, as many as `values` if they are time stamps
    is_time: bool


def read_excel(path: Path, where: str) -> TableHead:
    """Return the head of a workbook; the rows of a sheet are read when one of its columns is."""
    check_archive(path, where)
    from openpyxl import load_workbook

    book = load_workbook(path, read_only=True, data_only=True)
    headers: dict[str, Header] = {}
    left_out = []
    for sheet in book.worksheets:
        rows = [[_text(cell) for cell in row] for row in islice(_rows(sheet), HEAD_ROWS)]
        if header := Header.find([row if any(row) else None for row in map(_trimmed, rows)]):
            headers[sheet.title] = header
        else:
            left_out.append(f"sheet {sheet.title} (no rows of numbers)")
    left_out += [f"sheet {sheet.title} (a chart)" for sheet in book.chartsheets]
    names, units, places = [], [], []
    for title, header in headers.items():
        before = f"{title}." if len(headers) > 1 else ""
        for k in range(max(header.columns, len(header.names))):
            name = header.names[k] if k < len(header.names) else ""
            names.append(before + (name or str(k + 1)))
            units.append(header.units[k] if k < len(header.units) else "")
            places.append((title, k))
    if not names:
        held = f"; it has {', '.join(left_out)}" if left_out else ""
        raise InputError(
            f"{where} has no rows of numbers{held}", allowed=TableHead.READABLE, remedy="save it as CSV"
        )
    sheet_columns = lru_cache(maxsize=1)(lambda title: _columns(book[title], headers[title], where))

    def load(column: int, _: bool) -> ReadColumn:
        title, k = places[column]
        return _as_numbers(sheet_columns(title)[k], names[column], where)

    return TableHead(where, tuple(names), load, tuple(units), tuple(left_out))


def check_archive(path: Path, where: str) -> None:
    """Raise InputError for an archive that is no Excel workbook, with what it is."""
    try:
        with ZipFile(path) as archive:
            members = archive.namelist()
    except (BadZipFile, ValueError, NotImplementedError) as error:
        raise InputError(
            f"{where} begins as a zip archive or Excel workbook, but is damaged: {error}",
            allowed=TableHead.READABLE,
            remedy="save the workbook again, or copy the file again",
        ) from None
    if WORKBOOK in members:
        return
    kinds = [name for member, name in ARCHIVES.items() if member in members]
    if members and all(member.endswith(".npy") for member in members):
        kinds.append("a NumPy archive (.npz)")
    shown = (", ".join(members[:3]) or "nothing") + (", …" if len(members) > 3 else "")
    raise InputError(
        f"{where} is {kinds[0] if kinds else f'a zip archive with {shown}'}",
        allowed=TableHead.READABLE,
        remedy="save it as CSV" if kinds else "unpack it, and name the file in it",
    )


def _rows(sheet: Any) -> Iterator[tuple[Any, ...]]:
    """Yield all rows of a sheet, whatever size it states."""
    sheet.reset_dimensions()
    return iter(sheet.iter_rows(values_only=True, max_col=MAX_SHEET_COLUMNS))


def _text(cell: Any) -> str:
    """Return a cell as a text of CSV would have it."""
    if hasattr(cell, "isoformat"):
        return f"2000-01-01 {cell}" if not hasattr(cell, "year") else f"{cell:%Y-%m-%d %H:%M:%S}"
    if hasattr(cell, "total_seconds"):
        return str(float(cell.total_seconds()))
    return "" if cell is None else str(cell).strip()


def _trimmed(row: Sequence[str]) -> Sequence[str]:
    """Return a row without the empty cells at its end."""
    length = next((k for k in reversed(range(len(row))) if row[k]), -1) + 1
    return row[:length]


def _columns(sheet: Any, header: Header, where: str) -> list[_Column]:
    """Read the numbers of a sheet."""
    width = max(header.columns, len(header.names))
    numbers = [array("d") for _ in range(width)]
    texts: list[list[str]] = [[] for _ in range(width)]
    times = [False] * width
    for number, row in enumerate(_rows(sheet)):
        if number < header.start or not any(cell is not None for cell in row):
            continue
        for k in range(width):
            value, is_time = _number(row[k] if k < len(row) else None)
            numbers[k].append(np.nan if isinstance(value, str) else value)
            times[k] |= is_time
            if isinstance(value, str):
                texts[k].append(value)
        if not number % HEAD_ROWS:
            ReadColumn.check_length(number, where)
    return [_Column(*column) for column in zip(map(np.array, numbers), texts, times, strict=True)]


def _number(cell: Any) -> tuple[float | str, bool]:
    """Return a cell as a number, NaN if it is missing, or as a text; and whether it is a time."""
    if hasattr(cell, "timestamp"):
        return float(np.datetime64(cell, "us").astype(np.int64)) * 1e-6, True
    if hasattr(cell, "total_seconds"):
        return float(cell.total_seconds()), True
    if hasattr(cell, "microsecond"):  # a time of day
        return 3600.0 * cell.hour + 60.0 * cell.minute + cell.second + 1e-6 * cell.microsecond, True
    if isinstance(cell, int | float):
        return float(cell), False
    return (np.nan if cell is None or not str(cell).strip() else str(cell)), False


def _as_numbers(column: _Column, name: str, where: str) -> ReadColumn:
    """Return a column as numbers; raise InputError for texts that are neither numbers nor times."""
    import pyarrow as pa

    values, texts = column.values, column.texts
    if texts and len(texts) == len(values):
        return ReadColumn.of_arrow(pa.chunked_array([pa.array(texts)]), name, where)
    if texts:
        raise ReadColumn.not_numbers(where, name, f"the text '{texts[0][:40]}'")
    if column.is_time:
        known = values[np.isfinite(values)]
        return ReadColumn(values - known[:1] if len(known) else values, is_time=True)
    return ReadColumn(values)

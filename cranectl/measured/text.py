"""Read columns of numbers from text files, as programs for measuring write them."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cranectl.measured.columns import (
    HEAD_BYTES,
    READABLE,
    ReadColumn,
    TableHead,
    check_rows,
    from_arrow,
    not_numbers,
)
from cranectl.reference.tables import COMMENT, SEPARATORS, is_data, is_numeric, split_cells
from cranectl.support.errors import InputError


def read_text(path: Path, begins: bytes, where: str) -> TableHead:
    """Return the head of a text file with columns."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    encoding = _encoding(begins)
    whole = begins if len(begins) < HEAD_BYTES else begins[: begins.rfind(b"\n") + 1]
    lines = whole.decode(encoding, "replace").removeprefix("\ufeff").splitlines()
    names, separator, skipped = _header(lines, where)
    data = list(filter(is_data, lines[skipped:]))
    first = split_cells(data[0], separator) if data else []
    names = (*names, *(str(k) for k in range(len(names) + 1, len(first) + 1)))  # columns without a name
    commas = (
        separator != ","
        and any(re.search(r"\d,\d", line) for line in data)
        and not any(re.search(r"\d\.\d", line) for line in data)
    )
    unique = [str(k) for k in range(len(names))]

    def refused(row: Any) -> str:
        text = row.text or ""
        if COMMENT.match(text):
            return "skip"
        wrong.append(row)
        return "error"

    wrong: list[Any] = []

    def read(column: int) -> ReadColumn:
        name, is_number = unique[column], column >= len(first) or _is_number(first[column])
        try:
            # Block by block: all columns of a large file would take several times its size.
            with arrow.open_csv(
                path,
                read_options=arrow.ReadOptions(column_names=unique, skip_rows=skipped, encoding=encoding),
                parse_options=arrow.ParseOptions(delimiter=separator, invalid_row_handler=refused),
                convert_options=arrow.ConvertOptions(
                    column_types={name: pa.float64()} if is_number else None,
                    decimal_point="," if commas else ".",
                    include_columns=[name],
                ),
            ) as blocks:
                column_blocks = [block.column(0) for block in blocks]
        except pa.ArrowInvalid as error:
            if wrong:
                raise _uneven(wrong[0], where) from error
            if match := re.search(r"invalid value '(.*)'", str(error)):
                raise not_numbers(where, names[column], f"the text '{match[1][:40]}'") from error
            raise
        values = from_arrow(pa.chunked_array(column_blocks), names[column], where)
        del column_blocks
        pa.default_memory_pool().release_unused()  # or an hour at 1 kHz takes 100 MiB more
        check_rows(len(values.values), where)
        return values

    return TableHead(tuple(names), read)


def _uneven(row: Any, where: str) -> InputError:
    return InputError(
        f"{where}: a line has {row.actual_columns} cells, others have {row.expected_columns}: "
        f"{str(row.text)[:60]}",
        allowed="as many cells in each line",
        remedy="correct that line, or leave it out",
    )


def _encoding(begins: bytes) -> str:
    if begins.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        begins[: begins.rfind(b"\n") + 1 or len(begins)].decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _header(lines: Sequence[str], where: str) -> tuple[Sequence[str], str, int]:
    """Return the names of columns, or their numbers; the separator; and the lines before the numbers."""
    first = next((k for k, line in enumerate(lines) if is_data(line)), None)
    if first is None:
        raise InputError(f"{where} has no line of numbers", allowed=READABLE, remedy="record it again")
    after = next(filter(is_data, lines[first + 1 :]), lines[first])
    separator = max(SEPARATORS, key=after.count)
    cells = split_cells(lines[first], separator)
    if not all(map(_is_number, cells)):
        return cells, separator, first + 1
    comment = COMMENT.sub("", lines[first - 1], count=1) if first else ""
    named = split_cells(comment, separator)
    if comment.strip() and len(named) == len(cells) > 1:  # the last comment is the line of names
        return named, separator, first
    return [str(k) for k in range(1, len(cells) + 1)], separator, first


def _is_number(cell: str) -> bool:
    """Return True for a number or an empty cell."""
    return not cell or is_numeric(cell)

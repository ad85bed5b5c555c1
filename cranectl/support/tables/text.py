"""Read columns of numbers from text files, as programs for measuring write them.

Arrow reads plain files. Other encodings, blanks between columns, and rows of different lengths are first
rewritten line by line.
"""

import codecs
import io
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from cranectl.support.errors import InputError
from cranectl.support.file_kinds import BYTE_ORDER_MARK
from cranectl.support.tables.columns import ReadColumn
from cranectl.support.tables.layout import (
    BLANKS,
    ROWS,
    Header,
    Layout,
    find_layout,
    is_data,
    is_numeric,
    split_cells,
)

HEAD_BYTES = 2**20  # bytes in which names, separator and decimal point are looked for
HEAD_LINES = 1000  # lines of them
MAX_LINE = 2**20  # [bytes] of a line
_PLAIN = ("utf-8", "latin-1")  # encodings that Arrow is given
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")  # bytes that no text in these encodings has


class _Text(NamedTuple):
    """A text file: where it is, and how its bytes are characters."""

    source: Path | bytes
    where: str
    encoding: str

    def open(self) -> BinaryIO:
        return io.BytesIO(self.source) if isinstance(self.source, bytes) else self.source.open("rb")

    def lines(self) -> Iterator[str]:
        """Yield all lines; raise InputError for one that is too long."""
        with io.TextIOWrapper(self.open(), self.encoding, errors="replace") as text:
            while line := text.readline(MAX_LINE + 1):
                if len(line) > MAX_LINE:
                    raise _too_long(self.where)
                yield line.rstrip("\n").removeprefix(BYTE_ORDER_MARK)


def read_text(
    source: Path | bytes, where: str, named_line: int | None, needs_names: bool, longest: int
) -> tuple[tuple[str, ...], Callable[[int, bool], ReadColumn], tuple[str, ...], tuple[str, ...]]:
    """Return names of columns, how to load one, units, and what is left out, as `TableHead.of_text`."""
    with io.BytesIO(source) if isinstance(source, bytes) else source.open("rb") as stream:
        encoding = _check(stream, where, longest)
    text = _Text(source, where, encoding)
    lines = list(islice(_head(text), HEAD_LINES))
    layout = find_layout(lines, where, named_line)
    if needs_names and not layout.header.names:
        layout = layout._replace(header=_numbered(lines, layout, where))
    header = layout.header
    width = max(header.columns, len(header.names))
    padded = (*header.names, *[""] * (width - len(header.names)))
    names = tuple(name or str(k) for k, name in enumerate(padded, 1))
    units = (*header.units, *[""] * (width - len(header.units)))[:width] if header.units else ()
    return names, partial(_load, text, layout, names), units, _skipped(lines, header.begin)


def _head(text: _Text) -> Iterator[str]:
    """Yield the first lines, about HEAD_BYTES of them."""
    left = HEAD_BYTES
    for line in text.lines():
        yield line
        left -= len(line)
        if left < 0:
            return


def _skipped(lines: list[str], begin: int) -> tuple[str, ...]:
    """Return in words the lines before the names that are not read."""
    other = [k for k in range(begin) if is_data(lines[k])]
    if not other:
        return ()
    numbers = f"line {other[0] + 1}" if len(other) == 1 else f"lines {other[0] + 1} to {other[-1] + 1}"
    return (f"{numbers} before the names, '{lines[other[0]].strip()[:60]}'",)


def _check(stream: BinaryIO, where: str, longest: int) -> str:
    """Return the encoding of a text; raise InputError if it is no text, or too many rows."""
    begins = stream.read(4096)
    if wide := _wide_encoding(begins):
        return wide
    if match := _CONTROL.search(begins):
        raise _no_text(where, match.start())
    stream.seek(0)
    decoder, encoding, rows, position, since_end = codecs.getincrementaldecoder("utf-8")(), "utf-8", 0, 0, 0
    while block := stream.read(MAX_LINE):
        if (zero := block.find(b"\0")) >= 0:
            raise _no_text(where, position + zero)
        ends = max(block.count(b"\n"), block.count(b"\r"))
        rows, position = rows + ends, position + len(block)
        since_end = 0 if ends else since_end + len(block)
        if since_end >= MAX_LINE:
            raise _too_long(where)
        if encoding == "utf-8":
            try:
                decoder.decode(block)
            except UnicodeDecodeError:
                encoding = "latin-1"
    ReadColumn.check_length(rows, where, longest)
    return encoding


def _wide_encoding(begins: bytes) -> str:
    """Return the encoding of a text with two bytes for each character, or an empty text."""
    if begins.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    # Of Latin letters and digits, one byte of the two is zero; 256 characters leave no doubt, and nine in
    # ten allow for units such as Ω and ‰.
    even, odd = begins[0:512:2], begins[1:512:2]
    for zeros, others, encoding in ((odd, even, "utf-16-le"), (even, odd, "utf-16-be")):
        if len(zeros) > 4 and zeros.count(0) > 0.9 * len(zeros) and b"\0" not in others:
            return encoding
    return ""


def _no_text(where: str, position: int) -> InputError:
    return InputError(
        f"{where} is no text, and no other kind of file that is known: it has a control character in byte "
        f"{position + 1}",
        allowed=ROWS,
        remedy="save it as CSV or Parquet",
    )


def _too_long(where: str) -> InputError:
    return InputError(
        f"{where} has a line of more than {MAX_LINE // 2**20} MiB",
        allowed="a row of the table in each line",
        remedy="save it as CSV or Parquet",
    )


def _numbered(lines: list[str], layout: Layout, where: str) -> Header:
    """Return a header with the numbers that pandas writes for unnamed columns, else raise InputError."""
    header, separator = layout.header, layout.separator
    start = next(k for k in range(header.start, len(lines)) if is_data(lines[k]))
    first = split_cells(lines[start], separator)
    if len(first) > 1 and first == [str(k) for k in range(len(first))]:
        return header._replace(names=tuple(first), begin=start, start=start + 1)
    begins = "" if is_data(lines[0]) else "begins with a comment and "
    separator = ";" if separator == BLANKS else separator
    raise InputError(
        f"{where} {begins}has no line of names: its first line of cells is '{lines[start].strip()[:60]}'",
        allowed="the names of the columns in the line before the numbers",
        remedy=f"write a line of names before it, such as {separator.join(('time', 'x', 'y', 'z'))}",
    )


def _load(text: _Text, layout: Layout, names: tuple[str, ...], column: int, is_clock: bool) -> ReadColumn:
    """Return one column of a text."""
    import pyarrow as pa

    header, where = layout.header, text.where
    kind = header.kinds[column] if column < len(header.kinds) else "text"
    try:
        read = _convert(text, layout, len(names), column, has_comma=bool(layout.has_comma), kind=kind)
    except pa.ArrowInvalid as error:
        match = re.search(r"invalid value '(.*)'", str(error), re.DOTALL)
        if match and layout.has_comma is None and is_numeric(match[1]):  # the first decimals come late
            read = _convert(text, layout, len(names), column, has_comma=True, kind=kind)
        elif match:
            raise ReadColumn.not_numbers(
                where, names[column], _find(text, layout, column, match[1])
            ) from None
        else:
            for _ in _rewritten(text, layout, len(names)):  # names the line that Arrow does not number
                pass
            raise
    values = ReadColumn.of_arrow(read, names[column], where, is_clock=is_clock)
    del read
    pa.default_memory_pool().release_unused()  # or an hour at 1 kHz takes 100 MiB more
    return values


def _convert(text: _Text, layout: Layout, width: int, column: int, *, has_comma: bool, kind: str) -> Any:
    """Return a column as Arrow reads it, numbers or texts; all columns would take several times its size."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    header = layout.header

    def read(*, is_plain: bool) -> Any:
        unique = [str(k) for k in range(width)]
        source = text.open() if is_plain else pa.PythonFile(_Rewritten(text, layout, width), mode="r")
        with (
            source,
            arrow.open_csv(
                source,
                read_options=arrow.ReadOptions(
                    column_names=unique,
                    skip_rows=header.start if is_plain else 0,
                    encoding=text.encoding if is_plain else "utf-8",
                    block_size=4 * MAX_LINE,  # Arrow refuses a row longer than a block
                ),
                parse_options=arrow.ParseOptions(
                    delimiter="\t" if layout.separator == BLANKS else layout.separator
                ),
                convert_options=arrow.ConvertOptions(
                    column_types={unique[column]: pa.float64() if kind in ("number", "") else pa.string()},
                    decimal_point="," if has_comma else ".",
                    include_columns=[unique[column]],
                    strings_can_be_null=True,
                ),
            ) as blocks,
        ):
            return pa.chunked_array([block.column(0) for block in blocks])

    if text.encoding in _PLAIN and layout.separator != BLANKS and 1 < width == header.columns:
        # Rows of another length may be comments. Arrow's own handler of them fails for damaged characters.
        with suppress(pa.ArrowInvalid):
            return read(is_plain=True)
    return read(is_plain=False)


def _rewritten(text: _Text, layout: Layout, width: int) -> Iterator[str]:
    """Yield the rows of a table with the same number of cells; raise InputError for a row of another length.

    A row may lack cells at its end that most rows lack, such as events.
    """
    separator, usual = layout.separator, layout.header.columns
    for number, line in enumerate(text.lines(), 1):
        if number <= layout.header.start or not is_data(line):
            continue
        plain = "\t".join(line.split()) if separator == BLANKS else line
        mark = "\t" if separator == BLANKS else separator
        cells = len(split_cells(line, separator)) if '"' in plain else plain.count(mark) + 1
        if not usual <= cells <= width:
            raise InputError(
                f"{text.where}: line {number} has {cells} cells, "
                f"{'the line of names has' if layout.header.names else 'others have'} {width}: "
                f"{line.strip()[:60]}",
                allowed=f"as many cells in each line, '{mark}' between them".replace(
                    "'\t'", "a tab or blanks"
                ),
                remedy="correct that line, or leave it out",
            )
        yield f"{plain}{mark * (width - cells)}\n"


class _Rewritten(io.RawIOBase):
    """The rows of a table as a file in UTF-8."""

    def __init__(self, text: _Text, layout: Layout, width: int) -> None:
        self._rows = _rewritten(text, layout, width)
        self._left = b""

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1, /) -> bytes:
        parts, length = [self._left], len(self._left)
        while size < 0 or length < size:
            rows = "".join(islice(self._rows, 1000)).encode("utf-8")
            if not rows:
                break
            parts.append(rows)
            length += len(rows)
        content = b"".join(parts)
        end = len(content) if size < 0 else size
        self._left = content[end:]
        return content[:end]


def _find(text: _Text, layout: Layout, column: int, value: str) -> str:
    """Return in words a text in a column of numbers, with the number of its line."""
    for number, line in enumerate(text.lines(), 1):
        if number > layout.header.start and is_data(line):
            cells = split_cells(line, layout.separator)
            if len(cells) > column and cells[column] == value.strip():
                return f"the text '{value[:40]}', in line {number}"
    return f"the text '{value[:40]}'"

"""Read columns of numbers from the files that measuring systems write.

The type of a file is recognised by how it begins. Sizes and types are checked before the numbers are read.
"""

import csv
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cranectl.support.arrays import Array
from cranectl.support.documents import format_of
from cranectl.support.errors import InputError, unknown_name
from cranectl.support.files import open_input

MAX_BYTES = 2**31  # of a file
MAX_ROWS = 20_000_000
HEAD = 2**16  # bytes in which names, separator and decimal point are looked for
SEPARATORS = ";\t,"  # the first of those that a line has equally often: a comma may be decimal
READABLE = "CSV, Parquet, MCAP, MATLAB (.mat), Excel (.xlsx) or a ROS bag"
TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # [s], of time stamps
_COMMENT = re.compile(r"\s*(#|//|%|sep=.$)")

Key = int | str  # of a column: its number from 1 on, or its name


class ReadColumn(NamedTuple):
    """One column of a file."""

    values: Array  # (N,) NaN for missing cells
    is_time: bool = False  # whether they are time stamps, in seconds after the first


class TableHead(NamedTuple):
    """What a file holds, before its numbers are read."""

    names: tuple[str, ...]  # of the columns; their numbers where the file has no names
    rows: int | None  # None: not known before reading
    read: Callable[[int], ReadColumn]  # a column by its index from 0 on
    first: tuple[str, ...] = ()  # the first row as text, where the file is text

    def column(self, key: Key, where: str) -> int:
        """Return the index of a column; raise InputError if it is missing or its name is not unique."""
        if isinstance(key, int):
            if key <= len(self.names):
                return key - 1
            raise InputError(
                f"{where}: column {key} of {len(self.names)}",
                allowed=f"numbers from 1 to {len(self.names)}",
                remedy="cranectl new map FILE shows what the file holds",
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


def read_head(path: Path) -> TableHead:
    """Return what the file at `path` holds; raise InputError for another kind of file."""
    where = str(path)
    try:
        with open_input(path) as stream:
            begins = stream.read(HEAD)
        size = path.stat().st_size
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise InputError(
            f"cannot read {where}: {error}", allowed=READABLE, remedy="name a file that can be read"
        ) from None
    if size > MAX_BYTES:
        raise InputError(
            f"{where} has {size / 2**30:.3g} GiB",
            allowed=f"at most {MAX_BYTES / 2**30:g} GiB",
            remedy="write the columns that are needed as Parquet, or cut the file into parts",
        )
    if not begins:
        raise InputError(f"{where} is empty", allowed=READABLE, remedy="record it again")
    with _reported(where):
        for start, reader in READERS.items():
            if begins.startswith(start):
                return reader(path, where)
        if (kind := format_of(begins)) and not begins.startswith((b"\xff\xfe", b"\xfe\xff", b"{")):
            raise InputError(f"{where} is {kind}", allowed=READABLE, remedy="save it as CSV or Parquet")
        return _csv(path, begins, where)


@contextmanager
def _reported(where: str) -> Iterator[None]:
    """Raise InputError for the errors of libraries that read a broken file."""
    try:
        yield
    except InputError:
        raise
    except ImportError as error:
        package, extra = _EXTRAS.get(str(error.name), (str(error.name), "import"))
        raise InputError(
            f"{where}: this kind of file needs {package}, which is not installed",
            allowed="CSV, Parquet, MCAP and MATLAB files up to version 7 without it",
            remedy=f"pip install 'cranectl[{extra}]', or save the file as CSV",
        ) from None
    except Exception as error:  # files may break a library in any way
        raise InputError(
            f"cannot read {where}: {type(error).__name__}: {str(error)[:200]}",
            allowed=READABLE,
            remedy="write the file again, for example as CSV",
        ) from None


_EXTRAS = {
    "openpyxl": ("openpyxl", "import"),
    "rosbags": ("rosbags", "import"),
    "matio": ("mat-io", "import"),
}


def _checked_rows(rows: int, where: str) -> int:
    if rows > MAX_ROWS:
        raise InputError(
            f"{where} has {rows} rows",
            allowed=f"at most {MAX_ROWS}",
            remedy="leave out rows, for example every second one",
        )
    return rows


def _not_numbers(where: str, name: str, holds: str) -> InputError:
    return InputError(
        f"{where}: column '{name}' holds {holds}",
        allowed="numbers; a clock may also have time stamps",
        remedy="map another column, or write numbers",
    )


def _csv(path: Path, begins: bytes, where: str) -> TableHead:
    """Return the head of a text file with columns."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    encoding = _encoding(begins)
    whole = begins if len(begins) < HEAD else begins[: begins.rfind(b"\n") + 1]
    lines = whole.decode(encoding, "replace").removeprefix("\ufeff").splitlines()
    names, separator, skipped = _header(lines, where)
    data = [line for line in lines[skipped:] if line.strip() and not _COMMENT.match(line)]
    first = tuple(_cells(data[0], separator)) if data else ()
    names = (*names, *(str(k) for k in range(len(names) + 1, len(first) + 1)))  # columns without a name
    commas = (
        separator != ","
        and any(re.search(r"\d,\d", line) for line in data)
        and not any(re.search(r"\d\.\d", line) for line in data)
    )
    unique = [str(k) for k in range(len(names))]

    def refused(row: Any) -> str:
        text = row.text or ""
        if _COMMENT.match(text):
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
                raise _not_numbers(where, names[column], f"the text '{match[1][:40]}'") from error
            raise
        values = _from_arrow(pa.chunked_array(column_blocks), names[column], where)
        _checked_rows(len(values.values), where)
        return values

    return TableHead(tuple(names), None, read, first)


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
    first = next((k for k, line in enumerate(lines) if line.strip() and not _COMMENT.match(line)), None)
    if first is None:
        raise InputError(f"{where} has no line of numbers", allowed=READABLE, remedy="record it again")
    after = next(
        (line for line in lines[first + 1 :] if line.strip() and not _COMMENT.match(line)), lines[first]
    )
    separator = max(SEPARATORS, key=after.count)
    cells = _cells(lines[first], separator)
    if not all(map(_is_number, cells)):
        return cells, separator, first + 1
    comment = _COMMENT.sub("", lines[first - 1], count=1) if first else ""
    named = _cells(comment, separator)
    if comment.strip() and len(named) == len(cells) > 1:  # the last comment is the line of names
        return named, separator, first
    return [str(k) for k in range(1, len(cells) + 1)], separator, first


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader(io.StringIO(line), delimiter=separator), [])]


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", ".") or "nan")
    except ValueError:
        return False
    return True


def _from_arrow(column: Any, name: str, where: str) -> ReadColumn:
    import pyarrow as pa

    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        ticks = column.cast(pa.int64()).to_numpy()
        return ReadColumn((ticks - ticks[:1]) * TICKS[kind.unit], is_time=True)
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
        text = next((cell for cell in column.to_pylist()[:1000] if isinstance(cell, str)), "")
        raise _not_numbers(where, name, f"the text '{text[:40]}'" if text else f"values of the type {kind}")
    return ReadColumn(column.cast(pa.float64()).to_numpy())


def _parquet(path: Path, where: str) -> TableHead:
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        names, rows = tuple(file.schema_arrow.names), _checked_rows(file.metadata.num_rows, where)

    def read(column: int) -> ReadColumn:
        return _from_arrow(parquet.read_table(path, columns=[names[column]]).column(0), names[column], where)

    return TableHead(names, rows, read)


def _arrays(where: str, arrays: Mapping[str, Array]) -> TableHead:
    """Return the head of a file that is in memory; its columns may have different lengths."""
    names = tuple(arrays)
    if not names:
        raise InputError(f"{where} has no columns of numbers", allowed=READABLE, remedy="save it as CSV")
    rows = _checked_rows(max(map(len, arrays.values())), where)
    return TableHead(names, rows, lambda column: ReadColumn(arrays[names[column]]))


def _matlab(path: Path, where: str) -> TableHead:
    from scipy.io import loadmat, whosmat

    described = whosmat(path)
    _checked_rows(max((max(shape) for _, shape, _ in described if shape), default=0), where)
    content = loadmat(path, squeeze_me=True, struct_as_record=False)
    if any(kind in ("opaque", "unknown") for *_, kind in described):
        from matio import load_from_mat  # tables and timetables are MATLAB objects

        content = load_from_mat(str(path))
    arrays: dict[str, Array] = {}

    def collect(name: str, value: Any, depth: int = 0) -> None:
        if depth > 4:
            return
        fields = getattr(value, "_fieldnames", None)
        if fields is not None or isinstance(value, Mapping):
            for field in fields if fields is not None else value:
                inner = getattr(value, field) if fields is not None else value[field]
                collect(f"{name}.{field}" if name else str(field), inner, depth + 1)
        elif hasattr(value, "columns"):  # a table
            for column in value.columns:
                collect(f"{name}.{column}", value[column].to_numpy(), depth + 1)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim in (1, 2):
            table = value.reshape(len(value), -1).astype(np.float64)
            for k in range(table.shape[1]):
                arrays[f"{name}:{k + 1}" if table.shape[1] > 1 else name] = table[:, k]

    for name, value in content.items():
        if not name.startswith("__"):
            collect(name, value)
    return _arrays(where, arrays)


def _excel(path: Path, where: str) -> TableHead:
    from openpyxl import load_workbook

    book = load_workbook(path, read_only=True, data_only=True)
    sheet = book.worksheets[0]
    _checked_rows(sheet.max_row or 0, where)
    rows = [row for row in sheet.iter_rows(values_only=True) if any(cell is not None for cell in row)]
    book.close()
    if not rows:
        raise InputError(f"{where} has an empty first sheet", allowed=READABLE, remedy="save it as CSV")
    named = not all(isinstance(cell, int | float) or cell is None for cell in rows[0])
    names = [str(cell if cell is not None else k) for k, cell in enumerate(rows[0], 1)] if named else []
    names = names or [str(k) for k in range(1, len(rows[0]) + 1)]
    table = rows[1:] if named else rows

    def read(column: int) -> ReadColumn:
        cells = [row[column] for row in table]
        values = np.array([_cell(cell, names[column], where) for cell in cells])
        is_time = any(hasattr(cell, "timestamp") for cell in cells)
        return ReadColumn(values - values[0] if is_time else values, is_time)

    return TableHead(tuple(names), len(table), read)


def _cell(value: Any, name: str, where: str) -> float:
    if hasattr(value, "timestamp"):
        return float(value.timestamp())
    if value is not None and not isinstance(value, int | float):
        raise _not_numbers(where, name, f"the text '{str(value)[:40]}'")
    return np.nan if value is None else float(value)


def _mcap(path: Path, where: str) -> TableHead:
    """Return the rows of signals of an MCAP file, by topic and signal."""
    from cranectl.mcap_columns.contents import open_contents
    from cranectl.mcap_columns.rows import columns_of, decode_table, signal_names

    arrays: dict[str, Array] = {}
    with path.open("rb") as stream:
        contents = open_contents(path, stream)
        for number, column in columns_of(contents, contents.chunks(stream), lambda _: True).items():
            channel = contents.channels[number]
            names = signal_names(channel, contents.schemas[channel.schema_id])
            topic = channel.topic.removeprefix("/")
            arrays[f"{topic}.time"] = 1e-9 * (column.time_ns - column.time_ns[0])
            for name, values in zip(names, decode_table(column.messages, len(names)).T, strict=True):
                arrays[f"{topic}.{name}"] = values.copy()
    return _arrays(where, arrays)


def _bag(path: Path, where: str) -> TableHead:
    """Return the numbers in the messages of a ROS bag, by topic and field."""
    from rosbags.highlevel import AnyReader

    series: dict[str, list[float]] = {}

    def collect(name: str, value: Any, depth: int = 0) -> None:
        if isinstance(value, bool | int | float):
            series.setdefault(name, []).append(float(value))
        elif (
            isinstance(value, np.ndarray)
            and value.ndim == 1
            and len(value) <= 32
            and value.dtype.kind in "fiu"
        ):
            for k, number in enumerate(value.tolist(), 1):
                series.setdefault(f"{name}:{k}", []).append(float(number))
        elif hasattr(value, "__dataclass_fields__") and depth < 4:
            for field in value.__dataclass_fields__:
                if not field.startswith("__"):
                    collect(f"{name}.{field}", getattr(value, field), depth + 1)

    with AnyReader([path if path.suffix == ".bag" else path.parent]) as reader:
        for connection, time_ns, raw in reader.messages():
            topic = connection.topic.removeprefix("/")
            series.setdefault(f"{topic}.time", []).append(1e-9 * (time_ns - reader.start_time))
            collect(topic, reader.deserialize(raw, connection.msgtype))
    return _arrays(where, {name: np.array(values) for name, values in series.items()})


READERS: dict[bytes, Callable[[Path, str], TableHead]] = {
    b"PAR1": _parquet,
    b"MATLAB 5": _matlab,
    b"PK\x03\x04": _excel,
    b"\x89MCAP": _mcap,
    b"#ROSBAG": _bag,
    b"SQLite format 3": _bag,
}

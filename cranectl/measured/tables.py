"""Read columns of numbers from the files that measuring systems write.

The type of a file is recognised by how it begins. Sizes and types are checked before the numbers are read.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.measured.columns import (
    HEAD_BYTES,
    READABLE,
    ReadColumn,
    TableHead,
    checked_rows,
    from_arrow,
    not_numbers,
)
from cranectl.measured.text import read_text
from cranectl.support.arrays import Array
from cranectl.support.documents import format_of
from cranectl.support.errors import InputError
from cranectl.support.files import open_input

MAX_FILE_BYTES = 2**31  # of a file


def read_head(path: Path) -> TableHead:
    """Return what the file at `path` holds; raise InputError for another kind of file."""
    where = str(path)
    try:
        with open_input(path) as stream:
            begins = stream.read(HEAD_BYTES)
        size = path.stat().st_size
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise InputError(
            f"cannot read {where}: {error}", allowed=READABLE, remedy="name a file that can be read"
        ) from None
    if size > MAX_FILE_BYTES:
        raise InputError(
            f"{where} has {size / 2**30:.3g} GiB",
            allowed=f"at most {MAX_FILE_BYTES / 2**30:g} GiB",
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
        return read_text(path, begins, where)


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


def _parquet(path: Path, where: str) -> TableHead:
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        names, rows = tuple(file.schema_arrow.names), checked_rows(file.metadata.num_rows, where)

    def read(column: int) -> ReadColumn:
        return from_arrow(parquet.read_table(path, columns=[names[column]]).column(0), names[column], where)

    return TableHead(names, rows, read)


def _arrays(where: str, arrays: Mapping[str, Array]) -> TableHead:
    """Return the head of a file that is in memory; its columns may have different lengths."""
    names = tuple(arrays)
    if not names:
        raise InputError(f"{where} has no columns of numbers", allowed=READABLE, remedy="save it as CSV")
    rows = checked_rows(max(map(len, arrays.values())), where)
    return TableHead(names, rows, lambda column: ReadColumn(arrays[names[column]]))


def _matlab(path: Path, where: str) -> TableHead:
    from scipy.io import loadmat, whosmat

    described = whosmat(path)
    checked_rows(max((max(shape) for _, shape, _ in described if shape), default=0), where)
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
    checked_rows(sheet.max_row or 0, where)
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
        raise not_numbers(where, name, f"the text '{str(value)[:40]}'")
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

"""Read columns of numbers from the files that measuring systems write.

The type of a file is recognised by how it begins. Sizes and types are checked before the numbers are read.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.measured.columns import (
    DEEPEST,
    HEAD_BYTES,
    READABLE,
    ReadColumn,
    TableHead,
    check_rows,
    from_arrays,
    from_arrow,
    not_numbers,
)
from cranectl.measured.messages import read_bag, read_mcap
from cranectl.measured.text import read_text
from cranectl.reference.files import SI_FACTORS
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
        package = "mat-io" if error.name == "matio" else error.name
        raise InputError(
            f"{where}: this kind of file needs {package}, which is not installed",
            allowed="CSV, Parquet, MCAP and MATLAB files up to version 7 without it",
            remedy="pip install 'cranectl[import]', or save the file as CSV",
        ) from None
    except Exception as error:  # files may break a library in any way
        raise InputError(
            f"cannot read {where}: {type(error).__name__}: {str(error)[:200]}",
            allowed=READABLE,
            remedy="write the file again, for example as CSV",
        ) from None


def _parquet(path: Path, where: str) -> TableHead:
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        names = tuple(file.schema_arrow.names)
        check_rows(file.metadata.num_rows, where)

    def read(column: int) -> ReadColumn:
        return from_arrow(parquet.read_table(path, columns=[names[column]]).column(0), names[column], where)

    return TableHead(names, read)


def _matlab(path: Path, where: str) -> TableHead:
    """Return the head of a MATLAB file: columns of its arrays, by variable, field and number."""
    from scipy.io import loadmat, whosmat

    try:
        described = whosmat(path)
    except TypeError:  # SciPy knows no size of an object
        described = [("", (), "opaque")]
    check_rows(max((max(shape) for _, shape, _ in described if shape), default=0), where)
    if any(kind in ("opaque", "unknown") for *_, kind in described):
        from matio import load_from_mat  # timeseries, tables and timetables are objects

        content = load_from_mat(str(path))
    else:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    arrays: dict[str, Array] = {}

    def collect(name: str, value: Any, depth: int = 0) -> None:
        if (
            isinstance(value, np.ndarray)
            and value.dtype.kind in "fiu"
            and value.ndim in (1, 2)
            and value.size > 1
        ):
            table = value.T if value.ndim == 2 and value.shape[0] == 1 else value.reshape(len(value), -1)
            for k, column in enumerate(table.T.astype(np.float64), 1):
                arrays[f"{name}:{k}" if table.shape[1] > 1 else name] = column
        elif depth < DEEPEST:
            for field, inner in _fields(value).items():
                collect(f"{name}.{field}", inner, depth + 1)

    for name, value in content.items():
        if not name.startswith("__"):
            collect(name, value)
    return from_arrays(where, arrays)


def _fields(value: Any) -> dict[str, Any]:
    """Return the fields of a MATLAB structure or object, and the columns of a table, by name."""
    if hasattr(value, "columns"):  # of pandas, for a table; the times of a timetable are its index
        times = {} if value.index.name is None else {str(value.index.name): _seconds(value.index)}
        return times | {str(name): value[name].to_numpy() for name in value.columns}
    if hasattr(value, "_fieldnames"):
        return {name: getattr(value, name) for name in value._fieldnames}
    fields = getattr(value, "properties", value)
    return dict(fields) if isinstance(fields, Mapping) else {}


def _seconds(index: Any) -> Any:
    """Return the times of a timetable in seconds after the first."""
    times = index.to_numpy()
    return (times - times[:1]).astype("timedelta64[ns]").astype(np.float64) * SI_FACTORS["ns"]


def _excel(path: Path, where: str) -> TableHead:
    """Return the head of an Excel file; a sheet is read when one of its columns is."""
    from openpyxl import load_workbook

    book = load_workbook(BytesIO(path.read_bytes()), read_only=True, data_only=True)
    sheets = [sheet for sheet in book.worksheets if (sheet.max_row or 0) > 1]
    names: list[str] = []
    places: list[tuple[Any, int, bool]] = []  # sheet, index in its rows, whether its first row has names
    for sheet in sheets:
        check_rows(sheet.max_row, where)
        first = next(_filled_rows(sheet), ())
        named = not all(isinstance(cell, int | float) or cell is None for cell in first)
        before = f"{sheet.title}." if len(sheets) > 1 else ""
        for k, cell in enumerate(first):
            names.append(before + (str(cell) if named and cell is not None else str(k + 1)))
            places.append((sheet, k, named))
    if not names:
        raise InputError(f"{where} has no rows", allowed=READABLE, remedy="save it as CSV")
    rows_of = cache(lambda sheet: list(_filled_rows(sheet)))

    def read(column: int) -> ReadColumn:
        sheet, k, named = places[column]
        with _reported(where):
            cells = [row[k] for row in rows_of(sheet)[named:]]
        values = np.array([_cell(cell, names[column], where) for cell in cells])
        is_time = any(hasattr(cell, "timestamp") for cell in cells)
        return ReadColumn(values - values[0] if is_time else values, is_time)

    return TableHead(tuple(names), read)


def _filled_rows(sheet: Any) -> Iterator[tuple[Any, ...]]:
    rows = sheet.iter_rows(values_only=True)
    return (row for row in rows if any(cell is not None for cell in row))


def _cell(value: Any, name: str, where: str) -> float:
    if hasattr(value, "timestamp"):
        return float(value.timestamp())
    if value is not None and not isinstance(value, int | float):
        raise not_numbers(where, name, f"the text '{str(value)[:40]}'")
    return np.nan if value is None else float(value)


READERS: dict[bytes, Callable[[Path, str], TableHead]] = {
    b"PAR1": _parquet,
    b"MATLAB 5": _matlab,
    b"PK\x03\x04": _excel,
    b"\x89MCAP": read_mcap,
    b"#ROSBAG": read_bag,
    b"SQLite format 3": read_bag,
}

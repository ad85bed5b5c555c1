"""Columns of the arrays in a file, by variable, field and number; each array is read when a column is."""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from math import prod
from typing import Any, Literal, TypeAlias

import numpy as np

from cranectl.support import InputError, ReadColumn, TableHead

DEEPEST = 4  # level of fields in structures and messages that is read
MAX_COLUMNS = 10_000  # of an array; more are pictures
MAX_ELEMENTS = 100  # of an array of structures or cells
MAX_LEFT_OUT = 20  # parts of a file that are named
FEW_ROWS = 10  # below which a run is no run, so that an array with fewer rows has its signals in them

Signals: TypeAlias = Literal["columns", "rows"]


class ArrayColumns:
    """The columns of a file with arrays."""

    def __init__(self, where: str, signals: Signals | None) -> None:
        """Begin without columns; `signals` says what holds a signal, None that it is to be found out."""
        self._where, self._signals = where, signals
        self._columns: dict[str, tuple[str, int, bool]] = {}  # array, index, whether it is a row
        self._arrays: dict[str, Callable[[], Any]] = {}
        self._left_out: list[str] = []
        self._read = lru_cache(maxsize=1)(lambda name: np.squeeze(np.asarray(self._arrays[name]())))

    def add_array(self, name: str, shape: tuple[int, ...], read: Callable[[], Any], kind: str = "f") -> None:
        """Add the columns of an array of numbers that `read` returns; `kind` is that of its NumPy type."""
        sizes = [size for size in shape if size != 1]
        is_table = kind in "fiub" and len(sizes) in (1, 2) and all(sizes)
        if not is_table or max(sizes) > ReadColumn.MAX_LENGTH:
            if prod(shape) > 1:
                size = " × ".join(map(str, shape))
                self.leave_out(name, f"{'numbers' if kind in 'fiub' else 'other values'}, {size}")
            return
        self._arrays[name] = read
        if len(sizes) == 1:
            self._columns[name] = name, 0, False
            return
        are_rows = self._are_rows(name, sizes)
        count = sizes[0] if are_rows else sizes[1]
        if count > MAX_COLUMNS:
            self.leave_out(name, f"{count} signals")
            return
        for k in range(count):
            self._columns[f"{name}:{k + 1}"] = name, k, are_rows

    def _are_rows(self, name: str, sizes: list[int]) -> bool:
        """Return True if the rows of an array hold its signals: time increases along the first of them."""
        if self._signals or sizes[0] >= sizes[1]:
            return self._signals == "rows"
        if sizes[0] < FEW_ROWS <= sizes[1]:
            return True
        array = self._read(name)
        row, column = array[0].astype(np.float64), array[:, 0].astype(np.float64)
        return bool((np.diff(row) > 0.0).all()) and not (np.diff(column) > 0.0).all()

    def add(self, name: str, value: Any, depth: int = 0) -> None:
        """Add the columns of a value: an array, a structure, an object, a cell array or a table."""
        fields, elements = _fields(value), list(_elements(value))
        if not fields and not elements:
            if isinstance(value, np.ndarray):
                self.add_array(name, value.shape, lambda: value, value.dtype.kind)
            elif not isinstance(value, bool | int | float | None):
                self.leave_out(name, type(value).__name__ if not isinstance(value, str) else "text")
        elif depth >= DEEPEST:
            self.leave_out(name, f"more than {DEEPEST} levels deep")
        elif len(elements) > MAX_ELEMENTS:
            self.leave_out(name, f"{len(elements)} structures or cells")
        for field, inner in fields.items():
            if depth < DEEPEST:
                self.add(f"{name}.{field}", inner, depth + 1)
        for k, inner in enumerate(elements[:MAX_ELEMENTS], 1):
            if depth < DEEPEST and len(elements) <= MAX_ELEMENTS:
                self.add(f"{name}:{k}", inner, depth + 1)

    def leave_out(self, name: str, what: str) -> None:
        """Remember a part of the file that is no column."""
        if len(self._left_out) < MAX_LEFT_OUT:
            self._left_out.append(f"{name} ({what})")

    def head(self) -> TableHead:
        """Return the head of the file; raise InputError if it has no columns."""
        names = tuple(self._columns)
        if not names:
            held = f"; it has {', '.join(self._left_out)}" if self._left_out else ""
            raise InputError(
                f"{self._where} has no columns of numbers{held}",
                allowed=TableHead.READABLE,
                remedy="save it as CSV",
            )
        return TableHead(self._where, names, self._load, left_out=tuple(self._left_out))

    def _load(self, column: int, is_clock: bool) -> ReadColumn:
        name = list(self._columns)[column]
        array, k, is_row = self._columns[name]
        values = self._read(array)
        values = values if values.ndim < 2 else values[k] if is_row else values[:, k]
        return ReadColumn.of_array(values, name, self._where, is_clock=is_clock)


def _fields(value: Any) -> dict[str, Any]:
    """Return the fields of a MATLAB structure or object, and the columns of a table, by name."""
    if hasattr(value, "columns"):  # of pandas, for a table; the times of a timetable are its index
        times = {} if value.index.name is None else {str(value.index.name): _seconds(value.index)}
        return times | {str(name): value[name].to_numpy() for name in value.columns}
    if hasattr(value, "_fieldnames"):  # of SciPy
        return {name: getattr(value, name) for name in value._fieldnames}
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:  # of mat-io
        return {name: value.flat[0][name] for name in value.dtype.names}
    fields = getattr(value, "properties", value)
    return dict(fields) if isinstance(fields, Mapping) else {}


def _elements(value: Any) -> Iterator[Any]:
    """Yield the elements of an array of structures or cells."""
    if isinstance(value, np.ndarray) and value.dtype.names and value.size > 1:
        yield from (value.flat[k : k + 1] for k in range(value.size))
    elif isinstance(value, np.ndarray) and value.dtype.kind == "O":
        yield from value.flat


def _seconds(index: Any) -> Any:
    """Return the times of a timetable in seconds after the first."""
    times = index.to_numpy()
    return (times - times[:1]).astype("timedelta64[ns]").astype(np.float64) * 1e-9

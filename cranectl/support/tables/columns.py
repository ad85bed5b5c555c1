"""Columns of numbers: what a reader returns, whatever the type of its file."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.support.tables.stamps import seconds_of_stamps

MAX_EXACT_INTEGER = 2**53  # up to here a float represents every integer
TICK_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # [s], of time stamps


@dataclass(frozen=True)
class ReadColumn:
    """One column of a file."""

    values: Array  # (N,) NaN for missing cells
    is_time: bool = False  # whether they are time stamps, in seconds after the first

    MAX_LENGTH: ClassVar = 20_000_000  # rows of a file that are read

    @staticmethod
    def check_length(rows: int, where: str, longest: int = MAX_LENGTH) -> None:
        """Raise InputError if a file with so many rows would need too much memory."""
        if rows > longest:
            raise InputError(
                f"{where} has {rows} rows",
                allowed=f"at most {longest}",
                remedy="leave out rows, for example every second one",
            )

    @staticmethod
    def not_numbers(where: str, name: str, holds: str) -> InputError:
        """Return the error for a column that holds something else than numbers."""
        return InputError(
            f"{where}: column '{name}' holds {holds}",
            allowed="numbers, with a point before decimals or with ; between columns and a comma; "
            "a clock may also have time stamps",
            remedy="map another column, or write numbers",
        )

    @classmethod
    def of_arrow(cls, column: Any, name: str, where: str, *, is_clock: bool = False) -> "ReadColumn":
        """Return a column of Arrow as numbers; raise InputError if it has none."""
        import pyarrow as pa

        kind = column.type
        if is_time(kind):
            return cls(_after_first(column.cast(pa.int64())) * TICK_SECONDS[kind.unit], is_time=True)
        if pa.types.is_string(kind) and (seconds := seconds_of_stamps(column)) is not None:
            return cls(seconds, is_time=True)
        if not is_number(kind):
            raise cls.not_numbers(where, name, _describe(column))
        try:
            return cls(column.cast(pa.float64()).to_numpy())
        except pa.ArrowInvalid:  # whole numbers that a float cannot represent
            if is_clock:
                return cls(_after_first(column.cast(pa.int64())))
        raise cls.not_numbers(where, name, _ROUNDED)

    @classmethod
    def of_array(cls, values: Any, name: str, where: str, *, is_clock: bool = False) -> "ReadColumn":
        """Return an array (N,) as a column; raise InputError for what a float would round."""
        if values.dtype.kind not in "fiub":
            holds = "complex numbers" if values.dtype.kind == "c" else "no numbers"
            raise cls.not_numbers(where, name, holds)
        floats: Array = values.astype(np.float64)
        if values.dtype.kind in "iu" and np.abs(floats).max(initial=0.0) > MAX_EXACT_INTEGER:
            if not is_clock:
                raise cls.not_numbers(where, name, _ROUNDED)
            floats = (values - values[0]).astype(np.int64).astype(np.float64)  # unsigned differences wrap
        return cls(floats)


_ROUNDED = f"whole numbers above {MAX_EXACT_INTEGER}, which a float rounds"


def _after_first(ticks: Any) -> Array:
    """Return whole numbers (N,) as differences from the first that is there, exact at any size."""
    import pyarrow as pa
    import pyarrow.compute as pc

    known = ticks.drop_null()
    if not len(known):
        return np.full(len(ticks), np.nan)
    after: Array = pc.subtract(ticks, known[0]).cast(pa.float64(), safe=False).to_numpy()
    return after


def is_time(kind: Any) -> bool:
    """Return True for an Arrow type of time stamps or durations."""
    import pyarrow as pa

    return bool(pa.types.is_timestamp(kind) or pa.types.is_duration(kind))


def is_number(kind: Any) -> bool:
    """Return True for an Arrow type of numbers."""
    import pyarrow as pa

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))


def _describe(column: Any) -> str:
    """Describe a column without numbers: its first text, or its type."""
    import pyarrow as pa

    if pa.types.is_null(column.type):
        return "no values"
    text = next((cell for cell in column.slice(0, 1000).to_pylist() if isinstance(cell, str)), "")
    return f"the text '{text[:40]}'" if text else f"values of the type {column.type}"

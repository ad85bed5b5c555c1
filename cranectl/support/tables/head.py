"""What a file with columns of numbers holds, and the readers of its columns."""

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.support.tables.columns import ReadColumn, is_number, is_time
from cranectl.support.tables.text import read_text

Key = int | str  # of a column: its number from 1 on, or its name


@dataclass(frozen=True)
class TableHead:
    """What a file holds, before its numbers are read."""

    where: str  # the file, for messages
    names: tuple[str, ...]  # of the columns; their numbers where the file has no names
    load: Callable[[int, bool], ReadColumn]  # a column by its index from 0 on, and whether it is a clock
    units: tuple[str, ...] = ()  # as the file states them beside the names; empty if it states none
    left_out: tuple[str, ...] = ()  # what the file holds and the columns do not, in words
    is_ordered: bool = True  # False for messages, which are in the order of their arrival

    # The kinds of files that can be read, in words.
    READABLE: ClassVar = "CSV, Parquet, MCAP, MATLAB (.mat), HDF5, Excel (.xlsx) or a ROS bag"

    def read(self, column: int, *, is_clock: bool = False) -> ReadColumn:
        """Return a column by its index from 0 on.

        Of a clock only differences count, so whole numbers that a float cannot represent are read as
        differences from the first. Raises InputError if the column holds no numbers or cannot be read.
        """
        with self.reading(self.where):
            return self.load(column, is_clock)

    def unit(self, column: int) -> str:
        """Return the unit that the file states for a column, or an empty text."""
        return self.units[column] if self.units else ""

    def column(self, key: Key, where: str) -> int:
        """Return the index of a column; raise InputError if it is missing or its name is not unique."""
        if isinstance(key, int):
            if key <= len(self.names):
                return key - 1
            raise InputError(
                f"{where}: column {key} of {len(self.names)}",
                allowed=f"numbers from 1 to {len(self.names)}",
                remedy=f"cranectl new map {shlex.quote(where)} shows what the file holds",
            )
        if (times := self.names.count(key)) > 1:
            numbers = [k for k, name in enumerate(self.names, 1) if name == key]
            raise InputError(
                f"{where}: {times} columns are called '{key}'",
                allowed="columns with names of their own, or numbers",
                remedy=f"write column = {numbers[0]}, or {numbers[1]}",
            )
        if not times:
            raise InputError.unknown(f"column of {where}:", key, self.names)
        return self.names.index(key)

    @staticmethod
    @contextmanager
    def reading(where: str, kind: str = "") -> Iterator[None]:
        """Raise InputError for the errors of libraries that read a broken file; `kind` says what it is."""
        try:
            yield
        except (InputError, MemoryError):
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
                f"cannot read {where}{f', {kind}' if kind else ''}: {InputError.describe(error)[:300]}",
                allowed="a whole file, as its program writes it",
                remedy="write the file again, for example as CSV",
            ) from None

    @classmethod
    def of_text(
        cls,
        source: Path | bytes,
        where: str,
        *,
        named_line: int | None = None,
        needs_names: bool = False,
        longest: int = ReadColumn.MAX_LENGTH,
    ) -> "TableHead":
        """Return the head of a text file with columns.

        `named_line` is the number of the line of names, 0 for none, or None to look for it. Raises InputError
        for a file that is no text or has no numbers, and, with `needs_names`, for one without names.
        """
        return cls(where, *read_text(source, where, named_line, needs_names, longest))

    @classmethod
    def of_parquet(cls, source: Any, where: str, *, longest: int = ReadColumn.MAX_LENGTH) -> "TableHead":
        """Return the head of a Parquet file: a path, or a buffer of Arrow.

        Types are checked before a column is read, since compressed text can be huge.
        """
        from pyarrow import parquet

        with parquet.ParquetFile(source) as file:
            schema = file.schema_arrow
            ReadColumn.check_length(file.metadata.num_rows, where, longest)

        def load(column: int, is_clock: bool) -> ReadColumn:
            field = schema.field(column)
            if not (is_number(field.type) or is_time(field.type)):
                raise ReadColumn.not_numbers(where, field.name, f"values of the type {field.type}")
            with parquet.ParquetFile(source) as file:
                read = file.read(columns=[field.name], use_threads=False)
            return ReadColumn.of_arrow(read.column(0), field.name, where, is_clock=is_clock)

        return cls(where, tuple(schema.names), load, tuple(_stated_unit(field) for field in schema))

    @classmethod
    def of_arrays(
        cls, where: str, arrays: Mapping[str, Array], *, left_out: Sequence[str] = (), is_ordered: bool = True
    ) -> "TableHead":
        """Return the head of a file that is in memory; its columns may have different lengths."""
        names = tuple(arrays)
        if not names:
            raise InputError(
                f"{where} has no columns of numbers"
                + (f"; it has {', '.join(left_out)}" if left_out else ""),
                allowed=cls.READABLE,
                remedy="save it as CSV",
            )
        ReadColumn.check_length(max(map(len, arrays.values())), where)
        return cls(
            where,
            names,
            lambda column, _: ReadColumn(arrays[names[column]]),
            left_out=tuple(left_out),
            is_ordered=is_ordered,
        )


def _stated_unit(field: Any) -> str:
    """Return the unit in the metadata of a column, or an empty text."""
    metadata = {key.lower(): value for key, value in (field.metadata or {}).items()}
    unit: bytes = metadata.get(b"unit") or metadata.get(b"units") or b""
    return unit.decode("utf-8", "replace").strip()

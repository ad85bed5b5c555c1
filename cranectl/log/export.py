"""Export runs as one table for other tools: CSV, Parquet, MATLAB, and formats that packages add.

The table has a row for each sample time and a column for each signal, with the values as recorded, in SI
units and radians. The names of columns are:

- PLANT.GROUP.SIGNAL, and reference.SIGNAL for the reference that all plants share
- LABEL.GROUP.SIGNAL and LABEL.reference.SIGNAL for the runs of an overlay
"""

import csv
import functools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.scenario import NANOSECONDS
from cranectl.signals import Signal, SignalGroup
from cranectl.simulate import Run
from cranectl.support import Array, Extensions, File, FileKind, InputError, Mask

# Replaces the header of SciPy, which has the date, so that the same run gives the same bytes. The format
# requires 116 bytes.
MAT_HEADER = b"MATLAB 5.0 MAT-file, written by cranectl".ljust(116)

# Characters of a MATLAB name: the limit before version 7, and the limit now.
SHORT_NAME, MAX_NAME_LENGTH = 31, 63
MATLAB_KEYWORD = re.compile(
    "break|case|catch|classdef|continue|else|elseif|end|for|function|global|if|otherwise|parfor|persistent|"
    "return|spmd|switch|try|while"
)


@dataclass(frozen=True)
class ExportColumn:
    """One signal at all times of the table."""

    name: str
    unit: str
    description: str
    values: Array  # (N,) NaN where missing
    missing: Mask  # (N,) True where the run has no sample


@dataclass(frozen=True)
class ExportTable:
    """The data to export, in any format."""

    time: Array  # (N,) [s]
    columns: tuple[ExportColumn, ...]
    info: dict[str, str | float]


@dataclass(frozen=True)
class Exporter:
    """A format of exported tables."""

    name: str  # value of `--format`, and the ending of its files
    title: str  # for messages
    begins: bytes  # regular expression for the start of its files; an export never replaces other files
    write: Callable[[ExportTable, Path], None]  # writes the table into a new, empty file
    # Returns names that the format cannot have, of columns or their first parts, and their names in the file.
    renamed: Callable[[ExportTable], Mapping[str, str]] = lambda _: {}

    @property
    def kind(self) -> FileKind:
        """The kind of its files."""
        return FileKind(self.title, self.begins)

    @classmethod
    def choose(cls, name: str | None, out: Path | None) -> "Exporter":
        """Return the exporter `name`, else that of the ending of `out`, or csv; else raise InputError."""
        known = exporters()
        ending = name or (out.suffix.removeprefix(".").lower() if out else "csv")
        if ending in known:
            return known[ending]
        if name:
            raise InputError.unknown("format", name, known)
        raise InputError(
            f"the ending of {out} names no format",
            allowed=", ".join(f".{name}" for name in known),
            remedy="choose such an ending, or add --format",
        )

    def save(self, table: ExportTable, path: Path) -> None:
        """Write `table` to `path` in one atomic step; raise InputError if that fails."""
        with File(path).writing(remedy="choose another place with --out"), File(path).replacing() as part:
            self.write(table, part)


def export_table(runs: Mapping[str, Run], patterns: Sequence[str] = ()) -> ExportTable:
    """Return the signals that match any of `patterns`, by default all signals.

    `runs` are those of a log by plant, which share their reference, or those of an overlay by label. The
    table has every time at which any run has a sample. Where a run has no sample, mostly after its end, its
    signals are missing. Raises InputError for a pattern that matches nothing.
    """
    time_ns = np.unique(np.concatenate([run.time_ns for run in runs.values()]))
    result = list(_recorded(runs, time_ns))
    if _by_label(runs):
        for label, run in runs.items():
            if run.has_reference:
                result += _reference(f"{label}.reference", [run], time_ns)
    elif all(run.has_reference for run in runs.values()):
        result += _reference("reference", [*runs.values()], time_ns)
    columns = {column.name: column for column in result}
    chosen: set[str] = set()
    for pattern in patterns or ("*",):
        chosen.update(InputError.matching(pattern, columns))
    return ExportTable(
        time=time_ns / NANOSECONDS,
        columns=tuple(column for name, column in columns.items() if name in chosen),
        info=_info(runs),
    )


@functools.cache
def exporters() -> dict[str, Exporter]:
    """Return our exporters and those of installed packages by name; raise InputError for an invalid one."""
    return Extensions.EXPORTERS.join({own.name: own for own in EXPORTERS}, Exporter)


def _by_label(runs: Mapping[str, Run]) -> bool:
    return any(name != run.plant for name, run in runs.items())


def _recorded(runs: Mapping[str, Run], time_ns: NDArray[np.int64]) -> Iterator[ExportColumn]:
    for name, run in runs.items():
        rows = np.searchsorted(time_ns, run.time_ns)
        signals = [(f"{name}.{group.name}", s) for group in run.groups for s in group.signals]
        for (prefix, signal), values in zip(signals, run.table.T, strict=True):
            yield _column(prefix, signal, len(time_ns), rows, values)


def _reference(prefix: str, runs: Sequence[Run], time_ns: NDArray[np.int64]) -> Iterator[ExportColumn]:
    """Yield the columns of the reference that the runs share."""
    times = np.concatenate([run.time_ns for run in runs])
    values = np.concatenate([run.reference for run in runs])
    # A log may lack the reference of the last sample of a run that stopped early, which is read as NaN.
    known = np.flatnonzero(~np.isnan(values).any(axis=1))
    rows, first = np.unique(np.searchsorted(time_ns, times[known]), return_index=True)
    for signal, column in zip(SignalGroup.REFERENCE.signals, values[known[first]].T, strict=True):
        yield _column(prefix, signal, len(time_ns), rows, column)


def _column(prefix: str, signal: Signal, length: int, rows: NDArray[np.intp], values: Array) -> ExportColumn:
    on_grid, missing = np.full(length, np.nan), np.ones(length, dtype=np.bool_)
    on_grid[rows], missing[rows] = values, False
    return ExportColumn(f"{prefix}.{signal.name}", signal.unit, signal.description, on_grid, missing)


def _info(runs: Mapping[str, Run]) -> dict[str, str | float]:
    info: dict[str, str | float] = {}
    for name, run in runs.items():
        facts = {"scenario": run.scenario.name, "controller": run.design.name, "drive": run.drive}
        info |= {f"{name}_{key}": text for key, text in facts.items()} if _by_label(runs) else facts
        info[f"{name}_status"] = run.status.label
        info[f"{name}_end_s"] = run.end_s
    return info


def _write_csv(table: ExportTable, path: Path) -> None:
    """Write each number with the fewest digits that read back as the same number; missing ones are empty."""
    cells = [table.time.tolist()]
    for column in table.columns:
        known = zip(column.values.tolist(), column.missing.tolist(), strict=True)
        cells.append([None if missing else value for value, missing in known])
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["time", *(column.name for column in table.columns)])
        writer.writerows(zip(*cells, strict=True))


def _write_parquet(table: ExportTable, path: Path) -> None:
    """Write units and descriptions as metadata of columns, and facts about the runs as those of the table."""
    import pyarrow as arrow
    from pyarrow import parquet

    time = ExportColumn("time", "s", "simulation time", table.time, np.zeros(len(table.time), dtype=np.bool_))
    fields, arrays = [], []
    for column in (time, *table.columns):
        metadata = {"unit": column.unit, "description": column.description}
        fields.append(arrow.field(column.name, arrow.float64(), metadata=metadata))
        arrays.append(arrow.array(column.values, mask=column.missing))
    schema = arrow.schema(fields, metadata={name: str(value) for name, value in table.info.items()})
    with path.open("wb") as stream:
        parquet.write_table(arrow.Table.from_arrays(arrays, schema=schema), stream)


def _write_mat(table: ExportTable, path: Path) -> None:
    """Write nested structs of plants, groups and signals, the same structs with units, and `info`."""
    from scipy.io import savemat

    variables: dict[str, Any] = {"time": table.time}
    units: dict[str, Any] = {"time": "s"}
    paths = _matlab_paths(table)
    for column in table.columns:
        _put(variables, paths[column.name], column.values)
        _put(units, paths[column.name], column.unit)
    names = _valid_names(table.info)
    info: dict[str, Any] = {names[name]: value for name, value in table.info.items()}
    if renamed := _matlab_renamed(table):
        # An array of objects becomes a cell array of texts.
        info["renamed"] = np.array([f"{old} is {new}" for old, new in renamed.items()], dtype=object)
    long = any(len(name) > SHORT_NAME for path in (*paths.values(), info) for name in path)
    with path.open("w+b") as stream:
        content = {**variables, "units": units, "info": info}
        savemat(stream, content, oned_as="column", long_field_names=long)
        stream.seek(0)
        stream.write(MAT_HEADER)


def _matlab_renamed(table: ExportTable) -> dict[str, str]:
    """Return the names of plants, labels, groups and columns that change in MATLAB, with their new names."""
    renamed = {}
    for name, path in _matlab_paths(table).items():
        parts = name.split(".")
        for depth, (part, valid) in enumerate(zip(parts, path, strict=True), 1):
            if part != valid:
                renamed[".".join(parts[:depth])] = ".".join(path[:depth])
    return renamed


def _matlab_paths(table: ExportTable) -> dict[str, tuple[str, ...]]:
    """Return for each column the names of its variable and nested fields in MATLAB."""
    paths = {column.name: tuple(column.name.split(".")) for column in table.columns}
    levels = {name: [(path[:k], part) for k, part in enumerate(path)] for name, path in paths.items()}
    below: dict[tuple[str, ...], list[str]] = {}
    for above, part in (level for path in levels.values() for level in path):
        below.setdefault(above, []).append(part)
    taken = ("time", "units", "info")
    valid = {above: _valid_names(parts, () if above else taken) for above, parts in below.items()}
    return {name: tuple(valid[above][part] for above, part in path) for name, path in levels.items()}


def _valid_names(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Return for each name a valid and unique MATLAB name, as MATLAB's `makeValidName` does."""
    used, result = set(taken), dict[str, str]()
    for name in dict.fromkeys(names):
        valid = re.sub(r"^(?=[\d_])", "x", re.sub(r"\W", "_", name, flags=re.ASCII))
        if MATLAB_KEYWORD.fullmatch(valid):
            valid = f"x{valid.capitalize()}"
        free, number = valid[:MAX_NAME_LENGTH], 0
        while free in used:
            number += 1
            free = f"{valid[: MAX_NAME_LENGTH - len(f'_{number}')]}_{number}"
        used.add(free)
        result[name] = free
    return result


def _put(tree: dict[str, Any], path: Sequence[str], value: Any) -> None:
    *branches, leaf = path
    for branch in branches:
        tree = tree.setdefault(branch, {})
    tree[leaf] = value


EXPORTERS = (
    Exporter("csv", "exported CSV table", rb"time\b", _write_csv),
    Exporter("parquet", "Parquet file", rb"PAR1", _write_parquet),
    Exporter("mat", "MATLAB file", rb"MATLAB 5", _write_mat, _matlab_renamed),
)

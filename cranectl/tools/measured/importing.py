"""Make runs from measured files: read the mapped columns, bring them to one clock, and check them.

A run has samples at even times from 0 on. Positions and angles are interpolated between readings; a command
holds from the sample nearest to its time to the next command.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.scenario import NANOSECONDS, RigFile, RigParameters
from cranectl.signals import SignalGroup
from cranectl.simulate import Run
from cranectl.support import Array, InputError, Mask, TableHead
from cranectl.tools.measured.assembly import complete, describe_files, empty_table, make_run
from cranectl.tools.measured.clocks import (
    MIN_ROWS,
    Clock,
    Readings,
    bridged,
    check_gaps,
    imported_part,
    sample_times,
)
from cranectl.tools.measured.mapping import (
    ANGLES,
    COMMANDS,
    POSITIONS,
    ClockMap,
    LayoutMap,
    MeasuredMap,
    SignalMap,
)
from cranectl.tools.measured.plausibility import Finding, PhysicsVerdict, check_motion, check_physics
from cranectl.tools.measured.responses import Recording
from cranectl.tools.measured.suggestion import run_name
from cranectl.tools.measured.tables import read_head

MAX_READING = 1e12  # [SI] of any signal


@dataclass(frozen=True)
class Imported:
    """A measured run, and what was found on the way."""

    run: Run
    findings: tuple[Finding, ...]
    contradictions: tuple[str, ...] = ()  # to physics, of a map with check_physics = false
    remarks: tuple[
        str, ...
    ] = ()  # on missing readings, rows that were sorted, and on a log that is of no use


class LogSource(NamedTuple):
    """Where a run is from."""

    name: str  # of the run
    files: tuple[Path, ...]  # in the order of their numbers in the map
    heads: tuple[TableHead, ...] = ()  # of files that are read already
    sheet: str = ""  # of a workbook

    @property
    def label(self) -> str:
        """The files as people name them."""
        return ", ".join(map(str, self.files)) + f", sheet {self.sheet}" * bool(self.sheet)


class Recorded(NamedTuple):
    """The signals of one log before they are checked."""

    source: LogSource
    mapping: MeasuredMap
    time_ns: NDArray[np.int64]
    table: Array
    columns: dict[str, Array]  # views of `table`
    groups: tuple[SignalGroup, ...]
    trusted: Mask  # (N,) False where a gap was bridged
    remarks: tuple[str, ...]
    impossible: InputError | None  # the first signal that no crane can have

    @property
    def recording(self) -> Recording:
        """The measured signals, as they are checked."""
        names = (*POSITIONS, *ANGLES, *COMMANDS)
        columns = {name: self.columns[name] for name in names if name in self.mapping.signals.declared}
        return Recording(columns, float(self.time_ns[1]) / NANOSECONDS, self.trusted)


def import_files(
    files: Sequence[Path], mapping: MeasuredMap, *, directory: Path, rig: str | None = None
) -> Imported:
    """Return the run that `files`, in the order of their numbers in the map, hold, with remarks on it.

    `directory` is that of the map, from which it names its rig; `rig` is the name or file of another one.
    Raises InputError for files that cannot be read, columns that are missing, clocks that do not increase,
    gaps, jumps that the drives cannot make, and a mapping that contradicts physics.
    """
    source = LogSource(mapping.name, tuple(files))
    return import_runs([source], mapping, directory=directory, rig=rig)[0]


def each_source(files: Sequence[Path], mapping: MeasuredMap, sheets: str | None) -> list[LogSource]:
    """Return the sources of runs in a file each, or in a sheet each that fits the pattern `sheets`.

    Raises InputError for a map whose runs are in several files each.
    """
    if (most := max(signal.file for signal in mapping.signals.declared.values())) > 1:
        raise InputError(
            f"the map has signals of file {most}, and each file is a run by itself",
            allowed="maps of one file",
            remedy="make a log of the files of each run, and name the logs: cranectl log import FILE FILE "
            "--map MAP --out RUN.mcap",
        )
    return [source for file in files for source in sources_of(file, sheets, mapping.layout)]


def sources_of(path: Path, sheets: str | None, layout: LayoutMap) -> list[LogSource]:
    """Return a source for each sheet of a workbook that fits the pattern `sheets`, or one for the file.

    Names of columns then have no sheet. The variables of a MATLAB file count as sheets.
    """
    if sheets is None:
        return [LogSource(run_name(path.stem), (path,))]
    head = read_head(path, layout)
    if not any("." in name for name in head.names):  # a workbook with one sheet
        return [LogSource(run_name(path.stem), (path,), (head,))]
    places = [_split_sheet(name, sheets) for name in head.names]
    found = dict.fromkeys(sheet for sheet, _ in places if sheet is not None)
    if not found:
        raise InputError(
            f"no sheet of {path} is called '{sheets}'",
            allowed=", ".join(dict.fromkeys(name.partition(".")[0] for name in head.names)),
            remedy="correct the pattern of --sheets, in quotes: --sheets 'Run*'",
        )
    return [
        LogSource(run_name(f"{path.stem}-{sheet}"), (path,), (_sheet_head(head, places, sheet),), sheet)
        for sheet in found
    ]


def _split_sheet(name: str, pattern: str) -> tuple[str | None, str]:
    """Return the sheet of a column, None if it does not fit the pattern, and its name in that sheet."""
    parts = name.split(".")
    for k in range(1, len(parts)):
        if fnmatchcase(sheet := ".".join(parts[:k]), pattern):
            return sheet, ".".join(parts[k:])
    return None, name


def _sheet_head(head: TableHead, places: Sequence[tuple[str | None, str]], sheet: str) -> TableHead:
    """Return the head of one sheet."""
    columns = [k for k, (other, _) in enumerate(places) if other == sheet]
    return replace(
        head,
        names=tuple(places[k][1] for k in columns),
        units=tuple(head.unit(k) for k in columns),
        load=lambda k, is_clock: head.load(columns[k], is_clock),
    )


def import_runs(
    sources: Sequence[LogSource], mapping: MeasuredMap, *, directory: Path, rig: str | None = None
) -> list[Imported]:
    """Return the runs of several sources of one map; physics judges all of them together, and then each.

    Raises InputError as `import_files` does, and for a run that contradicts physics alone.
    """
    parameters = RigFile.load(rig or RigFile.place(mapping.rig, directory))
    mapping = mapping.on(parameters)
    recorded = [
        _record(source, mapping.model_copy(update={"name": source.name}), parameters) for source in sources
    ]
    recordings = [log.recording for log in recorded]
    whole = check_physics(recordings, mapping, parameters)
    alone = [check_physics([r], mapping, parameters) for r in recordings] if len(sources) > 1 else [whole]
    for log, verdict in zip([None, *recorded], [whole, *alone], strict=True):
        if mapping.check_physics:
            verdict.refuse(of="" if log is None or len(sources) == 1 else log.source.label)
    for log in recorded:
        if log.impossible is not None:
            raise log.impossible
    return [_finished(log, parameters, verdict) for log, verdict in zip(recorded, alone, strict=True)]


def _record(source: LogSource, mapping: MeasuredMap, rig: RigParameters) -> Recorded:
    """Read the mapped signals of one log, and bring them to one clock."""
    files = source.files
    _check_files(files, mapping)
    heads = source.heads or [read_head(path, mapping.layout) for path in files]
    sources = {name: s for name, s in mapping.signals.declared.items() if s.column is not None}
    clocks: dict[tuple[int, ClockMap], Clock] = {}
    for signal in sources.values():
        key, path = (signal.file, mapping.clock(signal)), files[signal.file - 1]
        if key not in clocks:
            clocks[key] = Clock.read(heads[signal.file - 1], key[1], signal, str(path))
    begin, end = imported_part(sources, clocks, mapping)
    time_ns = sample_times((begin, end), next(iter(clocks.values())).period_ns, mapping)
    time = begin + time_ns / NANOSECONDS
    table, columns, groups = empty_table(mapping, len(time))
    trusted, impossible = np.ones(len(time), dtype=np.bool_), None
    remarks = [*dict.fromkeys(clock.remark for clock in clocks.values() if clock.remark)]
    for name, signal in mapping.signals.declared.items():  # in turn: all readings take as much memory again
        unit = mapping.units(name)[signal.unit]
        if signal.value is not None:
            columns[name][:] = signal.convert(signal.value, unit)
            continue
        clock = clocks[signal.file, mapping.clock(signal)]
        where, head = str(files[signal.file - 1]), heads[signal.file - 1]
        readings, remark = _read(name, signal, unit, head, clock=clock, where=where)
        first, last = np.searchsorted(readings.time, [begin, end], side="right")
        part = slice(max(int(first) - 1, 0), int(last) + 1)  # with the readings just before and after it
        readings = Readings(readings.time[part], readings.values[part])
        _check_sizes(name, readings, where)
        check_gaps(name, readings.time, clock.largest_gap, (begin, end), where)
        try:
            check_motion(name, *readings, rig)
        except InputError as error:
            impossible = impossible or error
        columns[name][:] = _resampled(name, readings, time)
        trusted &= ~bridged(readings.time, time)
        remarks += [remark] if remark else []
        del clock, readings
    return Recorded(source, mapping, time_ns, table, columns, groups, trusted, tuple(remarks), impossible)


def _finished(log: Recorded, rig: RigParameters, verdict: PhysicsVerdict) -> Imported:
    """Return the run of a log that was checked."""
    period, sheet = float(log.time_ns[1]) / NANOSECONDS, log.source.sheet
    complete(log.columns, log.mapping, period)
    run = make_run(
        log.table,
        log.groups,
        log.time_ns,
        mapping=log.mapping,
        rig=rig,
        description=describe_files(log.source.files, log.mapping) + f"\nsheet: {sheet}" * bool(sheet),
    )
    useless = (verdict.useless,) if verdict.useless else ()
    return Imported(run, verdict.findings, verdict.contradictions, (*log.remarks, *useless))


def _check_files(files: Sequence[Path], mapping: MeasuredMap) -> None:
    used = {signal.file for signal in mapping.signals.declared.values() if signal.column is not None}
    if (most := max(used, default=1)) > len(files) or (mapping.clocks and len(mapping.clocks) != len(files)):
        problem = f"signals of file {most}" if most > len(files) else f"{len(mapping.clocks)} clocks"
        raise InputError(
            f"the map has {problem}, and {len(files)} files are given",
            allowed="a file for each number in the map, and a clock for each file or none",
            remedy="name all files in their order, or correct the map",
        )
    if unused := [str(path) for k, path in enumerate(files, 1) if k not in used]:
        raise InputError(
            f"no signal is in {', '.join(unused)}",
            allowed="files that the map uses",
            remedy="leave the file out, or map its columns with file = NUMBER",
        )


def _read(
    name: str, signal: SignalMap, unit: float, head: TableHead, *, clock: Clock, where: str
) -> tuple[Readings, str]:
    """Return the readings of a signal in SI units, without missing ones, and a remark on those."""
    assert signal.column is not None
    values = head.read(head.column(signal.column, where)).values
    if len(values) != clock.rows:
        raise InputError(
            f"{where}: signals.{name} has {len(values)} rows, its clock has {clock.rows}",
            allowed="a clock with a time for each reading",
            remedy=f"name the clock of these readings, signals.{name}.clock = {{column = '…'}}",
        )
    values = values[clock.kept]
    known = np.isfinite(values)
    time = clock.time - signal.delay if signal.delay else clock.time
    remark = ""
    if not known.all():
        first = int(np.argmin(known))
        remark = (
            f"{int((~known).sum())} of {len(known)} readings of {name} are no numbers and left out, the "
            f"first ({values[first]:g}) at {time[first]:.6g} s"
        )
        time, values = time[known], values[known]
    if len(values) < MIN_ROWS:
        raise InputError(
            f"{where}: {len(known) - len(values)} of {len(known)} readings of {name} are missing",
            allowed=f"at least {MIN_ROWS} numbers",
            remedy=f"map another column, or leave out signals.{name}",
        )
    return Readings(time, signal.convert(values, unit)), remark


def _check_sizes(name: str, readings: Readings, where: str) -> None:
    """Raise InputError for readings that no measuring system means, such as 1e308 for "unknown"."""
    largest = int(np.argmax(np.abs(readings.values)))
    if abs(readings.values[largest]) > MAX_READING:
        raise InputError(
            f"{where}: {name} is {readings.values[largest]:.4g}, at {readings.time[largest]:.6g} s",
            allowed=f"readings up to {MAX_READING:g} in SI units",
            remedy="correct or empty that cell, or leave it out by from and to",
        )


def _resampled(name: str, reading: Readings, time: Array) -> Array:
    """Return a signal at even times (N,): commands are held, and all others lie between two readings."""
    if name not in COMMANDS:
        return np.interp(time, reading.time, reading.values)
    # A command counts from the sample nearest to its stamp. If it counted from the next sample, a clock that
    # drifts would make all commands late by up to a row.
    half = 0.5 * min(time[1] - time[0], float(np.median(np.diff(reading.time))))
    rows = np.searchsorted(reading.time, time + half, side="right") - 1
    last: Array = reading.values[rows.clip(0)]
    return last

"""Make a run from measured files: read the mapped columns, check them, and bring them to one clock.

The run has the plant `measured`. It has samples at even times from 0 on. Positions and angles are
interpolated between readings; commands hold their last value. Rates are slopes of cubics that are fitted
to RATE_SPAN seconds of samples.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from cranectl.design import ControllerDesign
from cranectl.measured.clocks import (
    MIN_ROWS,
    Clock,
    Readings,
    check_gaps,
    imported_part,
    read_clock,
    sample_times,
)
from cranectl.measured.mapping import (
    ANGLES,
    COMMANDS,
    LOAD,
    POSITIONS,
    ClockMap,
    MeasuredMap,
    SignalMap,
)
from cranectl.measured.plausibility import Finding, check_motion, compare_with_physics
from cranectl.measured.tables import read_head
from cranectl.plants.plant import Drive
from cranectl.plants.registry import PLANTS, PlantEntry
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.scenario.load import load_rig, rig_place
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.scenario import MeasuredScenario, longest_step
from cranectl.scenario.settings import parse_settings
from cranectl.scenario.similarity import length_scale
from cranectl.signals import STATE, SignalGroup, measured_groups
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.support.tables.columns import TableHead

MEASURED = PlantEntry(
    name="measured", label="measured", colour="series-4", where="", batch=0, by_default=False
)
UNKNOWN_CONTROLLER = "unknown-controller"  # a log of a crane does not have it
LAB_STEP = 0.001  # [s] of physics on the laboratory rig
RATE_SPAN = 0.1  # [s] of samples from which a rate is computed
RATE_ORDER = 3  # of the polynomials whose slopes are the rates
MIN_RATE_SAMPLES = 5
RATES = dict(zip(STATE.names[::2], STATE.names[1::2], strict=True)) | {name: f"{name}_dot" for name in LOAD}
DRIVES: dict[str | None, Drive] = {
    None: "ideal",
    "acceleration": "ideal",
    "velocity": "velocity",
    "force": "force",
}


@dataclass(frozen=True)
class Imported:
    """A measured run, and what was found on the way."""

    run: Run
    findings: tuple[Finding, ...]
    remarks: tuple[str, ...] = ()  # on rows that were sorted


def import_files(
    files: Sequence[Path], mapping: MeasuredMap, *, directory: Path, rig: str | None = None
) -> Imported:
    """Return the run that `files`, in the order of their numbers in the map, hold, with remarks on it.

    `directory` is that of the map, from which it names its rig; `rig` is the name or file of another one.
    Raises InputError for files that cannot be read, columns that are missing, clocks that do not increase,
    gaps, jumps that the drives cannot make, and a mapping that contradicts physics.
    """
    _check_files(files, mapping)
    parameters = load_rig(rig or rig_place(mapping.rig, directory))
    heads = [read_head(path, mapping.layout) for path in files]
    sources = {name: s for name, s in mapping.signals.declared.items() if s.column is not None}
    clocks: dict[tuple[int, ClockMap], Clock] = {}
    for signal in sources.values():
        key, path = (signal.file, mapping.clock(signal)), files[signal.file - 1]
        if key not in clocks:
            clocks[key] = read_clock(heads[signal.file - 1], key[1], signal, str(path))
    begin, end = imported_part(sources, clocks, mapping)
    time_ns = sample_times((begin, end), next(iter(clocks.values())).period_ns, mapping)
    period_ns = int(time_ns[1])
    time = begin + time_ns / NANOSECONDS
    table, columns, groups = _empty_table(mapping, len(time))
    for (
        name,
        signal,
    ) in mapping.signals.declared.items():  # one after the other: all readings take as much memory as the run
        unit = mapping.units(name)[signal.unit]
        if signal.value is not None:
            columns[name][:] = signal.convert(signal.value, unit)
            continue
        clock = clocks[signal.file, mapping.clock(signal)]
        where, head = str(files[signal.file - 1]), heads[signal.file - 1]
        readings = _read(name, signal, unit, head, clock=clock, where=where)
        first, last = np.searchsorted(readings.time, [begin, end], side="right")
        part = slice(max(int(first) - 1, 0), int(last) + 1)  # with the readings just before and after it
        readings = Readings(readings.time[part], readings.values[part])
        check_gaps(name, readings.time, clock.largest_gap, (begin, end), where)
        check_motion(name, *readings, parameters)
        columns[name][:] = _resampled(name, readings, time)
        del clock, readings
    remarks = tuple(dict.fromkeys(clock.remark for clock in clocks.values() if clock.remark))
    del clocks, time
    findings: tuple[Finding, ...] = ()
    if ANGLES[0] in columns:
        findings = compare_with_physics(columns, period_ns / NANOSECONDS, parameters.gravity)
        if mapping.check_physics:
            for finding in findings:
                finding.refuse()
    _complete(columns, mapping, period_ns / NANOSECONDS)
    description = describe_files(files, mapping)
    run = _run(table, groups, time_ns, mapping=mapping, rig=parameters, description=description)
    return Imported(run, findings, remarks)


def assemble_run(
    signals: Mapping[str, Array], mapping: MeasuredMap, rig: RigParameters, period_ns: int
) -> Run:
    """Return the run that an import of a file with `signals` gives, each (N,) in SI units at even times."""
    time_ns = period_ns * np.arange(len(next(iter(signals.values()))), dtype=np.int64)
    table, columns, groups = _empty_table(mapping, len(time_ns))
    for name, values in signals.items():
        columns[name][:] = values
    _complete(columns, mapping, period_ns / NANOSECONDS)
    return _run(table, groups, time_ns, mapping=mapping, rig=rig, description="known signals")


def _empty_table(mapping: MeasuredMap, rows: int) -> tuple[Array, dict[str, Array], tuple[SignalGroup, ...]]:
    """Return a table for all signals of the run, its columns (views) by name, and their groups."""
    declared = mapping.signals.declared
    has_angles, has_load = ANGLES[0] in declared, LOAD[0] in declared
    groups = measured_groups(mapping.commands or "", angles=has_angles, load=has_angles or has_load)
    names = [name for group in groups for name in group.names]
    table = np.empty((rows, len(names)), order="F")  # signals are computed one after the other
    return table, dict(zip(names, table.T, strict=True)), groups


def _complete(columns: Mapping[str, Array], mapping: MeasuredMap, period: float) -> None:
    """Compute the load from the joints, unless it was measured, and the rates of all positions."""
    declared = mapping.signals.declared
    if ANGLES[0] in declared and LOAD[0] not in declared:
        _put_load(columns)
    for name, rate in RATES.items():
        if name in columns:
            columns[rate][:] = _slopes(columns[name], period)


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
) -> Readings:
    """Return the readings of a signal in SI units, without missing ones."""
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
    if not known.all():
        time, values = time[known], values[known]
    if len(values) < MIN_ROWS:
        raise InputError(
            f"{where}: {len(known) - len(values)} of {len(known)} readings of {name} are missing",
            allowed=f"at least {MIN_ROWS} numbers",
            remedy=f"map another column, or leave out signals.{name}",
        )
    return Readings(time, signal.convert(values, unit))


def _resampled(name: str, reading: Readings, time: Array) -> Array:
    """Return a signal at even times (N,): the last command, and all others between two readings."""
    if name not in COMMANDS:
        return np.interp(time, reading.time, reading.values)
    rounding = 1e-6 * (time[1] - time[0])  # of equal times, which would hold a command for one sample more
    rows = np.searchsorted(reading.time, time + rounding, side="right") - 1
    last: Array = reading.values[rows.clip(0)]
    return last


def rate_samples(period: float) -> int:
    """Return the odd number of samples to which a cubic is fitted for a slope."""
    return max(MIN_RATE_SAMPLES, round(RATE_SPAN / period)) // 2 * 2 + 1


def _slopes(values: Array, period: float) -> Array:
    """Return the rate of a signal (N,) as the slope of cubics fitted around each sample."""
    samples = rate_samples(period)
    slopes: Array = (
        np.gradient(values, period)
        if len(values) < samples
        else savgol_filter(values, samples, polyorder=RATE_ORDER, deriv=1, delta=period)
    )
    return slopes


def _run(
    table: Array,
    groups: tuple[SignalGroup, ...],
    time_ns: NDArray[np.int64],
    *,
    mapping: MeasuredMap,
    rig: RigParameters,
    description: str,
) -> Run:
    PLANTS.remember(MEASURED)
    return Run(
        scenario=_scenario(mapping, rig, time_ns, table),
        design=ControllerDesign(UNKNOWN_CONTROLLER),
        plant=MEASURED.name,
        drive=DRIVES[mapping.commands],
        model=description,
        time_ns=time_ns,
        table=table,
        reference=np.zeros((len(time_ns), 0)),
        status=RunStatus.COMPLETED,
        end_ns=int(time_ns[-1]),
        own_groups=groups,
    )


def _put_load(columns: Mapping[str, Array]) -> None:
    """Compute the columns of the load from those of the joints."""
    x, y, rope, alpha, beta = (columns[name] for name in (*POSITIONS, *ANGLES))
    lateral = rope * np.cos(beta)
    np.add(x, rope * np.sin(beta), out=columns["load_x"])
    np.add(y, lateral * np.sin(alpha), out=columns["load_y"])
    np.multiply(-lateral, np.cos(alpha), out=columns["load_z"])


def _scenario(mapping: MeasuredMap, rig: RigParameters, time_ns: NDArray[np.int64], table: Array) -> Scenario:
    """Return what is known of a measured run in the words of a scenario."""
    period = float(time_ns[1]) / NANOSECONDS
    x, y, rope = table[0, :5:2].tolist()
    step = LAB_STEP * sqrt(length_scale(rig.rope_range[1]))  # drives and swing of a larger crane are slower
    settings = {
        "name": mapping.name,
        "title": mapping.title,
        "duration": float(time_ns[-1]) / NANOSECONDS,
        "reference": {"start": [x, y, -abs(rope)]},
        "control": {"period": period, "physics_step": longest_step(period, step)},
        "workspace": {"on_exit": "record"},
        "log": {"every": 1},
        "rig": rig.model_dump(mode="json"),
    }
    return parse_settings(MeasuredScenario, settings, "the measured run")


def describe_files(files: Sequence[Path], mapping: MeasuredMap) -> str:
    """Return where a measured run is from: the files with their digests, and the map."""
    digests = []
    for path in files:
        with path.open("rb") as stream:
            digests.append(f"{path.name} (SHA-256 {hashlib.file_digest(stream, 'sha256').hexdigest()})")
    texts = mapping.model_dump_json(exclude_defaults=True, by_alias=True)
    return f"measured: {', '.join(digests)}\nmap: {texts}"

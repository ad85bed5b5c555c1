"""Clocks of measured files: the times of their rows, gaps, and the part that all signals cover."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cranectl.measured.columns import TableHead
from cranectl.measured.mapping import TIMES, ClockMap, MeasuredMap, SignalMap
from cranectl.scenario import nanoseconds
from cranectl.scenario.settings import MAX_MEASURED
from cranectl.support.arrays import Array, Mask
from cranectl.support.errors import InputError

USUAL_GAPS = 10.0  # times the usual step that rows may be apart

MIN_ROWS = 10


class Readings(NamedTuple):
    """One signal on the clock of its file."""

    time: Array  # (N,) [s]
    values: Array  # (N,) in SI units


class Clock(NamedTuple):
    """The times of the rows of a file."""

    time: Array  # (N,) [s], of the rows that are kept
    kept: Mask  # (rows,) whether a row is kept
    largest_gap: float  # [s] that readings may be apart

    @property
    def period_ns(self) -> int:
        """The usual time between two rows, rounded to three digits [ns]."""
        return max(nanoseconds(float(f"{float(np.median(np.diff(self.time))):.3g}")), 1000)


def read_clock(head: TableHead, clock: ClockMap, signal: SignalMap, where: str) -> Clock:
    """Read the clock of a file; raise InputError if it stands still or runs back."""
    if clock.column is None:
        assert clock.period is not None
        assert signal.column is not None
        rows = len(head.read(head.column(signal.column, where)).values)
        even = np.arange(rows, dtype=np.float64) * clock.period + clock.offset
        return Clock(even, np.ones(rows, dtype=np.bool_), clock.max_gap or USUAL_GAPS * clock.period)
    times = head.read(head.column(clock.column, where))
    time: Array = (1.0 if times.is_time else TIMES[clock.unit]) * times.values + clock.offset
    kept: Mask = np.isfinite(time)
    if clock.repeated == "first":
        kept[1:] &= ~(np.diff(time) == 0.0)
    time = time if kept.all() else time[kept]
    if len(time) < MIN_ROWS:
        raise InputError(
            f"{where} has {len(time)} rows with a time",
            allowed=f"at least {MIN_ROWS}",
            remedy="map another column of times",
        )
    steps = np.diff(time)
    back = np.flatnonzero(~(steps > 0.0))
    if len(back):
        row, same = int(back[0]), bool((steps[back] == 0.0).all())
        does = "stands still" if same else "runs back"
        raise InputError(
            f"{where}: time {does} {len(back)} times, first after row {row + 1} at {time[row]:.9g} s",
            allowed="times that increase from row to row",
            remedy='write repeated = "first" below the clock, or correct the file'
            if same
            else "correct the file, or cut it into parts where the clock starts again",
        )
    return Clock(time, kept, clock.max_gap or USUAL_GAPS * float(np.median(steps)))


def imported_part(
    sources: Mapping[str, SignalMap], clocks: Mapping[tuple[int, ClockMap], Clock], mapping: MeasuredMap
) -> tuple[float, float]:
    """Return first and last time of the imported part, on the clock of the files [s]."""
    used = [(clocks[s.file, mapping.clock(s)].time, s.delay) for s in sources.values()]
    first = max(float(time[0]) - delay for time, delay in used)
    last = min(float(time[-1]) - delay for time, delay in used)
    begin, end = first + mapping.begin, last if mapping.end is None else min(first + mapping.end, last)
    if not begin < end or end - begin > MAX_MEASURED:
        raise InputError(
            f"the part to import is from {mapping.begin:g} s to {end - first:g} s; all signals are there "
            f"for {max(last - first, 0.0):.6g} s",
            allowed=f"a part with a length, of at most {MAX_MEASURED:g} s",
            remedy="choose other times in from and to, or give the files one clock by the offset of each",
        )
    return begin, end


def check_gaps(name: str, time: Array, largest: float, part: tuple[float, float], where: str) -> None:
    """Raise InputError if readings of a signal are missing for longer than allowed."""
    begin, end = part
    steps = np.diff(time, prepend=begin - 0.5 * largest, append=end + 0.5 * largest)
    worst = int(np.argmax(steps))
    if steps[worst] > largest * (1.0 + 1e-9):
        at = (time[worst - 1] if worst else begin) - begin
        raise InputError(
            f"{where}: {int((steps > largest).sum())} gaps in the readings of {name}, the largest of "
            f"{steps[worst]:.4g} s at {at:.6g} s of the part",
            allowed=f"at most {largest:.4g} s between two readings",
            remedy="choose a part without gaps by from and to, or allow them by max_gap below the clock",
        )

"""Clocks of measured files: the times of their rows, gaps, and the part that all signals cover."""

from collections.abc import Mapping
from math import ceil, floor, log10
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.scenario import MeasuredScenario, nanoseconds
from cranectl.support import Array, InputError, Mask, TableHead
from cranectl.tools.measured.mapping import TIMES, ClockMap, MeasuredMap, SignalMap

USUAL_GAPS = 10.0  # times the usual step that rows may be apart

MIN_ROWS = 10
MAX_LOG_SAMPLES = 3_600_000  # of a log; an hour at 1 kHz


class Readings(NamedTuple):
    """One signal on the clock of its file."""

    time: Array  # (N,) [s]
    values: Array  # (N,) in SI units


class Clock(NamedTuple):
    """The times of the rows of a file."""

    time: Array  # (N,) [s], of the rows that are kept
    kept: NDArray[np.intp] | slice  # the rows that are kept, in the order of time
    rows: int  # of the file
    largest_gap: float  # [s] that readings may be apart
    remark: str = ""  # on rows that were sorted

    @property
    def period_ns(self) -> int:
        """The usual time between two rows, rounded to three digits [ns]."""
        return max(nanoseconds(float(f"{float(np.median(np.diff(self.time))):.3g}")), 1000)

    @staticmethod
    def read(head: TableHead, clock: ClockMap, signal: SignalMap, where: str) -> "Clock":
        """Read the clock of a file; raise InputError if it stands still or runs back."""
        if clock.column is None:
            assert clock.period is not None
            assert signal.column is not None
            rows = len(head.read(head.column(signal.column, where)).values)
            even = np.arange(rows, dtype=np.float64) * clock.period + clock.offset
            return Clock(even, slice(None), rows, clock.max_gap or USUAL_GAPS * clock.period)
        times = head.read(head.column(clock.column, where), is_clock=True)
        time: Array = (1.0 if times.is_time else TIMES[clock.unit]) * times.values + clock.offset
        kept = np.flatnonzero(np.isfinite(time))
        late = 0
        if not head.is_ordered:
            kept, late = _in_order(time, kept)
        if clock.repeated == "first":
            kept = kept[np.diff(time[kept], prepend=-np.inf) != 0.0]
        if len(kept) < MIN_ROWS:
            raise InputError(
                f"{where} has {len(kept)} rows with a time",
                allowed=f"at least {MIN_ROWS}",
                remedy="map another column of times",
            )
        rows = len(time)
        time = time if len(kept) == rows and not late else time[kept]
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
        largest_gap = clock.max_gap or USUAL_GAPS * float(np.median(steps))
        remark = (
            f"{late} of {rows} messages of {where} came late; they are sorted by {clock.column}"
            if late
            else ""
        )
        return Clock(time, kept if len(time) < rows or late else slice(None), rows, largest_gap, remark)


def _in_order(time: Array, kept: NDArray[np.intp]) -> tuple[NDArray[np.intp], int]:
    """Return the rows of messages in the order of their times, and how many came too late.

    A network delivers neighbours in another order. A clock that runs back further has started again.
    """
    arrived = time[kept]
    lateness = np.maximum.accumulate(arrived) - arrived
    ordered = kept[np.argsort(arrived, kind="stable")]
    usual = float(np.median(np.diff(time[ordered]))) if len(kept) > 1 else 0.0
    if lateness.max(initial=0.0) > USUAL_GAPS * usual:
        return kept, 0
    return ordered, int(np.count_nonzero(lateness))


def sample_times(part: tuple[float, float], usual_ns: int, mapping: MeasuredMap) -> NDArray[np.int64]:
    """Return the times of the log's samples (N,) [ns] in a part of the files [s], from 0 on.

    `usual_ns` is the usual time between two rows, for a map without a period. Raises InputError for too few
    samples, and for so many that they need too much memory.
    """
    length = part[1] - part[0]
    period_ns = nanoseconds(mapping.period) if mapping.period else usual_ns
    samples = nanoseconds(length) // period_ns + 1
    if MIN_ROWS <= samples <= MAX_LOG_SAMPLES:
        return np.arange(samples, dtype=np.int64) * period_ns
    is_short = samples < MIN_ROWS
    if is_short and nanoseconds(length) // usual_ns + 1 < MIN_ROWS:
        remedy = "choose other times in from and to"
    else:
        fitting = max(usual_ns, 1e9 * length / (MAX_LOG_SAMPLES - 1)) / 1e9
        remedy = f"write period = {_rounded_up(fitting):g}"
    raise InputError(
        f"{length:.6g} s with a period of {period_ns / 1e9:g} s are {samples} samples",
        allowed=f"from {MIN_ROWS} to {MAX_LOG_SAMPLES} samples",
        remedy=remedy,
    )


def _rounded_up(seconds: float) -> float:
    """Return a time that is not shorter, with two digits."""
    digit = 10.0 ** (floor(log10(seconds)) - 1)
    return ceil(seconds / digit * (1.0 - 1e-9)) * digit


def imported_part(
    sources: Mapping[str, SignalMap], clocks: Mapping[tuple[int, ClockMap], Clock], mapping: MeasuredMap
) -> tuple[float, float]:
    """Return first and last time of the imported part, on the clock of the files [s]."""
    used = [(clocks[s.file, mapping.clock(s)].time, s.delay) for s in sources.values()]
    first = max(float(time[0]) - delay for time, delay in used)
    last = min(float(time[-1]) - delay for time, delay in used)
    begin, end = first + mapping.begin, last if mapping.end is None else min(first + mapping.end, last)
    if not begin < end or end - begin > MeasuredScenario.MAX_SECONDS:
        raise InputError(
            f"the part to import is from {mapping.begin:g} s to {end - first:g} s; all signals are there "
            f"for {max(last - first, 0.0):.6g} s",
            allowed=f"a part with a length, of at most {MeasuredScenario.MAX_SECONDS:g} s",
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


def bridged(readings: Array, time: Array) -> Mask:
    """Return at which `time` (N,) a signal is bridged between readings that are unusually far apart."""
    steps = np.diff(readings)
    wide = steps > USUAL_GAPS * float(np.median(steps)) if len(steps) else np.zeros(0, dtype=np.bool_)
    if not wide.any():
        return np.zeros(len(time), dtype=np.bool_)
    rows = np.searchsorted(readings, time, side="right") - 1
    inside: Mask = wide[rows.clip(0, len(steps) - 1)]
    return inside

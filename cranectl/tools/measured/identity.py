"""Find readings that two measured runs have in common: names of files and texts of maps are no identity.

A map can change units, zeros and signs, the period of the samples and where they begin. What it cannot
change is the noise: imports of one measurement are points of one broken line through its readings. So a run
is cut into pieces of half a swing, and each piece is looked for in the other run:

1. It is most likely where the differences of its readings fit best, all channels together.
2. There, each run is interpolated at the times of the other, by the lag that fits best, with the sign and the
   zero of each channel that fit best.
3. What then remains is nothing for points of a line whose corners the other run has, and less than the noise
   for other points of it. For another run it is sqrt(1.5) to sqrt(2) times the noise, or the rounding.

A channel that hardly changes tells nothing, nor does a piece in which only one changes. All channels that
tell must agree, in two neighbouring pieces at least.
"""

import base64
import zlib
from collections.abc import Mapping, Sequence
from math import ceil, comb, inf, nan, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from cranectl.scenario import NANOSECONDS
from cranectl.simulate import Run
from cranectl.support import Array, InputError

GRAIN = 1e-6  # [m, rad] below which two readings are the same: other units in a map round otherwise
GRAINS_IN_NOISE = 20.0  # of a fingerprint whose readings are noisy
MAX_KEPT = 40_000  # samples of a fingerprint; longer runs are thinned, as they are when they are fitted
DIFFERENCES = range(3, 9)  # orders of differences that a swing hardly has, and noise has
MIN_SWING_SAMPLES = 40.0  # in a swing, from which noise is told from motion
SMALLER_HALF = 0.14263  # mean of the smaller half of squares of normal numbers
PIECE_SAMPLES = 50  # at least, of a piece
MAX_PIECES_OF_RUN = 200  # of a run; those of a long one are longer
MIN_CHANGES = 16  # samples of a piece at which a channel changes that tells something
MIN_TELLING = 2  # channels, since readings of one that are only rounded can repeat by chance
SAME_NOISE = 0.6  # of the noise of two readings, below which their difference remains in copies
REFINED = np.arange(-6, 7) / 4  # of a sample, around the best correlation
GAUSS_NEWTON_STEPS = 4
SLOPE_REACH = 1e-3  # of a sample, of the slopes for them
MAX_SHARE = 0.5  # of the telling time of a run that another may have, before both are one run


class Trace(NamedTuple):
    """Positions and angles of a run (N, 5) at even times."""

    values: Array
    period: float  # [s]
    noise: Array  # (5,), rather too small than too large
    grains: Array  # (5,) below which two readings are the same
    half_swing: float  # [s]

    def at(self, time: Array) -> Array:
        """Return the values (..., 5) at times [s] of any shape, between two samples."""
        own = self.times(np.arange(len(self.values)))
        return np.stack([np.interp(time, own, values) for values in self.values.T], axis=-1)

    def times(self, rows: NDArray[np.intp]) -> Array:
        """Return the times of rows [s]."""
        return self.period * rows.astype(np.float64)

    def rows(self, begin: float, end: float) -> NDArray[np.intp]:
        """Return the rows from `begin` to `end` [s]."""
        first, last = ceil(begin / self.period - 1e-6), int(end / self.period + 1e-6)
        return np.arange(max(first, 0), min(last + 1, len(self.values)))

    @staticmethod
    def of(run: Run) -> "Trace":
        """Return the readings of a measured run."""
        values = run.state.joints
        period = float(run.time_ns[1] - run.time_ns[0]) / NANOSECONDS if len(run.time_ns) > 1 else 1.0
        rope = max(float(np.median(np.abs(values[:, 2]))), GRAIN)
        half_swing = pi * sqrt(rope / run.scenario.rig.gravity)
        is_fast = 2.0 * half_swing > MIN_SWING_SAMPLES * period
        noise = np.array([_noise(column) if is_fast else 0.0 for column in values.T])
        return Trace(values, period, noise, np.maximum(GRAIN, noise / GRAINS_IN_NOISE), half_swing)

    @staticmethod
    def recalled(kept: Mapping[str, Any]) -> "Trace":
        """Return the readings of a fingerprint; raise ValueError, LookupError or TypeError for other data."""
        try:
            steps = zlib.decompress(base64.b85decode(kept["steps"]))
        except zlib.error as error:
            raise ValueError(str(error)) from None
        counts = np.ascontiguousarray(np.frombuffer(steps, np.uint8).reshape(8, -1).T).view("<i8")
        noise, grains = (np.array(kept[name], dtype=np.float64) for name in ("noise", "grains"))
        values = counts.reshape(len(grains), -1).cumsum(axis=1).T * grains
        return Trace(values, float(kept["period"]), noise, grains, float(kept["half_swing"]))

    @staticmethod
    def overlap(own: "Trace", other: "Trace") -> "Overlap":
        """Return for how long a run has the readings of another one."""
        step = max(own.period, other.period)
        duration = own.period * (len(own.values) - 1)
        length = max(own.half_swing, PIECE_SAMPLES * step, duration / MAX_PIECES_OF_RUN)
        pieces = max(int(duration / length), min(2, int(duration / (MIN_CHANGES * step))))
        if not pieces or len(other.values) <= MIN_CHANGES:
            return Overlap(0.0, 0.0)
        length = duration / pieces
        search = PieceSearch(other, step, ceil(step / min(own.period, other.period) - 1e-6))
        lags = [_lag(own, other, search, own.rows(k * length, (k + 1) * length)) for k in range(pieces)]
        telling = sum(lag is not None for lag in lags)
        follows = np.abs(np.diff([nan if lag is None else lag for lag in lags])) < step  # nothing follows nan
        common = int((np.append(follows, False) | np.append(False, follows)).sum())
        return Overlap(length * common, common / max(telling, 1))


class Overlap(NamedTuple):
    """What a run has in common with another."""

    seconds: float
    share: float  # of the time in which its readings tell something


def _noise(values: Array) -> float:
    """Return the deviation of white noise of readings (N,), rather too small than too large.

    It is read from the smaller half of differences, of the order that has least: jerks of a drive are few.
    """
    estimates = []
    for order in DIFFERENCES:
        squares = np.sort(np.square(np.diff(values, order)))[: max(len(values) - order, 0) // 2]
        size = float(squares.mean()) if len(squares) else 0.0
        estimates.append(sqrt(size / (SMALLER_HALF * comb(2 * order, order))))
    return min(estimates)


def fingerprint(run: Run) -> dict[str, Any]:
    """Return plain data by which the readings of a measured run are known again."""
    trace = Trace.of(run)
    thin = ceil(len(trace.values) / MAX_KEPT)
    counts = np.round(trace.values[::thin] / trace.grains).astype("<i8")
    steps = np.diff(counts, axis=0, prepend=0).T.reshape(-1, 1).view(np.uint8)
    text = base64.b85encode(zlib.compress(steps.T.tobytes(), 9)).decode("ascii")  # equal bytes side by side
    return {
        "period": thin * trace.period,
        "noise": trace.noise.tolist(),
        "grains": trace.grains.tolist(),
        "half_swing": trace.half_swing,
        "steps": text,
    }


class PieceSearch:
    """Where in a trace a piece of another run is most likely from."""

    def __init__(self, trace: Trace, step: float, phases: int) -> None:
        self.step, self.phases = step, phases
        values = trace.at(np.arange(0.0, trace.period * (len(trace.values) - 1), step / phases))
        differences = values[phases:] - values[:-phases]
        rows = len(differences) // phases
        self.differences = differences[: rows * phases].reshape(rows, phases, 5)
        self.size = next_fast_len(2 * rows, real=True)
        self.spectrum = rfft(self.differences, self.size, axis=0)
        self.energy = np.cumsum(np.pad(self.differences**2, ((1, 0), (0, 0), (0, 0))), axis=0)

    def best(self, values: Array) -> float:
        """Return the time of the trace at which readings (n, C), one each `step`, begin."""
        piece = np.diff(values, axis=0)[: len(self.differences)]
        count = len(piece)
        spectrum = np.conj(rfft(piece, self.size, axis=0))[:, None]
        sums = irfft(self.spectrum * spectrum, self.size, axis=0)[: len(self.differences) - count + 1]
        energy = self.energy[count:] - self.energy[:-count]
        own = np.square(piece).sum(axis=0)
        distance = ((energy - 2.0 * np.abs(sums)) / (own + count * GRAIN**2)).sum(axis=2)
        row, phase = np.unravel_index(int(np.argmin(distance)), distance.shape)
        return float(self.step * (row + phase / self.phases))


def _lag(own: Trace, other: Trace, search: PieceSearch, rows: NDArray[np.intp]) -> float | None:
    """Return how much later the other trace has these rows [s].

    It is nan for a trace without them, and None for rows that tell nothing.
    """
    time, readings = own.times(rows), own.values[rows]
    tells = (np.abs(np.diff(readings, axis=0)) > GRAIN).sum(axis=0) >= MIN_CHANGES
    if tells.sum() < MIN_TELLING:
        return None
    noise = np.hypot(own.noise, other.noise)
    lag = search.best(own.at(np.arange(time[0], time[-1] + 0.5 * search.step, search.step))) - time[0]
    weights = tells / np.maximum(noise, GRAIN)
    lag, signs = _refined(
        weights * readings, time, other, weights, lag + REFINED * search.step / search.phases
    )
    there = other.rows(time[0] + lag, time[-1] + lag)
    if len(there) < MIN_CHANGES:
        return nan
    allowed = np.maximum(np.maximum(own.grains, other.grains), SAME_NOISE * noise)
    remaining = (
        readings - signs * other.at(time + lag),
        other.values[there] - signs * own.at(other.times(there) - lag),
    )
    same = any((r.std(axis=0) <= allowed)[tells].all() for r in remaining)
    return lag if same else nan


def _refined(readings: Array, time: Array, other: Trace, weights: Array, lags: Array) -> tuple[float, Array]:
    """Return the lag [s] of least squares, from the best of `lags` on, and the sign of each channel."""
    readings = readings - readings.mean(axis=0)
    tried = other.at(time + lags[:, None]) * weights
    tried -= tried.mean(axis=1, keepdims=True)
    products = (tried * readings).sum(axis=1)
    k = int(np.argmin((tried**2).sum(axis=(1, 2)) - 2.0 * np.abs(products).sum(axis=1)))
    lag, signs = float(lags[k]), np.where(products[k] < 0.0, -1.0, 1.0)
    best, beside = (inf, lag), SLOPE_REACH * other.period
    for _ in range(GAUSS_NEWTON_STEPS + 1):
        before, others, after = other.at(time + lag + beside * np.array([[-1.0], [0.0], [1.0]]))
        slopes = signs * weights * (after - before) / (2.0 * beside)
        slopes -= slopes.mean(axis=0)
        remaining = readings - signs * weights * (others - others.mean(axis=0))
        best = min(best, (float((remaining**2).sum()), lag))
        lag += float((slopes * remaining).sum()) / max(float((slopes**2).sum()), 1e-300)
    return best[1], signs


def repeated_in(run: Trace, others: Sequence[Trace]) -> int | None:
    """Return the number of the trace, from 0 on, that has most of the run's readings or the reverse."""
    for k, other in enumerate(others):
        is_longer = len(run.values) * run.period > len(other.values) * other.period
        if Trace.overlap(*((other, run) if is_longer else (run, other))).share > MAX_SHARE:
            return k
    return None


def check_all_differ(runs: Sequence[Run]) -> None:
    """Raise InputError if a run has most of its readings in another one, so that they would count twice."""
    traces = [Trace.of(run) for run in runs]
    for k, trace in enumerate(traces):
        if (first := repeated_in(trace, traces[:k])) is not None:
            raise InputError(
                f"log {k + 1} has the same readings as log {first + 1}",
                allowed="logs of different runs, whose spread tells how exact the numbers are",
                remedy=f"leave out log {k + 1}",
            )

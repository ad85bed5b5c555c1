"""Turn way points and recorded samples into splines, or refuse them."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from cranectl.reference.files import AXES, RecordedMotion, read_motion
from cranectl.reference.fitting import RecordedSamples, interpolate_path, interpolate_points
from cranectl.reference.sanity import check_demand, check_numbers, check_samples
from cranectl.scenario import FromFile, Hold, Samples, Scenario, Spline, WayPoints
from cranectl.support import Array, InputError

NEGLIGIBLE_SHARE = 0.2  # of the settling tolerance: 1 mm on the laboratory rig
EXACT_SHARE = (
    1e-4  # of a negligible distance, 0.1 µm; below it knots follow a simulated load's residual swing
)
MAX_COEFFICIENT = 1e4  # [m] of a spline, in magnitude
TIMES_REMEDY = "correct the times or units.time"
BAND_POINTS = 16  # per span, at which the band is evaluated


def spline_segments(
    segment: FromFile, start: Array, scenario: Scenario, directory: Path, where: str
) -> Sequence[Spline | Hold]:
    """Return the splines and rests that take the place of way points or samples.

    Raises InputError for points, times or a file that do not fit the scenario.
    """
    if isinstance(segment, Samples):
        return [fit_samples(segment, start, scenario, directory, where)]
    assert isinstance(segment, WayPoints)
    return interpolate_way_points(segment, start, scenario, directory, where)


def interpolate_way_points(
    segment: WayPoints, start: Array, scenario: Scenario, directory: Path, where: str
) -> list[Spline | Hold]:
    """Return the splines through a segment's points, with a rest wherever a point is repeated.

    Raises InputError for points, times or a file that do not fit the scenario.
    """
    motion = None
    if segment.file is not None:
        timing = "speed" if segment.columns.speed else "time"
        positions_only = segment.times or segment.speed is not None or (segment.time_law and timing == "time")
        kinds = AXES if positions_only else (timing, *AXES)
        motion = read_motion(directory / segment.file, segment, kinds, where)
        where = f"{where}: {segment.file}"
    points = np.array(segment.points) if motion is None else motion.points
    if not 2 <= len(points) <= segment.MAX_POINTS:
        raise InputError(
            f"{where}: {len(points)} points",
            allowed=f"2 to {segment.MAX_POINTS} points for a spline through each",
            remedy='for a spline near more points use kind = "samples"',
        )
    # The points alone, since times may be computed from them.
    check_numbers(np.arange(len(points), dtype=np.float64), points, where)
    time = _times(segment, motion, points, where)
    check_numbers(time, points, where)
    if segment.time_law is None:
        scenario.check_reference_fits(time[-1] - time[0], f"{where} lasts", TIMES_REMEDY)
    points = _apply_offset(points, segment, start, scenario, first=points[0], error=np.zeros(3), where=where)
    points[0] = start
    time = time - time[0]
    if segment.time_law is not None:
        return [_spline_segment(segment, _curve_through(segment, time, points, scenario, where), motion)]
    segments: list[Spline | Hold] = []
    for first, last, rests in _split_at_rests(points, EXACT_SHARE * _negligible(scenario)):
        local_time = time[first : last + 1] - time[first]
        if rests:
            points[first : last + 1] = points[first]
            rest = {"kind": "hold", "duration": float(local_time[-1])}
            segments.append(Hold.from_table(rest, f"{where}, a rest"))
            continue
        curve = _curve_through(segment, local_time, points[first : last + 1], scenario, where)
        check_demand([curve], scenario, where, begins=float(time[first]))
        segments.append(_spline_segment(segment, curve, motion))
    return segments


def _split_at_rests(points: Array, tolerance: float) -> Iterator[tuple[int, int, bool]]:
    """Yield first and last index of each part of points (N, 3), and whether it is a rest."""
    begin = index = 0
    while index < len(points) - 1:
        distances = np.linalg.norm(points[index + 1 :] - points[index], axis=1)
        apart = np.flatnonzero(distances > tolerance)
        last = index + int(apart[0]) if len(apart) else len(points) - 1
        if last > index:
            if index > begin:
                yield begin, index, False
            yield index, last, True
            begin = last
        index = max(last, index + 1)
    if begin < len(points) - 1:
        yield begin, len(points) - 1, False


def _curve_through(segment: WayPoints, time: Array, points: Array, scenario: Scenario, where: str) -> BSpline:
    """Return the spline through points (N, 3) [m] at times from 0 [s]; raise InputError if there is none."""
    curve, error = (interpolate_path if segment.time_law else interpolate_points)(time, points)
    if not (error < EXACT_SHARE * _negligible(scenario) and np.abs(curve.c).max() <= MAX_COEFFICIENT):
        raise InputError(
            f"{where}: no spline of degree {curve.k} can be computed through points so uneven in time, "
            f"{np.diff(time).min():.2g} to {np.diff(time).max():.2g} s apart",
            allowed="similar time steps",
            remedy="leave out points that are close together, or add some between those far apart",
        )
    return curve


def fit_samples(segment: Samples, start: Array, scenario: Scenario, directory: Path, where: str) -> Spline:
    """Return the spline near a segment's samples; raise InputError for unsuitable samples."""
    motion = read_motion(directory / segment.file, segment, ("time", *AXES), where)
    where = f"{where}: {segment.file}"
    tolerance = _negligible(scenario)
    times = motion.columns["time"]
    check_numbers(times, motion.points, where)
    check_samples(times, motion.points, tolerance, where)
    scenario.check_reference_fits(times[-1] - times[0], f"{where} lasts", TIMES_REMEDY)
    time = times - times[0]
    recorded = RecordedSamples(time, motion.points)
    spans = segment.spans or recorded.choose_spans(segment.MAX_SPANS, EXACT_SHARE * tolerance)
    try:
        free = recorded.fit(spans)
    except np.linalg.LinAlgError:
        raise InputError(
            f"{where}: {len(time)} samples do not determine a spline of {spans} spans",
            allowed="samples in every span",
            remedy="leave out spans, which is chosen then, or take fewer",
        ) from None
    points = _apply_offset(
        motion.points, segment, start, scenario, first=free.curve.c[0], error=free.start_error(), where=where
    )
    recorded = RecordedSamples(time, points)
    del free  # its residuals take as much memory as the points
    fit = recorded.fit(spans, start)
    band_time = np.linspace(0.0, time[-1], BAND_POINTS * spans + 1)
    check_demand((fit.curve, *fit.alternatives), scenario, where, band_time)
    peak, band = fit.snap(band_time)
    numbers = {
        "spans": spans,
        "samples": len(time),
        "left_out_error": float(np.sqrt(recorded.cross_validate(spans).mean())),
        "residual": fit.residual_rms,
        "peak_d4": peak,
        "band_d4": band,
    }
    return _spline_segment(segment, fit.curve, motion, numbers)


def _times(segment: WayPoints, motion: RecordedMotion | None, points: Array, where: str) -> Array:
    """Return the time at which each point is passed (N,) [s]."""
    stated = segment.times if segment.times is not None else segment.speed
    if stated is None and motion is not None and "time" in motion.columns:
        return motion.columns["time"]
    if isinstance(stated, tuple) and len(stated) != len(points):
        quantity = "speeds" if segment.times is None else "times"
        raise InputError(
            f"{where}: {len(stated)} {quantity} for {len(points)} points",
            allowed="one for each point",
            remedy="add or remove some",
        )
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if segment.time_law is not None or segment.times is None:
        _check_distinct(chords, segment, where)
    if segment.times is not None:
        return np.array(segment.times)
    has_speeds = segment.columns.speed is not None or segment.speed is not None
    if isinstance(segment.speed, float) or not has_speeds:  # in minimum time speeds are not needed
        mean_speeds = np.full(len(points) - 1, 1.0 if segment.speed is None else segment.speed)
        if segment.time_law is None:  # the load rests at both ends, so there the mean is half of it
            mean_speeds[[0, -1]] *= 0.5
    else:
        speeds = np.array(segment.speed) if motion is None or segment.speed else motion.columns["speed"]
        mean_speeds = 0.5 * (speeds[1:] + speeds[:-1])
    standstill = np.flatnonzero(~(mean_speeds > 0.0))
    if len(standstill):
        raise InputError(
            f"{where}: a mean speed of 0 from point {standstill[0] + 1} to the next takes forever",
            allowed="a speed above 0 at one of two neighbouring points",
            remedy="raise the speed, or give times in place of speeds",
        )
    return np.concatenate([[0.0], np.cumsum(chords / mean_speeds)])


def _check_distinct(chords: Array, segment: WayPoints, where: str) -> None:
    """Raise InputError for a repeated point where no times say how long the load rests there."""
    repeated: NDArray[np.intp] = np.flatnonzero(~(chords > 0.0))
    if not len(repeated):
        return
    duplicates = f"point{'s' * (len(repeated) > 1)} {', '.join(str(k + 2) for k in repeated)}"
    if isinstance(segment.speed, tuple):
        duplicates += " and the speeds there"
    if len(repeated) == len(chords):
        remedy = 'to stay in place use kind = "hold"'
    elif segment.time_law is not None:
        remedy = f"leave out {duplicates}; to stop there, end the segment there and begin another"
    else:
        remedy = f"leave out {duplicates}; to rest there, give times in place of speeds"
    raise InputError(
        f"{where}: point {repeated[0] + 1} and the next are the same point",
        allowed="points apart from each other, except with times and without a time_law",
        remedy=remedy,
    )


def _apply_offset(
    points: Array,
    segment: FromFile,
    start: Array,
    scenario: Scenario,
    *,
    first: Array,
    error: Array,
    where: str,
) -> Array:
    """Return the points with the segment's offset; raise InputError if `first` is not moved to `start`.

    `error` is the standard error (3,) of `first` [m].
    """
    offset = start - first if segment.offset == segment.TO_START else np.array(segment.offset)
    allowed = _negligible(scenario) + 4.0 * error  # normal noise exceeds it once in 16 000 times
    if (np.abs(first + offset - start) > allowed).any():
        coordinates = ", ".join(f"{number:.4f}" for number in first + offset)
        if (first + offset)[2] >= 0.0 > start[2] and segment.signs[2] == 1:
            raise InputError(
                f"{where} starts at [{coordinates}], not below the trolley",
                allowed="z upwards from the height of the trolley, so that a hanging load has z below 0",
                remedy="signs = [1, 1, -1] if the file counts z downwards; or offset = "
                f"'{segment.TO_START}' if it counts from elsewhere",
            )
        raise InputError(
            f"{where} starts at [{coordinates}], but the load is at {[round(x, 4) for x in start.tolist()]}",
            allowed=f"at most {1e3 * allowed.max():.2g} mm between them",
            remedy=f"reference.start = [{coordinates}] if it is the first segment, or move there before, or "
            f"offset = '{segment.TO_START}'",
        )
    moved: Array = points + offset
    return moved


def _negligible(scenario: Scenario) -> float:
    """Return a distance that is negligible on this crane [m]."""
    return NEGLIGIBLE_SHARE * scenario.metrics.settling_tolerance


def _spline_segment(
    segment: WayPoints | Samples,
    curve: BSpline,
    motion: RecordedMotion | None,
    fit: dict[str, float] | None = None,
) -> Spline:
    made = {
        "kind": "spline",
        "degree": curve.k,
        "breaks": np.unique(curve.t).tolist(),
        "coefficients": curve.c.tolist(),
        "time_law": segment.time_law if isinstance(segment, WayPoints) else None,
        "made_from": segment.model_dump(mode="json", exclude_defaults=True),
        "source": motion.source if motion else None,
        "fit": fit,
    }
    return Spline.from_table(made, f"the spline of {segment.kind}").holding(motion.content if motion else b"")

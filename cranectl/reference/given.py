"""Segments whose motion is given, by way points or by samples: what they become, and what is refused."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from cranectl.reference.files import AXES, RecordedMotion, read_motion
from cranectl.reference.fitting import Recorded, path_through, through_points
from cranectl.reference.sanity import check_demand, check_length, check_numbers, check_samples
from cranectl.scenario import Scenario
from cranectl.scenario.recorded import TO_START, FitNumbers, FromFile
from cranectl.scenario.segments import MAX_SPLINE_POINTS, MOST_SPANS, Hold, Samples, Spline, WayPoints
from cranectl.scenario.settings import parse_settings
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

NEGLIGIBLE = 0.2  # of the error below which a load counts as settled: 1 mm on the laboratory rig
EXACT = 1e-4  # of that, 0.1 µm: below it knots would follow what is left of a simulated load's swing
MAX_COEFFICIENT = 1e4  # [m] that a coefficient may be away
FASTER = "correct the times or units.time"
BAND_POINTS = 16  # in each span, where the band is looked at


def way_points(
    segment: WayPoints, start: Array, scenario: Scenario, directory: Path, where: str
) -> list[Spline | Hold]:
    """Return the splines through a segment's points, with a rest wherever a point is repeated.

    Raises InputError.
    """
    motion = None
    if segment.file is not None:
        timed = "speed" if segment.columns.speed else "time"
        untimed = segment.times or segment.speed is not None or (segment.time_law and timed == "time")
        wanted = AXES if untimed else (timed, *AXES)
        motion = read_motion(directory / segment.file, segment, wanted, where)
        where = f"{where}: {segment.file}"
    points = np.array(segment.points) if motion is None else motion.points
    if not 2 <= len(points) <= MAX_SPLINE_POINTS:
        raise InputError(
            f"{where}: {len(points)} points",
            allowed=f"2 to {MAX_SPLINE_POINTS}: a spline passes through each",
            remedy='near more than that passes kind = "samples"',
        )
    check_numbers(np.arange(len(points), dtype=np.float64), points, where)
    time = _times(segment, motion, points, where)
    check_numbers(time, points, where)
    if segment.time_law is None:
        check_length(time[-1] - time[0], scenario, f"{where} lasts", FASTER)
    points = _moved(points, segment, start, scenario, first=points[0], error=np.zeros(3), where=where)
    points[0] = start
    time = time - time[0]
    if segment.time_law is not None:
        return [_segment(segment, _curve_through(segment, time, points, scenario, where), motion)]
    segments: list[Spline | Hold] = []
    for first, last, rests in _stretches(points, EXACT * _negligible(scenario)):
        own = time[first : last + 1] - time[first]
        if rests:
            points[first : last + 1] = points[first]
            rest = {"kind": "hold", "duration": float(own[-1])}
            segments.append(parse_settings(Hold, rest, f"{where}, a rest"))
            continue
        curve = _curve_through(segment, own, points[first : last + 1], scenario, where)
        check_demand([curve], scenario, where, begins=float(time[first]))
        segments.append(_segment(segment, curve, motion))
    return segments


def _stretches(points: Array, near: float) -> Iterator[tuple[int, int, bool]]:
    """Divide way points (N, 3) into rests, where all are within `near` [m] of the first, and motions.

    Yield the first and the last index of each stretch, and whether it is a rest.
    """
    moving = at = 0
    while at < len(points) - 1:
        apart = np.flatnonzero(np.linalg.norm(points[at + 1 :] - points[at], axis=1) > near)
        last = at + int(apart[0]) if len(apart) else len(points) - 1
        if last > at:
            if at > moving:
                yield moving, at, False
            yield at, last, True
            moving = last
        at = max(last, at + 1)
    if moving < len(points) - 1:
        yield moving, len(points) - 1, False


def _curve_through(segment: WayPoints, time: Array, points: Array, scenario: Scenario, where: str) -> BSpline:
    """Return the spline through points (N, 3) [m] at times from 0 [s]; raise InputError if there is none."""
    curve, error = (path_through if segment.time_law else through_points)(time, points)
    if not (error < EXACT * _negligible(scenario) and np.abs(curve.c).max() <= MAX_COEFFICIENT):
        raise InputError(
            f"{where}: no spline of degree {curve.k} can be computed through points so uneven in time",
            allowed=f"steps of time alike: now {np.diff(time).min():.2g} to {np.diff(time).max():.2g} s",
            remedy="leave out points that are close together, or add some between those far apart",
        )
    return curve


def samples(segment: Samples, start: Array, scenario: Scenario, directory: Path, where: str) -> Spline:
    """Return the spline near a segment's samples; raises InputError."""
    motion = read_motion(directory / segment.file, segment, ("time", *AXES), where)
    where = f"{where}: {segment.file}"
    tolerance = _negligible(scenario)
    times = motion.columns["time"]
    check_numbers(times, motion.points, where)
    check_samples(times, motion.points, tolerance, where)
    check_length(times[-1] - times[0], scenario, f"{where} lasts", FASTER)
    time = times - times[0]
    recorded = Recorded(time, motion.points)
    spans = segment.spans or recorded.best_spans(MOST_SPANS, EXACT * tolerance)
    try:
        free = recorded.fitted(spans)
    except np.linalg.LinAlgError:
        raise InputError(
            f"{where}: {len(time)} samples do not determine a spline of {spans} spans",
            allowed="samples in every span",
            remedy="leave out spans: it is chosen then, or take fewer",
        ) from None
    points = _moved(
        motion.points, segment, start, scenario, first=free.curve.c[0], error=free.start_error(), where=where
    )
    recorded = Recorded(time, points)
    del free  # its residuals take as much memory as the points
    fit = recorded.fitted(spans, start)
    at = np.linspace(0.0, time[-1], BAND_POINTS * spans + 1)
    check_demand((fit.curve, *fit.drawn), scenario, where, at)
    peak, band = fit.snap(at)
    numbers = FitNumbers(
        spans=spans,
        samples=len(time),
        left_out_error=float(np.sqrt(recorded.left_out(spans).mean())),
        residual=fit.residual_rms,
        peak_d4=peak,
        band_d4=band,
    )
    return _segment(segment, fit.curve, motion, numbers)


def _times(segment: WayPoints, motion: RecordedMotion | None, points: Array, where: str) -> Array:
    """Return when each point is passed (N,) [s]."""
    stated = segment.times if segment.times is not None else segment.speed
    if stated is None and motion is not None and "time" in motion.columns:
        return motion.columns["time"]
    if isinstance(stated, tuple) and len(stated) != len(points):
        what = "speeds" if segment.times is None else "times"
        raise InputError(
            f"{where}: {len(stated)} {what} for {len(points)} points",
            allowed="one for each point",
            remedy="add or remove some",
        )
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if segment.time_law is not None or segment.times is None:
        _check_apart(chords, segment, where)
    if segment.times is not None:
        return np.array(segment.times)
    chosen = segment.columns.speed is not None or segment.speed is not None
    if isinstance(segment.speed, float) or not chosen:  # in minimum time nothing need be
        along = np.full(len(points) - 1, 1.0 if segment.speed is None else segment.speed)
        if segment.time_law is None:  # at rest at both ends, there half of it is the mean
            along[[0, -1]] *= 0.5
    else:
        speeds = np.array(segment.speed) if motion is None or segment.speed else motion.columns["speed"]
        along = 0.5 * (speeds[1:] + speeds[:-1])
    still = np.flatnonzero(~(along > 0.0))
    if len(still):
        raise InputError(
            f"{where}: a mean speed of 0 from point {still[0] + 1} to the next: it takes for ever",
            allowed="a speed above 0 at one of two neighbouring points",
            remedy="raise the speed, or give times in place of speeds",
        )
    return np.concatenate([[0.0], np.cumsum(chords / along)])


def _check_apart(chords: Array, segment: WayPoints, where: str) -> None:
    """Raise InputError for a repeated point where nothing says how long the load rests there."""
    repeated: NDArray[np.intp] = np.flatnonzero(~(chords > 0.0))
    if not len(repeated):
        return
    again = f"point{'s' * (len(repeated) > 1)} {', '.join(str(k + 2) for k in repeated)}"
    if isinstance(segment.speed, tuple):
        again += " and the speeds there"
    if len(repeated) == len(chords):
        remedy = 'to stay in place use kind = "hold"'
    elif segment.time_law is not None:
        remedy = f"leave out {again}; to stop there, end the segment there and begin another"
    else:
        remedy = f"leave out {again}; to rest there, give times in place of speeds"
    raise InputError(
        f"{where}: no way from point {repeated[0] + 1} to the next: both are the same point",
        allowed="points apart from each other, except with times and without a time_law",
        remedy=remedy,
    )


def _moved(
    points: Array,
    segment: FromFile,
    start: Array,
    scenario: Scenario,
    *,
    first: Array,
    error: Array,
    where: str,
) -> Array:
    """Return the points where the segment wants them; raises InputError unless `first` is `start` then.

    `error`: standard error (3,) of `first` [m].
    """
    offset = start - first if segment.offset == TO_START else np.array(segment.offset)
    away = np.abs(first + offset - start)
    allowed = _negligible(scenario) + 4.0 * error
    if (away > allowed).any():
        coordinates = ", ".join(f"{number:.4f}" for number in first + offset)
        if (first + offset)[2] >= 0.0 > start[2] and segment.signs[2] == 1:
            raise InputError(
                f"{where} starts at [{coordinates}], not below the trolley",
                allowed="z upwards from the height of the trolley, so that a hanging load has z below 0",
                remedy="signs = [1, 1, -1] if the file counts z downwards; or offset = "
                f"'{TO_START}' if it counts from elsewhere",
            )
        raise InputError(
            f"{where} starts at [{coordinates}], "
            f"where the load is at {[round(x, 4) for x in start.tolist()]}",
            allowed=f"at most {1e3 * allowed.max():.2g} mm between them",
            remedy=f"reference.start = [{coordinates}] if it is the first segment, or move there before, or "
            f"offset = '{TO_START}'",
        )
    moved: Array = points + offset
    return moved


def _negligible(scenario: Scenario) -> float:
    """Return a distance that does not matter on this crane [m]."""
    return NEGLIGIBLE * scenario.metrics.settling_tolerance


def _segment(
    segment: WayPoints | Samples, curve: BSpline, motion: RecordedMotion | None, fit: FitNumbers | None = None
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
    return parse_settings(Spline, made, f"the spline of {segment.kind}").holding(
        motion.held if motion else b""
    )

"""Segments whose motion is given, by way points or by samples: what they become, and what is refused."""

from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline

from cranectl.reference.drive_demand import check_demand
from cranectl.reference.files import AXES, Motion, read_motion
from cranectl.reference.fitting import Fit, Recorded, path_through, through_points
from cranectl.reference.sanity import check_numbers, check_samples
from cranectl.scenario import Scenario
from cranectl.scenario.segments import MOST_POINTS, MOST_SPANS, Samples, Spline, WayPoints
from cranectl.scenario.settings import parse_settings
from cranectl.scenario.tables import TO_START, FitNumbers, FromFile
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

NEGLIGIBLE = 0.2  # of the error below which a load counts as settled: 1 mm on the laboratory rig
EXACT = 1e-4  # of that, 0.1 µm: below it knots would follow what is left of a simulated load's swing
FARTHEST = 1e4  # [m] that a coefficient may be away
BAND_POINTS = 16  # in each span, where the band is looked at


def way_points(segment: WayPoints, start: Array, scenario: Scenario, directory: Path, where: str) -> Spline:
    """The spline through a segment's points; raises InputError."""
    motion = None
    if segment.file is not None:
        timed = "speed" if segment.columns.speed else "time"
        untimed = segment.times or segment.speed is not None or (segment.time_law and timed == "time")
        wanted = AXES if untimed else (timed, *AXES)
        motion = read_motion(directory / segment.file, segment, wanted, where)
        where = f"{where}: {segment.file}"
    points = np.array(segment.points) if motion is None else motion.points
    if not 2 <= len(points) <= MOST_POINTS:
        raise InputError(
            f"{where}: {len(points)} points",
            allowed=f"2 to {MOST_POINTS}: a spline passes through each",
            remedy='near more than that passes kind = "samples"',
        )
    check_numbers(np.arange(len(points), dtype=np.float64), points, where)
    time = _times(segment, motion, points, where)
    check_numbers(time, points, where)
    if segment.time_law is None:
        _check_length(time, scenario, where)
    points = _moved(points, points[0], segment, start, scenario, np.zeros(3), where)
    points[0] = start
    time = time - time[0]
    curve = (path_through if segment.time_law else through_points)(time, points)
    astray = np.abs(curve(time) - points).max() >= EXACT * _negligible(scenario)
    if astray or not np.abs(curve.c).max() <= FARTHEST:
        raise InputError(
            f"{where}: no spline of degree {curve.k} can be computed through points so uneven in time",
            allowed=f"steps of time alike: now {np.diff(time).min():.2g} to {np.diff(time).max():.2g} s",
            remedy="leave out points that are close together, or add some between those far apart",
        )
    if segment.time_law is None:
        check_demand([curve], scenario, where)
    return _segment(segment, curve, motion)


def samples(segment: Samples, start: Array, scenario: Scenario, directory: Path, where: str) -> Spline:
    """The spline near a segment's samples; raises InputError."""
    motion = read_motion(directory / segment.file, segment, ("time", *AXES), where)
    where = f"{where}: {segment.file}"
    tolerance = _negligible(scenario)
    check_numbers(motion.columns["time"], motion.points, where)
    check_samples(motion.columns["time"], motion.points, tolerance, where)
    _check_length(motion.columns["time"], scenario, where)
    time = motion.columns["time"] - motion.columns["time"][0]
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
    points = _moved(motion.points, free.curve.c[0], segment, start, scenario, free.start_error(), where)
    recorded = Recorded(time, points)
    fit = recorded.fitted(spans, start)
    at = np.linspace(0.0, time[-1], BAND_POINTS * spans + 1)
    check_demand((fit.curve, *fit.drawn), scenario, where, at)
    return _segment(segment, fit.curve, motion, _numbers(fit, recorded, spans, at))


def _check_length(time: Array, scenario: Scenario, where: str) -> None:
    length = time[-1] - time[0]
    if length > scenario.duration * (1.0 + 1e-12):
        raise InputError(
            f"{where} lasts {length:.6g} s, longer than the run, {scenario.duration:g} s",
            allowed="a run that its reference fits into",
            remedy=f"duration = {np.ceil(length):g} or more, or correct units.time",
        )


def _times(segment: WayPoints, motion: Motion | None, points: Array, where: str) -> Array:
    """When each point is passed (N,) [s]."""
    given = segment.times if segment.times is not None else segment.speed
    if given is None and motion is not None and "time" in motion.columns:
        return motion.columns["time"]
    if isinstance(given, tuple) and len(given) != len(points):
        what = "speeds" if segment.times is None else "times"
        raise InputError(
            f"{where}: {len(given)} {what} for {len(points)} points",
            allowed="one for each point",
            remedy="add or remove some",
        )
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
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    for what, wrong in (("no way", ~(chords > 0.0)), ("a mean speed of 0", ~(along > 0.0))):
        if wrong.any():
            k = int(np.argmax(wrong))
            raise InputError(
                f"{where}: {what} from point {k + 1} to the next: it takes no time, or for ever",
                allowed="points apart from each other, with speeds above 0 between them",
                remedy="give times, or correct the point",
            )
    return np.concatenate([[0.0], np.cumsum(chords / along)])


def _moved(
    points: Array, first: Array, segment: FromFile, start: Array, scenario: Scenario, error: Array, where: str
) -> Array:
    """The points where the segment wants them; raises InputError unless `first` is `start` then.

    `error`: standard error (3,) of `first` [m].
    """
    offset = start - first if segment.offset == TO_START else np.array(segment.offset)
    away = np.abs(first + offset - start)
    allowed = _negligible(scenario) + 4.0 * error
    if (away > allowed).any():
        told = ", ".join(f"{number:.4f}" for number in first + offset)
        raise InputError(
            f"{where} starts at [{told}], where the load is at {[round(x, 4) for x in start.tolist()]}",
            allowed=f"at most {1e3 * allowed.max():.2g} mm between them",
            remedy=f"reference.start = [{told}] if it is the first segment, or move there before, or "
            f"offset = '{TO_START}'",
        )
    moved: Array = points + offset
    return moved


def _negligible(scenario: Scenario) -> float:
    """Distance that does not matter on this crane [m]."""
    return NEGLIGIBLE * scenario.metrics.settling_tolerance


def _numbers(fit: Fit, recorded: Recorded, spans: int, at: Array) -> FitNumbers:
    peak, band = fit.snap(at)
    return FitNumbers(
        spans=spans,
        samples=len(recorded.time),
        left_out_error=float(np.sqrt(recorded.left_out(spans).mean())),
        residual=fit.residual_rms,
        peak_d4=peak,
        band_d4=band,
    )


def _segment(
    segment: WayPoints | Samples, curve: BSpline, motion: Motion | None, fit: FitNumbers | None = None
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

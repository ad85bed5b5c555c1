"""Check motions from files and points: finite, ordered, without gaps or jumps, feasible for the drives."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BSpline

from cranectl.model import states_and_inputs
from cranectl.reference.time_laws import derivatives
from cranectl.scenario import Scenario
from cranectl.signals import ACCELERATION, State, Z
from cranectl.support import Array, InputError

MIN_SAMPLES = 50  # ten folds of five samples
END_SAMPLES = 10  # from which rest at an end is judged, or all within 0.1 s if these are more
# Map coordinates and seconds since 1970 are smaller; a double resolves 0.02 µm and 0.1 ms of these limits.
MAX_COORDINATE, MAX_TIME = 1e8, 1e12  # [m], [s]
MAX_STEP_RATIO = 5.0  # of a time step to the median step
MAX_RAMP = 16.0  # [m/s²] of the load between neighbouring samples, four times a usual ramp of a drive
# A jump is a distance from the line between neighbours above 8 times the 80 % quantile of these distances.
# For normal noise that is ten standard deviations; jumps in a tenth of the samples hardly change it.
JUMP_QUANTILE, JUMP_RATIO = 0.8, 8.0
DRIVES = ("bridge", "trolley", "rope")
DEMAND_QUANTILE = 0.975  # of the peaks of all motions that the samples may mean
UNITS = {"velocity": "m/s", "acceleration": "m/s²"}


def check_numbers(time: Array, points: Array, where: str) -> None:
    """Raise InputError for NaN, infinity, numbers beyond all cranes, and times that do not increase."""
    invalid = np.flatnonzero(~np.isfinite(np.column_stack([time, points])).all(axis=1))
    if len(invalid):
        raise InputError(
            f"{where}: sample {invalid[0] + 1} is no number: time {time[invalid[0]]:g} s, "
            f"x, y, z = {_point_text(points[invalid[0]])}"
            + (f", and {len(invalid) - 1} more" if len(invalid) > 1 else ""),
            allowed="numbers in all rows",
            remedy="leave these rows out, or record the motion again",
        )
    far = np.flatnonzero((np.abs(points) > MAX_COORDINATE).any(axis=1) | (np.abs(time) > MAX_TIME))
    if len(far):
        raise InputError(
            f"{where}: sample {far[0] + 1} is at {time[far[0]]:g} s, "
            f"x, y, z = {_point_text(points[far[0]])} m",
            allowed=f"at most {MAX_COORDINATE:g} m and {MAX_TIME:g} s from zero",
            remedy="correct the units, or record the motion again",
        )
    unordered = np.flatnonzero(np.diff(time) <= 0.0)
    if len(unordered):
        k = unordered[0]
        raise InputError(
            f"{where}: time does not increase: sample {k + 1} is at {time[k]:.9g} s, "
            f"the next at {time[k + 1]:.9g} s",
            allowed="times that increase from each sample to the next",
            remedy="sort the rows, and keep one of each time",
        )


def check_samples(time: Array, points: Array, tolerance: float, where: str) -> None:
    """Raise InputError for too few samples, gaps, jumps larger than `tolerance` [m], and ends in motion."""
    if len(time) < MIN_SAMPLES:
        raise InputError(
            f"{where}: {len(time)} samples",
            allowed=f"at least {MIN_SAMPLES} samples, since tenths of them are left out to choose the knots",
            remedy='record more often, or take them as points: kind = "waypoints"',
        )
    steps = np.diff(time)
    median, longest = float(np.median(steps)), int(np.argmax(steps))
    if steps[longest] > MAX_STEP_RATIO * median:
        raise InputError(
            f"{where}: a gap of {steps[longest]:.3g} s after {time[longest]:.6g} s, where the usual "
            f"step is {median:.3g} s",
            allowed=f"steps of at most {MAX_STEP_RATIO:g} times the usual one",
            remedy="fill it in, or cut the file there into two",
        )
    before, after = steps[:-1], steps[1:]
    between = (after[:, np.newaxis] * points[:-2] + before[:, np.newaxis] * points[2:]) / (before + after)[
        :, np.newaxis
    ]
    distance = np.linalg.norm(points[1:-1] - between, axis=1)
    # An acceleration a moves a point by a · before · after / 2 from that line.
    limit = tolerance + 0.5 * MAX_RAMP * before * after + JUMP_RATIO * np.quantile(distance, JUMP_QUANTILE)
    worst = int(np.argmax(distance / limit))
    if distance[worst] > limit[worst]:
        raise InputError(
            f"{where}: a jump at {time[worst + 1]:.6g} s: sample {worst + 2} lies "
            f"{1e3 * distance[worst]:.3g} mm beside the line between its neighbours",
            allowed=f"at most {1e3 * limit[worst]:.3g} mm there, for {MAX_RAMP:g} m/s² and this file's noise",
            remedy="leave such samples out, or record the motion again",
        )
    check_rest(time, points, tolerance, where)


def check_rest(time: Array, points: Array, tolerance: float, where: str) -> None:
    """Raise InputError for samples that begin or end in motion, since the spline near them rests there."""
    count = max(END_SAMPLES, int(np.searchsorted(time, time[0] + 0.1)))
    for end, part in (("begin", slice(None, count)), ("end", slice(-count, None))):
        centred_time = time[part] - time[part].mean()
        centred = points[part] - points[part].mean(axis=0)
        velocity = centred_time @ centred / (centred_time @ centred_time)
        noise = np.linalg.norm((centred - np.outer(centred_time, velocity)).std(axis=0))
        travel = np.linalg.norm(velocity) * np.ptp(centred_time)
        # Of the slope through evenly spaced samples, times the time that they span.
        standard_error = np.sqrt(12.0 / count) * noise
        if travel > tolerance + 4.0 * standard_error:  # normal noise exceeds it once in 16 000 times
            raise InputError(
                f"{where}: the samples {end} in motion, with {np.linalg.norm(velocity):.3g} m/s",
                allowed="a motion from rest to rest",
                remedy="record it with a rest before and after, or cut it there",
            )


def _point_text(point: Array) -> str:
    return ", ".join(f"{number:g}" for number in point)


def check_demand(
    curves: Sequence[BSpline],
    scenario: Scenario,
    where: str,
    time: Array | None = None,
    begins: float = 0.0,
) -> None:
    """Raise InputError where velocity or acceleration of a set-point exceeds the drives' limits.

    The limits are those of `effects.limits`, or of the rig without that effect. Of several `curves`, which
    are equally likely, the upper quantile of the peaks counts. They are evaluated at `time` (N,) [s], by
    default at every control sample; `begins` is when the motion begins in its segment [s]. A motion with a
    slack rope has no set-points. It passes here, and its run is refused.
    """
    if time is None:
        time = np.arange(0.0, curves[0].t[-1], scenario.control.period)
    demands = [demand for curve in curves if (demand := _demand(curve, scenario, time)) is not None]
    if not demands:
        return
    limits = scenario.drive_limits
    allowed = np.array([limits.velocity, limits.acceleration])
    peaks = np.quantile(np.abs(demands).max(axis=2), DEMAND_QUANTILE if len(demands) > 1 else 1.0, axis=0)
    exceeded = np.argwhere(peaks > allowed)
    if not len(exceeded):
        return
    kind, drive = exceeded[0]
    quantity, unit = list(UNITS.items())[kind]
    when = begins + time[int(np.argmax(np.abs(demands[0][kind, :, drive])))]
    key = f"{scenario.drive_limits_key}.{quantity}"
    likely = ", the upper end of what its noise leaves open," if len(demands) > 1 else ""
    raise InputError(
        f"{where} asks the set-point of the {DRIVES[drive]} for {peaks[kind, drive]:.3g} {unit}{likely} "
        f"near {when:.3g} s",
        allowed=f"{quantity} up to {allowed[kind, drive]:g} {unit}, as {key} says",
        remedy="give the motion more time, or fewer knots by spans"
        if len(demands) > 1
        else f"give the motion more time, or raise {key} if the drive can do more",
    )


def _demand(curve: BSpline, scenario: Scenario, time: Array) -> Array | None:
    """Return velocity and acceleration (2, N, 3) of the set-points w = v + tau u; None for a slack rope."""
    rows = np.hstack([derivative(time) for derivative in derivatives(curve)])
    gravity = scenario.rig.gravity
    if (rows[:, ACCELERATION + Z] <= -gravity).any() or (rows[:, Z] >= 0.0).any():
        return None
    states, inputs = states_and_inputs(rows, gravity)
    lag = scenario.rig.time_constants if scenario.control.lag_compensation else 0.0
    set_point = State(states).axis_rates + lag * inputs
    return np.array([set_point, np.gradient(set_point, time, axis=0)])

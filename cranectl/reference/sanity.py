"""What a given motion must be: numbers, times that increase, no holes, no longer or faster than there is."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BSpline

from cranectl.model.flatness import states_and_inputs
from cranectl.reference.time_laws import derivatives
from cranectl.scenario import Scenario
from cranectl.scenario.settings import MAX_DURATION
from cranectl.signals import ACCELERATION, Z
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

LEAST_SAMPLES = 50  # ten folds of five to leave out
NEAR_END = 10  # samples, or more within 0.1 s
# Coordinates of a map and seconds since 1970 are less; of these a double still tells 0.02 µm and 0.1 ms.
MAX_DISTANCE, LATEST = 1e8, 1e12  # [m], [s]
GAP = 5.0  # of the usual step
# [m/s²]; of a load, between three neighbours: four times what a drive's ramp usually is
HARDEST = 16.0
# Of the distances of samples from the line between their neighbours 80 % are smaller than this quantile, for
# normal noise 1.3 standard deviations; eight of them are ten of those, whatever a tenth of jumps adds.
USUAL, BEYOND = 0.8, 8.0
DRIVES = ("bridge", "trolley", "rope")
UPPER = 0.975  # quantile of what motions ask that the samples could as well mean
UNITS = {"velocity": "m/s", "acceleration": "m/s²"}


def check_length(length: float, scenario: Scenario, what: str, otherwise: str) -> None:
    """Raise InputError for a reference longer than its run; `what` and a length [s] begin its message.

    `otherwise`: what can be done in place of a longer run.
    """
    if length <= scenario.duration * (1.0 + 1e-12):
        return
    period = scenario.control.period
    fits = float(np.ceil(length))
    if abs(fits / period - round(fits / period)) > 1e-6:  # a run has whole periods
        fits = float(np.ceil(length / period) * period)
    longer = f"duration = {fits:.9g} or more, " if fits <= MAX_DURATION else ""
    raise InputError(
        f"{what} {length:.6g} s, longer than the run, {scenario.duration:g} s",
        allowed=f"a run that its reference fits into, of at most {MAX_DURATION:g} s",
        remedy=f"{longer}{'or ' * bool(longer)}{otherwise}",
    )


def check_numbers(time: Array, points: Array, where: str) -> None:
    """Raise InputError for NaN, infinity, what is too far away, and times that do not increase."""
    wrong = np.flatnonzero(~np.isfinite(np.column_stack([time, points])).all(axis=1))
    if len(wrong):
        raise InputError(
            f"{where}: sample {wrong[0] + 1} is no number: time {time[wrong[0]]:g} s, "
            f"x, y, z = {_told(points[wrong[0]])}"
            + (f", and {len(wrong) - 1} more" if len(wrong) > 1 else ""),
            allowed="numbers in all rows",
            remedy="leave these rows out, or record the motion again",
        )
    far = np.flatnonzero((np.abs(points) > MAX_DISTANCE).any(axis=1) | (np.abs(time) > LATEST))
    if len(far):
        raise InputError(
            f"{where}: sample {far[0] + 1} is at {time[far[0]]:g} s, x, y, z = {_told(points[far[0]])} m",
            allowed=f"at most {MAX_DISTANCE:g} m and {LATEST:g} s from zero",
            remedy="correct the units, or record the motion again",
        )
    late = np.flatnonzero(np.diff(time) <= 0.0)
    if len(late):
        k = late[0]
        raise InputError(
            f"{where}: time does not increase: sample {k + 1} is at {time[k]:.9g} s, "
            f"the next at {time[k + 1]:.9g} s",
            allowed="times that increase from each sample to the next",
            remedy="sort the rows, and keep one of each time",
        )


def check_samples(time: Array, points: Array, tolerance: float, where: str) -> None:
    """Raise InputError for too few samples, gaps and jumps; `tolerance` [m]: a jump of no concern."""
    if len(time) < LEAST_SAMPLES:
        raise InputError(
            f"{where}: {len(time)} samples",
            allowed=f"at least {LEAST_SAMPLES}, of which a tenth at a time is left out to choose the knots",
            remedy='record more often, or take them as points: kind = "waypoints"',
        )
    steps = np.diff(time)
    usual, longest = float(np.median(steps)), int(np.argmax(steps))
    if steps[longest] > GAP * usual:
        raise InputError(
            f"{where}: a gap of {steps[longest]:.3g} s after {time[longest]:.6g} s, where the usual "
            f"step is {usual:.3g} s",
            allowed=f"steps of at most {GAP:g} times the usual one",
            remedy="fill it in, or cut the file there into two",
        )
    before, after = steps[:-1], steps[1:]
    between = (after[:, np.newaxis] * points[:-2] + before[:, np.newaxis] * points[2:]) / (before + after)[
        :, np.newaxis
    ]
    off = np.linalg.norm(points[1:-1] - between, axis=1)
    bound = tolerance + 0.5 * HARDEST * before * after + BEYOND * np.quantile(off, USUAL)
    worst = int(np.argmax(off / bound))
    if off[worst] > bound[worst]:
        raise InputError(
            f"{where}: a jump at {time[worst + 1]:.6g} s: sample {worst + 2} lies {1e3 * off[worst]:.3g} mm "
            "beside the line between its neighbours",
            allowed=f"at most {1e3 * bound[worst]:.3g} mm there: {HARDEST:g} m/s² and the noise of this file",
            remedy="leave such samples out, or record the motion again",
        )
    check_rest(time, points, tolerance, where)


def check_rest(time: Array, points: Array, tolerance: float, where: str) -> None:
    """Raise InputError for samples that begin or end in motion: a spline at rest there could not be near."""
    count = max(NEAR_END, int(np.searchsorted(time, time[0] + 0.1)))
    for end, part in (("begin", slice(None, count)), ("end", slice(-count, None))):
        own = time[part] - time[part].mean()
        away = points[part] - points[part].mean(axis=0)
        speed = own @ away / (own @ own)
        noise = np.linalg.norm((away - np.outer(own, speed)).std(axis=0))
        moved = np.linalg.norm(speed) * np.ptp(own)
        if moved > tolerance + 4.0 * np.sqrt(12.0 / count) * noise:  # its standard error
            raise InputError(
                f"{where}: the samples {end} in motion, with {np.linalg.norm(speed):.3g} m/s",
                allowed="a motion from rest to rest",
                remedy="record it with a rest before and after, or cut it there",
            )


def _told(point: Array) -> str:
    return ", ".join(f"{number:g}" for number in point)


def check_demand(
    curves: Sequence[BSpline],
    scenario: Scenario,
    where: str,
    time: Array | None = None,
    begins: float = 0.0,
) -> None:
    """Raise InputError where velocity or acceleration of a set-point is beyond `effects.limits`.

    Without such an effect the rig's numbers of it count. `curves`: one motion, or many that it could as well
    be, of which the upper end of their peaks counts. `time` (N,) [s]: where it is looked at, by default at
    each control sample; `begins` [s]: when the motion begins in its segment. A motion with a slack rope has
    no set-points: it is refused where it is run.
    """
    if time is None:
        time = np.arange(0.0, curves[0].t[-1], scenario.control.period)
    demands = [demand for curve in curves if (demand := _demand(curve, scenario, time)) is not None]
    if not demands:
        return
    limits = scenario.drive_limits
    allowed = np.array([limits.velocity, limits.acceleration])
    peaks = np.quantile(np.abs(demands).max(axis=2), UPPER if len(demands) > 1 else 1.0, axis=0)
    beyond = np.argwhere(peaks > allowed)
    if not len(beyond):
        return
    kind, drive = beyond[0]
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
    """Return velocity, acceleration of the set-points w = v + tau u (2, N, 3); None with a slack rope."""
    rows = np.hstack([derivative(time) for derivative in derivatives(curve)])
    gravity = scenario.rig.gravity
    if (rows[:, ACCELERATION + Z] <= -gravity).any() or (rows[:, Z] >= 0.0).any():
        return None
    states, inputs = states_and_inputs(rows, gravity)
    lag = scenario.rig.time_constants if scenario.control.lag_compensation else 0.0
    set_point = states[:, 1:6:2] + lag * inputs
    return np.array([set_point, np.gradient(set_point, time, axis=0)])

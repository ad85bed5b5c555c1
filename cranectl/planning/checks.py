"""Refuse impossible motions before anything is solved, with the reason, the allowed range and a remedy."""

from math import sqrt
from typing import NoReturn

import numpy as np

from cranectl.planning.limits import AXES, Constraint, Limits, clearance, constraints, motion
from cranectl.planning.proof import PROOF_MARGIN
from cranectl.reference import Series
from cranectl.scenario import Scenario, ScenarioFile
from cranectl.support import Array, InputError

MAX_PLANNED = 200  # segments of a scenario whose timing is planned

MAX_TRIED_DURATION = 1e4  # [s]; longer than a run may be, since the search may still find a faster motion
REMEDIES = {
    "load": "move the point, or widen planning.load_box or lessen planning.clearance",
    "bridge": "move the point, or change rig.bridge_range",
    "trolley": "move the point, or change rig.trolley_range",
    "rope": "move the point, or change rig.rope_range",
}
# The user's words for a limit, and the key that sets it, by the end of the limit's name.
LIMIT_KEYS = {
    " set-point": ("the velocity of the {axis}", "{drives}.velocity"),
    " set-point's rate": ("the acceleration of the {axis}", "{drives}.acceleration"),
    " force": ("the force on the {axis}", "{drives}.force"),
    " jerk": ("the jerk of the {axis}", "planning.jerk"),
    "lean of the rope": ("the lean of the rope", "planning.lean"),
    "tension of the rope": ("the tension of the rope", "planning.tension"),
}


def check_count(scenario: Scenario) -> None:
    """Raise InputError for more segments whose timing is left open than are planned for a scenario."""
    count = sum(not segment.is_planned for segment in scenario.reference.segments)
    if count > MAX_PLANNED:
        raise InputError(
            f"{scenario.name}: {count} segments leave their timing open, and planning takes seconds for each",
            allowed=f"up to {MAX_PLANNED} such segments",
            remedy="give some a duration, or divide the scenario",
        )


def check_point(point: Array, limits: Limits, what: str) -> None:
    """Raise InputError where the load cannot hang at rest at `point` (x, y, z) [m]."""
    coordinates = ", ".join(f"{value:g}" for value in point)
    rest = motion([Series([np.array([value])]).padded(6) for value in point], limits.gravity)
    for constraint in constraints(rest, limits):
        value = float(constraint.series[0][0])
        if value > constraint.high + PROOF_MARGIN or value < constraint.low - PROOF_MARGIN:
            _raise_unreachable(constraint, value, limits, f"{what}, ({coordinates}),")
    for box in limits.obstacles:
        widest = float(clearance(rest, box, limits.radius).max())
        if widest < -PROOF_MARGIN:
            raise InputError(
                f"{what}, ({coordinates}), is in the obstacle '{box.name}', "
                "or nearer to it than the load's radius "
                f"of {limits.radius:g} m, or the rope is",
                allowed=f"points at least {-widest:.3g} m further away, or above "
                f"{box.high[2] + limits.radius:g} m",
                remedy="move the point or the obstacle",
            )


def _raise_unreachable(constraint: Constraint, value: float, limits: Limits, what: str) -> NoReturn:
    subject = constraint.name.split()[0]
    if constraint.name.endswith("force"):
        raise InputError(
            f"the winch may pull with {constraint.high:.3g} N, but the load weighs {-value:.3g} N",
            allowed=f"a load of less than {constraint.high / limits.gravity:.3g} kg, or a stronger winch",
            remedy=f"correct rig.load_mass or {limits.drives}.force, or raise planning.share",
        )
    raise InputError(
        f"{what} is out of reach: there the {constraint.name} is {value:.4g} m",
        allowed=f"{constraint.name} from {constraint.low:.4g} to {constraint.high:.4g} m",
        remedy=REMEDIES[subject] + ScenarioFile.made_for(limits.axes),
    )


def check_height_over(height: float, limits: Limits, what: str) -> None:
    """Raise InputError where the load cannot be lifted to `height` [m] to pass over an obstacle."""
    highest = min(float(limits.load[2, 1]), -float(limits.axes[2, 0]))
    if height > highest:
        tallest = max(limits.obstacles, key=lambda box: box.high[2])
        raise InputError(
            f"{what}: no way over the obstacle '{tallest.name}', which ends at z = {tallest.high[2]:g} m: "
            f"the load of radius {limits.radius:g} m would have to be lifted to {height:.3g} m",
            allowed=f"up to {highest:.3g} m: rope_range begins at {limits.axes[2, 0]:g} m, the load's box "
            f"ends at {limits.load[2, 1]:g} m",
            remedy="lower the obstacle, or pass around it by points in via",
        )


def least_times(start: Array, end: Array, limits: Limits) -> list[float]:
    """Return the durations [s] of bridge, trolley and winch alone without a load, which are lower bounds."""
    times = []
    for i, travel in enumerate(np.abs(end - start)):
        distance, speed, rate = float(travel), float(limits.velocity[i]), float(limits.acceleration[i])
        is_short = distance < speed**2 / rate  # full speed is not reached
        times.append(2.0 * sqrt(distance / rate) if is_short else distance / speed + speed / rate)
    return times


def check_least_time(start: Array, end: Array, limits: Limits, where: str) -> None:
    """Raise InputError where the drives alone need longer than a run may last, from `start` to `end` (3,)."""
    times = least_times(start, end, limits)
    k = int(np.argmax(times))
    if times[k] > Scenario.MAX_SECONDS:
        distance, speed, rate = abs(float(end[k] - start[k])), limits.velocity[k], limits.acceleration[k]
        name = "set-point" if distance >= speed**2 / rate else "set-point's rate"
        raise too_long(times[k], f"{AXES[k]} {name}", limits, f"{where} takes at least")


def check_duration(duration: float, name: str, limits: Limits, where: str) -> None:
    """Raise InputError for a motion of `duration` [s] that limit `name` makes longer than a run may last."""
    if duration > Scenario.MAX_SECONDS:
        raise too_long(duration, name, limits, f"{where} takes")


def too_long(duration: float, name: str, limits: Limits, takes: str) -> InputError:
    """Return the error for a motion of `duration` [s] that limit `name` makes too long."""
    axis = name.split()[0]
    words, key = next(
        (quantity for ending, quantity in LIMIT_KEYS.items() if name.endswith(ending)), (name, "the limits")
    )
    length = f"{duration:.4g} s" if np.isfinite(duration) else f"more than {MAX_TRIED_DURATION:g} s"
    return InputError(
        f"{takes} {length}: {words.format(axis=axis)} allows no less",
        allowed=f"motions of at most {Scenario.MAX_SECONDS:g} s, as long as a run may last",
        remedy=f"raise {key.format(drives=limits.drives)}, or choose a shorter path",
    )


def check_excesses(excesses: dict[str, float], limits: Limits, what: str) -> None:
    """Raise InputError for a path with `excesses` over limits, as shares of them, however slow it is."""
    if not excesses:
        return
    worst = max(excesses, key=lambda name: excesses[name])
    distance = excesses[worst] * limits.size
    if worst in {box.key for box in limits.obstacles}:
        problem = f"it comes {distance:.3g} m too near to the {worst}"
    elif worst in (*AXES, *(f"load {axis}" for axis in "xyz")):
        problem = f"{worst} is beyond its range by {distance:.3g} m"
    else:
        problem = f"{worst} is exceeded by {excesses[worst]:.3g} of it"
    raise InputError(
        f"{what} cannot be driven however slowly: {problem}",
        allowed="a path along which the load can hang at rest everywhere",
        remedy="use kind = 'move', which finds a path, or another path",
    )

"""What a motion is limited by, and the constraints that they make, as functions of the load's motion.

With the rope's slopes p = (p_x, p_y), horizontal over vertical, and its drop h = -z_3 (`model.flatness`)

    p = -(z_1'', z_2'') / (z_3'' + g)    x_c = z_1 - p_x h    y_c = z_2 - p_y h    l = h sqrt(1 + |p|²)

and derivatives follow as series do. Written over any kind of number, so that solvers and proof share it;
tests hold it against `model.flatness` and `model.dynamics`.
"""

from math import tan
from typing import NamedTuple

import numpy as np

from cranectl.reference.series import Series, differentiated, over, plus, root, times
from cranectl.scenario import Scenario, Segment
from cranectl.scenario.drawn_size import drawn_load_radius
from cranectl.support.arrays import Array

SHARE, SHARE_WITH_SENSING = 0.95, 0.88  # of limits: measured, docs/explanation/planning.md
FIXED = 1e-3  # of its length, by which a rope that is to be constant may vary
SIDES = ("x-", "x+", "y-", "y+", "above")
AXES = ("bridge", "trolley", "rope")


class Box(NamedTuple):
    """An obstacle."""

    name: str
    low: Array  # (3,) [m]
    high: Array

    @property
    def key(self) -> str:
        """Return its name among those of the constraints."""
        return f"obstacle '{self.name}'"


class Limits(NamedTuple):
    """Of a motion of the load; those of drives, lean and tension times the share."""

    drives: str  # the table of the scenario that says what drives can do
    gravity: float  # [m/s²]
    lag: Array  # (3,) of the set-points w = v + lag u [s]
    velocity: Array  # (3,) |w| [m/s]
    acceleration: Array  # (3,) |w'| [m/s²]
    force: Array  # (3,) of the drives [N]
    jerk: Array  # (3,) of bridge, trolley, rope [m/s³]
    masses: Array  # (4,) bridge with trolley, trolley, winch, load [kg]
    lean: float  # tangent of the largest angle from the vertical
    tension: tuple[float, float]  # [N]
    load: Array  # (3, 2) where it may be [m]
    axes: Array  # (3, 2) ranges of bridge, trolley, rope [m]
    radius: float  # of the load [m]
    obstacles: tuple[Box, ...]
    size: float  # of the motion, by which excesses of positions are measured [m]


def limits_of(scenario: Scenario) -> Limits:
    """Return the limits of a scenario's crane for planning, with any kind of drive."""
    rig, planning = scenario.rig, scenario.planning
    share = share_of(scenario)
    drives = scenario.drive_limits
    masses = np.array([rig.bridge_mass + rig.trolley_mass, rig.trolley_mass, rig.winch_mass, rig.load_mass])
    low, high = planning.tension
    gap = planning.clearance * np.array([1.0, -1.0])
    free = np.array([rig.bridge_range, rig.trolley_range, (-rig.rope_range[1], 0.0)]) + gap
    return Limits(
        drives=scenario.drive_limits_key,
        gravity=rig.gravity,
        lag=rig.time_constants * scenario.control.lag_compensation,
        velocity=share * np.array(drives.velocity),
        acceleration=share * np.array(drives.acceleration),
        force=share * np.array(drives.force),
        jerk=share * np.array(planning.jerk or (np.inf,) * 3),
        masses=masses,
        lean=tan(share * planning.lean),
        tension=((1.0 - share * (1.0 - low)) * rig.weight, (1.0 + share * (high - 1.0)) * rig.weight),
        load=np.array(planning.load_box) if planning.load_box else free,
        axes=rig.workspace,
        radius=drawn_load_radius(rig),
        obstacles=tuple(Box(o.name, np.array(o.low), np.array(o.high)) for o in scenario.obstacles),
        size=1.0,
    )


def key_of(segment: Segment, start: Array, scenario: Scenario) -> str:
    """Equal for what is planned and proven the same; `start` (3,) [m]."""
    deciding = scenario.model_dump_json(include={"planning", "obstacles", "rig", "effects", "control"})
    return f"{segment.model_dump_json()}{start.tolist()}{deciding}"


def share_of(scenario: Scenario) -> float:
    """Return the share of the limits that a plan may use."""
    effects = scenario.effects
    rough = effects.sensing or effects.delay or effects.friction
    return scenario.planning.share or (SHARE_WITH_SENSING if rough else SHARE)


class Constraint(NamedTuple):
    """Something that must lie between two bounds."""

    name: str
    series: Series
    low: float
    high: float
    scale: float  # a typical size, by which excesses are measured


class Motion(NamedTuple):
    """Series of the load and of what follows from it."""

    load: list[Series]  # x, y, z
    slopes: list[Series]  # p_x, p_y
    axes: list[Series]  # x_c, y_c, l
    acceleration: list[Series]  # of the load, along z with gravity
    secant: Series  # sqrt(1 + |p|²)


def motion(load: list[Series], gravity: float) -> Motion:
    """Compute the crane's motion from the load's series of n >= 5 coefficients; results have n - 2."""
    x, y, z = (differentiated(series, 2) for series in load)
    lift = [z[0] + gravity, *z[1:]]
    p_x, p_y = ([-c for c in over(a, lift)] for a in (x, y))
    drop = [-c for c in load[2]]
    squares = plus(times(p_x, p_x), times(p_y, p_y))
    secant = root([squares[0] + 1.0, *squares[1:]])
    bridge, trolley = (
        plus(position, [-c for c in times(slope, drop)])
        for position, slope in zip(load[:2], (p_x, p_y), strict=True)
    )
    return Motion(load, [p_x, p_y], [bridge, trolley, times(secant, drop)], [x, y, lift], secant)


def constraints(moved: Motion, limits: Limits) -> list[Constraint]:
    """Return all constraints but the obstacles; infinite limits are left out."""
    result = [
        Constraint(f"load {axis}", series, low, high, limits.size)
        for axis, series, (low, high) in zip("xyz", moved.load, limits.load.tolist(), strict=True)
    ]
    lean2 = plus(times(moved.slopes[0], moved.slopes[0]), times(moved.slopes[1], moved.slopes[1]))
    result.append(Constraint("lean of the rope", lean2, -np.inf, limits.lean**2, limits.lean**2))
    bridge_mass, trolley_mass, winch_mass, mass = limits.masses.tolist()
    tension = [c * mass for c in times(moved.secant, moved.acceleration[2])]
    weight = mass * limits.gravity
    result.append(Constraint("tension of the rope", tension, *limits.tension, weight))
    rates = [differentiated(axis, 2) for axis in moved.axes]
    forces = [
        plus([c * bridge_mass for c in rates[0]], [c * mass for c in moved.acceleration[0]]),
        plus([c * trolley_mass for c in rates[1]], [c * mass for c in moved.acceleration[1]]),
        plus([c * winch_mass for c in rates[2]], [-c for c in tension]),
    ]
    for i, (axis, (low, high)) in enumerate(zip(AXES, limits.axes.tolist(), strict=True)):
        series, rate = moved.axes[i], rates[i]
        setpoint = plus(differentiated(series, 1), [c * float(limits.lag[i]) for c in rate])
        result += [
            Constraint(axis, series, low, high, limits.size),
            _symmetric(f"{axis} set-point", setpoint, limits.velocity[i]),
            _symmetric(f"{axis} set-point's rate", differentiated(setpoint, 1), limits.acceleration[i]),
            _symmetric(f"{axis} force", forces[i], limits.force[i]),
            _symmetric(f"{axis} jerk", differentiated(rate, 1), limits.jerk[i]),
        ]
    return [
        constraint for constraint in result if np.isfinite(constraint.low) or np.isfinite(constraint.high)
    ]


def excesses(moved: Motion, limits: Limits) -> dict[str, Array]:
    """Return the excess over each limit at each point (N,), as a share of it; negative is slack."""
    by_name = {
        constraint.name: np.maximum(
            constraint.series[0] - constraint.high, constraint.low - constraint.series[0]
        )
        / constraint.scale
        for constraint in constraints(moved, limits)
    }
    for box in limits.obstacles:
        by_name[box.key] = -np.max(clearance(moved, box, limits.radius), axis=0) / limits.size
    return by_name


def clearance(moved: Motion, box: Box, radius: float) -> Array:
    """Return the clearance on each of SIDES of a box at each point, (5, N) [m]; negative: too near."""
    return np.array(
        [np.min([distance[0] for distance in clear_of(moved, box, radius, side)], axis=0) for side in SIDES]
    )


def clear_of(moved: Motion, box: Box, radius: float, side: str) -> list[Series]:
    """Return distances [m] that must not be negative for load and rope to pass a box on `side`.

    Above: the load. Beside: the load, and the rope where it passes the height of the top, below which it
    lies between these two points.
    """
    x, y, z = moved.load
    if side == "above":
        return [[z[0] - (box.high[2] + radius), *z[1:]]]
    axis = 0 if side[0] == "x" else 1
    position = (x, y)[axis]
    below_top = [float(box.high[2]) - z[0], *(-c for c in z[1:])]
    passing = plus(position, [-c for c in times(moved.slopes[axis], below_top)])
    if side[1] == "-":
        face = float(box.low[axis])
        return [
            [face - radius - position[0], *(-c for c in position[1:])],
            [face - passing[0], *(-c for c in passing[1:])],
        ]
    face = float(box.high[axis])
    return [[position[0] - (face + radius), *position[1:]], [passing[0] - face, *passing[1:]]]


def _symmetric(name: str, series: Series, bound: float) -> Constraint:
    return Constraint(name, series, -float(bound), float(bound), float(bound))

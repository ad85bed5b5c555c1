"""Limits of a motion, and the constraints that they impose, as functions of the load's motion.

With the rope's slopes p = (p_x, p_y), horizontal over vertical, and its drop h = -z_3 (`model.flatness`)

    p = -(z_1'', z_2'') / (z_3'' + g)    x_c = z_1 - p_x h    y_c = z_2 - p_y h    l = h sqrt(1 + |p|²)

and derivatives follow by arithmetic of series. The functions accept any kind of number, so that solver and
proof share them. Tests compare them with `model.flatness` and `model.dynamics`.
"""

from math import tan
from typing import NamedTuple

import numpy as np

from cranectl.reference import Series
from cranectl.scenario import Drawing, Scenario, Segment
from cranectl.support import Array

SHARE, SHARE_WITH_SENSING = 0.95, 0.88  # of limits that plans may use, see docs/explanation/planning.md
SIDES = ("x-", "x+", "y-", "y+", "above")
AXES = ("bridge", "trolley", "rope")  # of a crane, in the order of its limits


class Box(NamedTuple):
    """An obstacle."""

    name: str
    low: Array  # (3,) [m]
    high: Array

    @property
    def key(self) -> str:
        """Name of the obstacle among the constraints."""
        return f"obstacle '{self.name}'"


class Limits(NamedTuple):
    """Limits of a motion of the load; drives, lean and tension are reduced to the planned share."""

    drives: str  # key of the scenario's table of drive limits
    gravity: float  # [m/s²]
    lag: Array  # (3,) of the set-points w = v + lag u [s]
    velocity: Array  # (3,) |w| [m/s]
    acceleration: Array  # (3,) |w'| [m/s²]
    force: Array  # (3,) of the drives [N]
    jerk: Array  # (3,) of bridge, trolley, rope [m/s³]
    masses: Array  # (4,) bridge with trolley, trolley, winch, load [kg]
    lean: float  # tangent of the largest angle from the vertical
    tension: tuple[float, float]  # [N]
    load: Array  # (3, 2) ranges of the load [m]
    axes: Array  # (3, 2) ranges of bridge, trolley, rope [m]
    radius: float  # of the load [m]
    obstacles: tuple[Box, ...]  # that load and rope must not touch
    size: float  # of the motion, the scale of excesses of positions [m]


def limits_of(scenario: Scenario) -> Limits:
    """Return the limits of a scenario's crane for planning, for all kinds of drives."""
    rig, planning = scenario.rig, scenario.planning
    share = share_of(scenario)
    drives = scenario.drive_limits
    masses = np.array([*rig.axis_masses, rig.load_mass])
    low, high = planning.tension
    gap = planning.clearance * np.array([1.0, -1.0])
    free = np.array([rig.bridge_range, rig.trolley_range, (-rig.rope_range[1], 0.0)]) + gap
    return Limits(
        drives=scenario.drive_limits_key,
        gravity=rig.gravity,
        lag=rig.time_constants * scenario.control.lag_compensation,
        velocity=share * np.where(rig.moves, drives.velocity, np.inf),  # nothing drives a fixed axis
        acceleration=share * np.where(rig.moves, drives.acceleration, np.inf),
        force=share * np.where(rig.moves, drives.force, np.inf),
        jerk=share * np.array(planning.jerk or (np.inf,) * 3),
        masses=masses,
        lean=tan(share * planning.lean),
        # The share is that of the distance from the weight, at which a load at rest hangs.
        tension=((1.0 - share * (1.0 - low)) * rig.weight, (1.0 + share * (high - 1.0)) * rig.weight),
        load=np.array(planning.load_box) if planning.load_box else free,
        axes=rig.workspace,
        radius=Drawing(rig).load_radius,
        obstacles=tuple(Box(o.name, np.array(o.low), np.array(o.high)) for o in scenario.obstacles),
        size=1.0,  # `plan.limits_for` sets it
    )


def key_of(segment: Segment, start: Array, scenario: Scenario) -> str:
    """Return a key that is equal for segments with equal plans and proofs; `start` (3,) [m]."""
    settings = scenario.model_dump_json(include={"planning", "obstacles", "rig", "effects", "control"})
    return f"{segment.model_dump_json()}{start.tolist()}{settings}"


def share_of(scenario: Scenario) -> float:
    """Return the share of the limits that a plan may use."""
    effects = scenario.effects
    rough = effects.sensing or effects.delay or effects.friction
    return scenario.planning.share or (SHARE_WITH_SENSING if rough else SHARE)


class Constraint(NamedTuple):
    """A quantity that must lie between two bounds."""

    name: str
    series: Series
    low: float
    high: float
    scale: float  # unit of excesses


class Motion(NamedTuple):
    """Series of the load, and of the crane's motion that follows from it."""

    load: list[Series]  # x, y, z
    slopes: list[Series]  # p_x, p_y
    axes: list[Series]  # x_c, y_c, l
    acceleration: list[Series]  # of the load, along z with gravity
    secant: Series  # sqrt(1 + |p|²)


def motion(load: list[Series], gravity: float) -> Motion:
    """Compute the crane's motion from the load's series of n >= 5 coefficients; results have n - 2."""
    x, y, z = (series.derivative(2) for series in load)
    lift = z + gravity
    p_x, p_y = -(x / lift), -(y / lift)
    drop = -load[2]
    secant = (p_x * p_x + p_y * p_y + 1.0).sqrt()
    axes = [load[0] - p_x * drop, load[1] - p_y * drop, secant * drop]
    return Motion(load, [p_x, p_y], axes, [x, y, lift], secant)


def constraints(crane_motion: Motion, limits: Limits) -> list[Constraint]:
    """Return all constraints except obstacles and infinite limits."""
    result = [
        Constraint(f"load {axis}", series, low, high, limits.size)
        for axis, series, (low, high) in zip("xyz", crane_motion.load, limits.load.tolist(), strict=True)
    ]
    lean2 = crane_motion.slopes[0] * crane_motion.slopes[0] + crane_motion.slopes[1] * crane_motion.slopes[1]
    result.append(Constraint("lean of the rope", lean2, -np.inf, limits.lean**2, limits.lean**2))
    bridge_mass, trolley_mass, winch_mass, mass = limits.masses.tolist()
    tension = crane_motion.secant * crane_motion.acceleration[2] * mass
    weight = mass * limits.gravity
    result.append(Constraint("tension of the rope", tension, *limits.tension, weight))
    rates = [axis.derivative(2) for axis in crane_motion.axes]
    forces = [
        rates[0] * bridge_mass + crane_motion.acceleration[0] * mass,
        rates[1] * trolley_mass + crane_motion.acceleration[1] * mass,
        rates[2] * winch_mass - tension,
    ]
    for i, (axis, (low, high)) in enumerate(zip(AXES, limits.axes.tolist(), strict=True)):
        series, rate = crane_motion.axes[i], rates[i]
        setpoint = series.derivative() + rate * float(limits.lag[i])
        result += [
            Constraint(axis, series, low, high, limits.size),
            _symmetric(f"{axis} set-point", setpoint, limits.velocity[i]),
            _symmetric(f"{axis} set-point's rate", setpoint.derivative(), limits.acceleration[i]),
            _symmetric(f"{axis} force", forces[i], limits.force[i]),
            _symmetric(f"{axis} jerk", rate.derivative(), limits.jerk[i]),
        ]
    return [
        constraint for constraint in result if np.isfinite(constraint.low) or np.isfinite(constraint.high)
    ]


def excesses(crane_motion: Motion, limits: Limits) -> dict[str, Array]:
    """Return the excess over each limit at each point (N,), as a share of it; negative values are slack."""
    by_name = {
        constraint.name: np.maximum(
            constraint.series[0] - constraint.high, constraint.low - constraint.series[0]
        )
        / constraint.scale
        for constraint in constraints(crane_motion, limits)
    }
    for box in limits.obstacles:
        by_name[box.key] = -np.max(clearance(crane_motion, box, limits.radius), axis=0) / limits.size
    return by_name


def clearance(crane_motion: Motion, box: Box, radius: float) -> Array:
    """Return the clearance on each of SIDES of a box at each point, (5, N) [m]; negative is too near."""
    return np.array(
        [
            np.min([distance[0] for distance in side_distances(crane_motion, box, radius, side)], axis=0)
            for side in SIDES
        ]
    )


def side_distances(crane_motion: Motion, box: Box, radius: float, side: str) -> list[Series]:
    """Return distances [m] that must not be negative for load and rope to pass a box on `side`.

    Above the box, the distance of the load counts. Beside it, the distances of the load and of the rope at
    the height of the box's top count, since the rope below lies between these two points.
    """
    x, y, z = crane_motion.load
    if side == "above":
        return [z - (box.high[2] + radius)]
    axis = 0 if side[0] == "x" else 1
    position = (x, y)[axis]
    passing = position - crane_motion.slopes[axis] * (float(box.high[2]) - z)
    if side[1] == "-":
        face = float(box.low[axis])
        return [face - radius - position, face - passing]
    face = float(box.high[axis])
    return [position - (face + radius), passing - face]


def _symmetric(name: str, series: Series, bound: float) -> Constraint:
    return Constraint(name, series, -float(bound), float(bound), float(bound))

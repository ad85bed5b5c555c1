"""The crane under a planned motion of its load, by formulas that share nothing with the planner.

Each span of a spline is a polynomial, computed with fractions. The force on the load is f = z'' + g e_3 per
mass, the rope lies along f, and the trolley is where that line meets z_3 = 0:

    r = z - (z_3 / f_3) f    l = |r - z|    tension = m |f|

Products are differentiated by the rule of Leibniz. Every limit is computed from the scenario again. The load
is a ball, the rope a straight line from trolley to load, and both must be outside every box.
"""

from fractions import Fraction
from math import comb, factorial
from typing import NamedTuple

import numpy as np

from cranectl.scenario import Scenario, Segment
from cranectl.scenario.along_path import Arc, Line
from cranectl.scenario.drawing import Drawing
from cranectl.scenario.segment_base import SplineLaw
from cranectl.scenario.segments import Spline
from cranectl.support.arrays import Array

ORDERS = 6  # the load's position and five derivatives
PLANNED_SHARE = 0.95  # of the limits that plans may use


def span_polynomials(breaks: list[float], coefficients: list[float], degree: int) -> list[list[Fraction]]:
    """Return the polynomial of each span in the time since its begin, by exact polar forms."""
    knots = [Fraction(breaks[0])] * degree + [*map(Fraction, breaks)] + [Fraction(breaks[-1])] * degree
    exact = [*map(Fraction, coefficients)]
    polynomials = []
    for span in range(len(breaks) - 1):
        row = [[exact[span + k]] for k in range(degree + 1)]  # polynomials in the time since the span's begin
        begin = knots[degree + span]
        for level in range(1, degree + 1):
            for k in range(degree, level - 1, -1):
                left, right = knots[span + k], knots[span + degree + k - level + 1]
                # row[k-1] + (begin + t - left) / (right - left) * (row[k] - row[k-1])
                step = [b - a for a, b in zip(row[k - 1], row[k], strict=True)]
                width, offset = right - left, begin - left
                scaled = [offset * c / width for c in step] + [Fraction(0)]
                shifted = [Fraction(0)] + [c / width for c in step]
                base = [*row[k - 1], Fraction(0)]
                row[k] = [a + b + c for a, b, c in zip(base, scaled, shifted, strict=True)]
            row[level - 1 :] = [[], *row[level:]]
        polynomials.append(row[degree])
    return polynomials


def evaluate(breaks: list[float], columns: list[list[float]], degree: int, time: Array) -> Array:
    """Return the derivatives of a spline at `time` (N,): shape (ORDERS, coordinates, N)."""
    span = np.clip(np.searchsorted(breaks, time, side="right") - 1, 0, len(breaks) - 2)
    local = time - np.array(breaks)[span]
    result = np.zeros((ORDERS, len(columns), len(time)))
    for j, column in enumerate(columns):
        numbers = np.array([[float(c) for c in p] for p in span_polynomials(breaks, column, degree)])
        for order in range(ORDERS):
            value = np.zeros(len(time))
            for k in range(degree, order - 1, -1):
                value = value * local + numbers[span, k] * (factorial(k) / factorial(k - order))
            result[order, j] = value
    return result


def leibniz(a: Array, b: Array, order: int) -> Array:
    """Return a derivative of the product of two functions from their derivatives."""
    return sum((comb(order, k) * a[k] * b[order - k] for k in range(order + 1)), np.zeros_like(a[0] * b[0]))


def load_of(segment: Segment, start: Array, samples: int) -> tuple[Array, Array]:
    """Return times (N,) [s] and derivatives of the load (ORDERS, 3, N) in a planned segment."""
    assert isinstance(segment, Spline | Line | Arc)
    time = np.linspace(0.0, float(segment.duration), samples)  # type: ignore[arg-type]
    if isinstance(segment, Spline):
        columns = [list(column) for column in zip(*segment.coefficients, strict=True)]
        return time, evaluate(list(segment.breaks), columns, segment.degree, time)
    share = _progress(segment, time)
    if isinstance(segment, Line):
        load = share[:, None] * (np.array(segment.to) - start)[:, None]
        load[0] += start[:, None]
        return time, load
    centre = np.array(segment.centre)
    arm = complex(*(start[:2] - centre))
    turn = np.zeros((ORDERS, len(time)), dtype=complex)  # of exp(i angle s)
    turn[0] = np.exp(1j * segment.angle * share[0])
    rate = 1j * segment.angle * np.roll(share, -1, axis=0)  # derivatives of i angle s'
    for order in range(1, ORDERS):
        turn[order] = leibniz(turn, rate, order - 1)
    load = np.zeros((ORDERS, 3, len(time)))
    load[:, 0], load[:, 1] = (arm * turn).real, (arm * turn).imag
    load[0] += np.array([*centre, start[2]])[:, None]
    return time, load


def _progress(segment: Line | Arc, time: Array) -> Array:
    """Return the share of the path with its derivatives, (ORDERS, N)."""
    duration = float(segment.duration)  # type: ignore[arg-type]
    if isinstance(segment.time_law, SplineLaw):
        law, degree = list(segment.time_law.coefficients), 7
    else:
        law, degree = [0.0] * 5 + [1.0] * 5, 9
    breaks = np.linspace(0.0, 1.0, len(law) - degree + 1).tolist()
    in_share = evaluate(breaks, [law], degree, np.clip(time / duration, 0.0, 1.0))[:, 0]
    scaled: Array = in_share / duration ** np.arange(float(ORDERS))[:, None]
    return scaled


class Crane(NamedTuple):
    """The crane under a motion of its load."""

    trolley: Array  # (4, 2, N) position of bridge and trolley with three derivatives
    rope: Array  # (4, N)
    force: Array  # (3, N) on the load, per mass [m/s²]


def crane_under(load: Array, gravity: float) -> Crane:
    """Return the crane that a load's motion (ORDERS, 3, N) needs."""
    force = load[2:].copy()
    force[0, 2] += gravity
    ratio = np.zeros_like(force[:, 2])  # z_3 / f_3
    for order in range(4):
        known = sum(comb(order, k) * ratio[k] * force[order - k, 2] for k in range(order))
        ratio[order] = (load[order, 2] - known) / force[0, 2]
    arm = np.stack([-leibniz(ratio[:, None], force, order) for order in range(4)])  # from load to trolley
    trolley = load[:4, :2] + arm[:, :2]
    rope = np.zeros((4, load.shape[2]))
    rope[0] = np.sqrt((arm[0] ** 2).sum(axis=0))

    def dot(a: int, b: int) -> Array:
        product: Array = (arm[a] * arm[b]).sum(axis=0)
        return product

    rope[1] = dot(0, 1) / rope[0]
    rope[2] = (dot(0, 2) + dot(1, 1) - rope[1] ** 2) / rope[0]
    rope[3] = (dot(0, 3) + 3.0 * dot(1, 2) - 3.0 * rope[1] * rope[2]) / rope[0]
    return Crane(trolley, rope, force[0])


def excesses(scenario: Scenario, load: Array) -> dict[str, float]:
    """Return the largest excess over each limit, as a share of it or in metres; negative is slack."""
    rig, planning = scenario.rig, scenario.planning
    drives, share = scenario.drive_limits, planning.share or PLANNED_SHARE
    crane, mass = crane_under(load, rig.gravity), rig.load_mass
    pull = np.sqrt((crane.force**2).sum(axis=0))
    lean = np.arccos(np.clip(crane.force[2] / pull, -1.0, 1.0))
    weights = pull / rig.gravity
    low, high = planning.tension
    over = {
        "lean": float(np.tan(lean.max()) ** 2 / np.tan(share * planning.lean) ** 2) - 1.0,
        "tension high": float(weights.max()) - (1.0 + share * (high - 1.0)),
        "tension low": 1.0 - share * (1.0 - low) - float(weights.min()),
    }
    lags = np.array([rig.bridge_time_constant, rig.trolley_time_constant, rig.winch_time_constant])
    lags = lags * scenario.control.lag_compensation
    along_y = rig.trolley_mass + rig.trolley_motor_mass
    moved = rig.bridge_mass + rig.trolley_mass, along_y, rig.winch_mass
    load_box = planning.load_box or (rig.bridge_range, rig.trolley_range, (-rig.rope_range[1], 0.0))
    gap = 0.0 if planning.load_box else planning.clearance
    ranges = rig.bridge_range, rig.trolley_range, rig.rope_range
    for i, name in enumerate(("bridge", "trolley", "rope")):
        axis = crane.rope if i == 2 else crane.trolley[:, i]
        on_load = mass * crane.force[i] if i < 2 else -mass * pull
        for what, value, limit in (
            ("speed", axis[1] + lags[i] * axis[2], drives.velocity[i]),
            ("acceleration", axis[2] + lags[i] * axis[3], drives.acceleration[i]),
            ("force", moved[i] * axis[2] + on_load, drives.force[i]),
        ):
            over[f"{name} {what}"] = float(np.abs(value).max()) / (share * limit) - 1.0
        over[name] = float(max(ranges[i][0] - axis[0].min(), axis[0].max() - ranges[i][1]))
        begin, end = load_box[i][0] + gap, load_box[i][1] - gap
        over[f"load {'xyz'[i]}"] = float(max(begin - load[0, i].min(), load[0, i].max() - end))
    for box in scenario.obstacles:
        over[f"box {box.name}"] = _depth(load[0], crane, np.array(box.low), np.array(box.high), scenario)
    return over


def _depth(load: Array, crane: Crane, low: Array, high: Array, scenario: Scenario) -> float:
    """Return how deep [m] ball or rope are in a box at worst; where both are clear, at most 0."""
    outside = np.maximum(np.maximum(low[:, None] - load, load - high[:, None]), 0.0)
    ball = Drawing(scenario.rig).load_radius - np.sqrt((outside**2).sum(axis=0))
    # The rope: the largest part of it, from trolley to load, that is inside all three pairs of faces.
    top = np.stack([*crane.trolley[0], np.zeros(load.shape[1])])
    along = load - top
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low[:, None] - top) / along, (high[:, None] - top) / along
    first, last = np.minimum(one, other), np.maximum(one, other)
    still = along == 0.0
    inside = (top > low[:, None]) & (top < high[:, None])
    first = np.where(still, np.where(inside, -np.inf, np.inf), first)
    last = np.where(still, np.where(inside, np.inf, -np.inf), last)
    part = np.minimum(last.min(axis=0), 1.0) - np.maximum(first.max(axis=0), 0.0)
    return float(max(ball.max(), (part * crane.rope[0]).max()))

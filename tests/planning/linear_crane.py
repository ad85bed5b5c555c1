"""Lower bounds of durations of short moves: the linearised crane in minimum time, by linear programs.

About a hanging load the axes do not act on each other. The set-point w of a drive has a bounded rate w', and

    lag v' + v = w    x_c' = v    x'' = (g / h) (x_c - x)

with the drop h of the rope for bridge and trolley; the load follows the winch at once. For a given time the
largest distance from rest to rest is a linear program, and the least time for a distance follows by
bisection. Nothing is taken from the planner.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.optimize import linprog

STEPS = 160  # of constant rate; with 320 the least times of the tests are 2e-4 shorter at most
PRECISION = 1e-5  # of the bisection, relative


class Axis(NamedTuple):
    """One axis of the linearised crane."""

    speed: float  # of the set-point [m/s]
    rate: float  # of the set-point [m/s²]
    lag: float  # of the drive [s]; 0 for a drive that follows its set-point
    frequency: float | None = None  # of the pendulum, sqrt(g / h) [1/s]; None for the winch


def _chain(axis: Axis, time: float) -> np.ndarray:
    """Return the matrix of (w, v, x_c, x', x) over the share of `time`, scaled so that all are near one.

    The units are A T, A T² / lag, A T³ / lag, and for the load A T⁴ f² / lag, A T⁵ f² / lag, with the rate A,
    the time T and the frequency f. Without a lag v is left out, and each unit has a lag instead of a T.
    """
    has_lag, hangs = axis.lag > 0.0, axis.frequency is not None
    size = 2 + has_lag + 2 * hangs
    matrix = np.zeros((size, size))
    matrix[range(1, size), range(size - 1)] = 1.0
    if has_lag:
        matrix[1, 1] = -time / axis.lag
    if axis.frequency is not None:
        matrix[-2, -1] = -((time * axis.frequency) ** 2)
    return matrix


def longest_distance(axis: Axis, time: float, steps: int = STEPS) -> float:
    """Return the largest distance [m] from rest to rest in `time` [s]."""
    chain = _chain(axis, time)
    size = len(chain)
    augmented = np.zeros((size + 1, size + 1))
    augmented[:size, :size], augmented[0, size] = chain / steps, 1.0 / steps
    step = expm(augmented)
    forward, push = step[:size, :size], step[:size, size]
    columns = [push]
    for _ in range(steps - 1):
        columns.append(forward @ columns[-1])
    end = np.array(columns[::-1]).T  # of the state with respect to the rates, (size, steps)
    unit = axis.rate * time**2 * (time / axis.lag if axis.lag else 1.0)  # of x_c
    rest = end[:-1].copy()
    if axis.frequency is not None:  # the trolley ends above the load
        swing = (axis.frequency * time) ** 2
        rest[-2] -= swing * end[-1]
        unit *= swing
    speeds = np.tril(np.ones((steps, steps))) / steps
    bound = axis.speed / (axis.rate * time)
    limits = np.vstack([speeds, -speeds]) if bound < 0.5 else np.zeros((0, steps))
    scale = np.abs(end[-1]).max()
    program = linprog(
        -end[-1] / scale,
        limits if len(limits) else None,
        np.full(len(limits), bound) if len(limits) else None,
        rest / np.abs(rest).max(axis=1, keepdims=True),
        np.zeros(len(rest)),
        bounds=(-1.0, 1.0),
        method="highs",
    )
    assert program.status == 0, program.message
    return float(-program.fun * scale * unit)


def least_time(axis: Axis, distance: float, steps: int = STEPS) -> float:
    """Return the least time [s] for `distance` [m] from rest to rest."""
    if distance == 0.0:
        return 0.0
    low, high = 1e-5, 1e-4
    while longest_distance(axis, high, steps) < distance:
        low, high = high, 4.0 * high
    while high / low > 1.0 + PRECISION:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if longest_distance(axis, middle, steps) >= distance else (middle, high)
    return high

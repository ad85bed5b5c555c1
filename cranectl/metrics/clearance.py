"""How far load and rope are from boxes: geometry that knows nothing of how motions are planned."""

import numpy as np
from numpy.typing import NDArray

from cranectl.metrics.setup import MetricsSetup
from cranectl.signals import BRIDGE, LOAD_COLUMN, STATE_COLUMN, TROLLEY
from cranectl.support.arrays import Array

HALVINGS = 50  # of the rope, to its nearest point


def add_clearance(
    setup: MetricsSetup, own: Array, _time_ns: NDArray[np.int64], record: Array, *_unread: Array
) -> None:
    """Keep the smallest clearance of all obstacles so far in `own` (1,)."""
    if not len(setup.obstacles) or not len(record):
        return
    load = record[:, LOAD_COLUMN : LOAD_COLUMN + 3]
    trolley = np.zeros_like(load)
    trolley[:, 0], trolley[:, 1] = record[:, STATE_COLUMN + BRIDGE], record[:, STATE_COLUMN + TROLLEY]
    for low, high in setup.obstacles:
        own[0] = min(own[0], clearance(load, trolley, low, high, setup.load_radius).min())


def clearance(load: Array, trolley: Array, low: Array, high: Array, radius: float) -> Array:
    """Return the distance (N,) [m] from a box `low` to `high` (3,) to the nearer of load and rope.

    `load`, `trolley` (N, 3). Negative: how deep the ball is inside, or how much of the rope.
    """
    off = np.maximum(low - load, load - high)
    ball = _length(np.maximum(off, 0.0)) + np.minimum(off.max(axis=1), 0.0) - radius
    nearer: Array = np.minimum(ball, _of_rope(load, trolley, low, high))
    return nearer


def _of_rope(load: Array, trolley: Array, low: Array, high: Array) -> Array:
    """Return the distance of the rope, which is convex along it: the minimum is found by bisection."""
    way = load - trolley
    begin, end = np.zeros(len(way)), np.ones(len(way))
    for _ in range(HALVINGS):
        middle = 0.5 * (begin + end)
        x, y, z = (_beyond(trolley + middle[:, np.newaxis] * way, low, high) * way).T
        rises = x + y + z > 0.0
        begin, end = np.where(rises, begin, middle), np.where(rises, middle, end)
    apart = _length(_beyond(trolley + begin[:, np.newaxis] * way, low, high))
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.stack([(low - trolley) / way, (high - trolley) / way])
    between = np.where(
        (trolley > low) & (trolley < high), np.inf, -np.inf
    )  # along the rope for good, or never
    enters = np.where(way == 0.0, -between, crossings.min(axis=0)).max(axis=1)
    leaves = np.where(way == 0.0, between, crossings.max(axis=0)).min(axis=1)
    inside = np.minimum(leaves, 1.0) - np.maximum(enters, 0.0)
    return np.where(inside > 0.0, -inside * _length(way), apart)


def _beyond(point: Array, low: Array, high: Array) -> Array:
    """Return the vector from the nearest point of the box to `point` (N, 3)."""
    beyond: Array = np.maximum(point - high, 0.0) - np.maximum(low - point, 0.0)
    return beyond


def _length(vectors: Array) -> Array:
    """Return the length (N,) of each vector, with the same bits for any number of vectors."""
    x, y, z = vectors.T
    length: Array = np.sqrt(x * x + y * y + z * z)
    return length

"""Compute the clearance between load, rope and boxes, independently of the planner's geometry."""

import numpy as np
from numpy.typing import NDArray

from cranectl.metrics.setup import MetricsSetup
from cranectl.signals import BRIDGE, COLUMN, TROLLEY
from cranectl.support import Array

HALVINGS = 50  # bisections along the rope, which find its nearest point


def add_clearance(
    setup: MetricsSetup, own: Array, _time_ns: NDArray[np.int64], record: Array, *_unread: Array
) -> None:
    """Update `own` (1,), the smallest clearance of all samples and obstacles."""
    if not len(setup.obstacles) or not len(record):
        return
    load = record[:, COLUMN.load : COLUMN.load + 3]
    trolley = np.zeros_like(load)
    trolley[:, 0], trolley[:, 1] = record[:, COLUMN.state + BRIDGE], record[:, COLUMN.state + TROLLEY]
    for low, high in setup.obstacles:
        own[0] = min(own[0], clearance(load, trolley, low, high, setup.load_radius).min())


def clearance(load: Array, trolley: Array, low: Array, high: Array, radius: float) -> Array:
    """Return the distance (N,) [m] between a box and the nearer one of load and rope.

    `load` and `trolley` (N, 3) are positions, `low` and `high` (3,) corners of the box, and `radius` that of
    the load. A negative distance is the depth of the load in the box, or the length of rope in it.
    """
    off = np.maximum(low - load, load - high)
    ball = _length(np.maximum(off, 0.0)) + np.minimum(off.max(axis=1), 0.0) - radius
    nearer: Array = np.minimum(ball, _of_rope(load, trolley, low, high))
    return nearer


def _of_rope(load: Array, trolley: Array, low: Array, high: Array) -> Array:
    """Return the distance (N,) between rope and box, or minus the length of rope inside.

    The distance is a convex function along the rope, so bisection finds its minimum.
    """
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
    # For a rope along an axis: it is between the faces of that axis everywhere, or nowhere.
    between = np.where((trolley > low) & (trolley < high), np.inf, -np.inf)
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

"""Edges of the load's range that a motion touches at its begin, its end or a via point.

There is no room for excesses between samples. All coefficients of the spline keep such an edge, and with
them the motion at every moment, since it lies within their hull.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cranectl.support import Array


class Edge(NamedTuple):
    """A half-space in which the coefficients of a motion must be."""

    normal: Array  # (d,) into the half-space, in coordinates
    offset: float  # least value along the normal [m]


def edge_excesses(edges: Sequence[Edge], x: Array, width: int, size: float) -> tuple[Array, Array]:
    """Return excesses over edges of the coefficients `x[:width]`, as shares of `size`, and their slopes."""
    excess, slope = [np.zeros(0)], [np.zeros((0, len(x)))]
    for edge in edges:
        free = x[:width].reshape(-1, len(edge.normal))
        excess.append((edge.offset - free @ edge.normal) / size)
        by_x = np.kron(np.eye(len(free)), -edge.normal / size)
        slope.append(np.pad(by_x, ((0, 0), (0, len(x) - width))))
    return np.concatenate(excess), np.vstack(slope)


def move_within(edges: Sequence[Edge], coefficients: Array) -> Array:
    """Return coefficients (n, d) moved to the edges where the solver left them beyond, by rounding."""
    for edge in edges:
        beyond = np.maximum(edge.offset - coefficients @ edge.normal, 0.0)
        coefficients = coefficients + np.outer(beyond / (edge.normal @ edge.normal), edge.normal)
    return coefficients

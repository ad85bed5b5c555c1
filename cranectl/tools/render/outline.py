"""Outlines of rope, load and trail, for runs that must not hide a user's model. No engine is used here."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from cranectl.support import Array

PIECES = 24  # of each line
DASH = 2  # pieces
OUTLINE_OPACITY = 0.8


def rope_and_load(
    pivot: Array, load: Array, sight: Array, *, radius: float, half_width: float
) -> tuple[list[Array], Array]:
    """Return the two sides of the rope, and a circle around the load that faces the camera.

    Parameters
    ----------
    pivot, load : Array
        Positions of the ends of the rope [m], shape (3,).
    sight : Array
        Direction from the camera to the load, shape (3,).
    radius, half_width : float
        Radius of the circle, and distance of the sides from the middle of the rope [m].

    Returns
    -------
    sides : list of Array
        Lines from the circle to the pivot, as points (PIECES + 1, 3) [m].
    circle : Array
        Points (PIECES + 1, 3) [m].
    """
    rope = pivot - load
    start = load + rope * min(radius / float(np.linalg.norm(rope)), 1.0)
    *_, across, upright = np.linalg.svd(sight[np.newaxis])[2]  # at right angles to the sight
    angles = np.linspace(0.0, 2.0 * np.pi, PIECES + 1)[:, np.newaxis]
    circle = load + radius * (np.cos(angles) * across + np.sin(angles) * upright)
    return sides(np.linspace(start, pivot, PIECES + 1), sight, half_width), circle


def sides(line: Array, sight: Array, half_width: float) -> list[Array]:
    """Return a line (M, 3) [m] moved to either side of it, as seen along `sight` (3,)."""
    if len(line) < 2:
        return []
    across = np.cross(np.gradient(line, axis=0), sight)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    shift = half_width * np.divide(across, size, out=np.zeros_like(across), where=size > 0.0)
    return [line - shift, line + shift]


def dashes_in_turn(line: Array, turn: int, turns: int) -> Iterator[tuple[Array, Array]]:
    """Yield the pieces of a line (M, 3) that belong to one of `turns` runs, so that all are seen on it."""
    for k, ends in enumerate(pairwise(line)):
        if k // DASH % turns == turn:
            yield ends

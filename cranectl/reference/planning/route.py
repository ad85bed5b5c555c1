"""Where a move goes: from point to point, lifted over obstacles, and on which side of them it is when."""

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.reference.planning.checks import check_way_over
from cranectl.reference.planning.geometry import Straight
from cranectl.reference.planning.limits import SIDES, Limits, motion, room
from cranectl.reference.planning.problem import Leg
from cranectl.reference.planning.shortest import SLOWLY, exceeded
from cranectl.reference.time_laws import time_law
from cranectl.support.arrays import Array

GUESS = 401  # points of a first guess
ROUNDING = 0.15  # of its length, over which its corners are rounded
HEADROOM = 0.1  # of the load's radius that is left above an obstacle by a path with stops


class Way(NamedTuple):
    """The sides of obstacles that a guess passes, and when they change."""

    legs: tuple[Leg, ...]
    instants: tuple[float, ...]


def stops(points: list[Array], limits: Limits, where: str) -> list[Array]:
    """Points to be driven to in straight lines with stops: lifted where an obstacle is in the way.

    Raises InputError where there is no way over it.
    """
    found = [points[0]]
    for end in points[1:]:
        start = found[-1]
        if blocking(start, end, limits):
            height = max(float(box.high[2]) for box in limits.obstacles) + (1.0 + HEADROOM) * limits.radius
            height = max(height, start[2], end[2])
            check_way_over(height, limits, where)
            over = [np.array([*start[:2], height]), np.array([*end[:2], height])]
            found += [point for point in over if not np.allclose(point, found[-1], atol=1e-9)]
            if np.allclose(found[-1], end, atol=1e-9):
                continue
        found.append(end)
    return found


def blocking(start: Array, end: Array, limits: Limits) -> list[str]:
    """Names of the obstacles that a straight line meets, driven as slowly as one likes."""
    slowly = exceeded(Straight(start, end), limits, SLOWLY)
    return [box.name for box in limits.obstacles if slowly[box.key] > 0.0]


def rounded(points: list[Array]) -> Array:
    """The path through `points` with its corners rounded, in equal parts of its time, (GUESS, 3)."""
    steps = [float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(points)]
    lengths = np.concatenate([[0.0], np.cumsum(steps)]) / sum(steps)
    fine = np.linspace(-ROUNDING, 1.0 + ROUNDING, 4 * GUESS)
    path = np.stack([np.interp(fine, lengths, column) for column in np.array(points).T], axis=1)
    half = max(1, int(ROUNDING / 2 / (fine[1] - fine[0]))) if len(points) > 2 else 0
    kernel = np.ones(2 * half + 1) / (2 * half + 1)
    smooth = np.stack([np.convolve(column, kernel, mode="same") for column in path.T], axis=1)
    law = time_law("degree-9", np.linspace(0.0, 1.0, GUESS))[0]
    return np.stack([np.interp(law, fine, column) for column in smooth.T], axis=1)


def way(guess: Array, limits: Limits, first_instant: int) -> Way:
    """By the guess (GUESS, 3), taken slowly: of each obstacle the sides that it is clear on for longest."""
    legs: list[Leg] = []
    instants: list[float] = []
    nothing = np.zeros(len(guess))
    moved = motion([[column, nothing, nothing] for column in guess.T], limits.gravity)
    for box in limits.obstacles:
        free = room(moved, box, limits.radius)
        at, begins = 0, None
        while True:
            best = int(np.argmax([_lasts(row) for row in free[:, at:] >= 0.0]))
            until = at + _lasts(free[best, at:] >= 0.0)
            clear = np.flatnonzero((free[:, until:] >= 0.0).any(axis=0))
            if not len(clear):
                legs.append(Leg(box, SIDES[best], begins, None))
                break
            at = until + int(clear[0])  # through the box, if the guess leads through it
            ends = first_instant + len(instants)
            instants.append(0.5 * (until + at) / len(guess))
            legs.append(Leg(box, SIDES[best], begins, ends))
            begins = ends
    return Way(tuple(legs), tuple(instants))


def _lasts(clear: NDArray[np.bool_]) -> int:
    """How many there are before the first that is not."""
    return len(clear) if clear.all() else int(np.argmin(clear))

"""Where a move goes: from point to point, lifted over obstacles, and on which side of them it is when."""

import itertools

import numpy as np
from numpy.typing import NDArray

from cranectl.planning.checks import check_way_over
from cranectl.planning.limits import SIDES, Box, Limits, clearance, motion
from cranectl.planning.problem import Passage
from cranectl.planning.proof import PROOF_MARGIN
from cranectl.reference.time_laws import time_law
from cranectl.support.arrays import Array

GUESS = 401  # points of a first guess
CORNER_SHARE = 0.15  # of its length, over which its corners are rounded
PASSAGE_CLEARANCE = 0.1  # of the load's radius that is left above an obstacle by a path with stops


def stops(points: list[Array], limits: Limits, where: str) -> list[Array]:
    """Return points to be driven to in straight lines with stops, lifted where an obstacle is in the way.

    Raises InputError where there is no way over it.
    """
    result = [points[0]]
    for end in points[1:]:
        start = result[-1]
        if is_blocked(start, end, limits):
            top = max(float(box.high[2]) for box in limits.obstacles)
            height = max(top + (1.0 + PASSAGE_CLEARANCE) * limits.radius, start[2], end[2])
            check_way_over(height, limits, where)
            over = [np.array([*start[:2], height]), np.array([*end[:2], height])]
            result += [point for point in over if not np.allclose(point, result[-1], atol=1e-9)]
            if np.allclose(result[-1], end, atol=1e-9):
                continue
        result.append(end)
    return result


def is_blocked(start: Array, end: Array, limits: Limits) -> bool:
    """Return True if a load that is moved straight, as slowly as one likes, meets an obstacle."""
    return any(depth(start, end, box, limits.radius) > PROOF_MARGIN for box in limits.obstacles)


def depth(start: Array, end: Array, box: Box, radius: float) -> float:
    """Return how deep [m] a straight line leads into where a load at rest touches a box; below 0: past it.

    The depth below each face is linear along the line, so that the least of them has its maximum at an end
    or where two are equal.
    """
    faces = np.array([*(box.low[:2] - radius), *-(box.high[:2] + radius), -(box.high[2] + radius)])
    first, last = (np.array([*point[:2], *-point[:2], -point[2]]) - faces for point in (start, end))
    slope = last - first
    one, other = np.triu_indices(len(faces), k=1)
    closing = slope[one] - slope[other]
    crossing = (first[other] - first[one])[closing != 0.0] / closing[closing != 0.0]
    parts = np.concatenate([[0.0, 1.0], crossing[(crossing > 0.0) & (crossing < 1.0)]])
    return float((first[:, None] * (1.0 - parts) + last[:, None] * parts).min(axis=0).max())


def rounded(points: list[Array]) -> Array:
    """Return the path through `points` with its corners rounded, in equal parts of its time, (GUESS, 3)."""
    steps = [float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(points)]
    lengths = np.concatenate([[0.0], np.cumsum(steps)]) / sum(steps)
    fine = np.linspace(-CORNER_SHARE, 1.0 + CORNER_SHARE, 4 * GUESS)
    path = np.stack([np.interp(fine, lengths, column) for column in np.array(points).T], axis=1)
    half = max(1, int(CORNER_SHARE / 2 / (fine[1] - fine[0]))) if len(points) > 2 else 0
    kernel = np.ones(2 * half + 1) / (2 * half + 1)
    smooth = np.stack([np.convolve(column, kernel, mode="same") for column in path.T], axis=1)
    progress = time_law("degree-9", np.linspace(0.0, 1.0, GUESS))[0]
    return np.stack([np.interp(progress, fine, column) for column in smooth.T], axis=1)


def passages_of(
    guess: Array, limits: Limits, first_instant: int
) -> tuple[tuple[Passage, ...], tuple[float, ...]]:
    """Return the passages of a guess (GUESS, 3), taken slowly, and the instants at which they change.

    Of each obstacle they are on the sides that the guess is clear on for longest.
    """
    passages: list[Passage] = []
    instants: list[float] = []
    nothing = np.zeros(len(guess))
    moved = motion([[column, nothing, nothing] for column in guess.T], limits.gravity)
    for index, box in enumerate(limits.obstacles):
        is_clear = clearance(moved, box, limits.radius) >= 0.0
        at = begin = 0
        while True:
            lasting = [_length_of_first_run(row) for row in is_clear[:, at:]]
            best = int(np.argmax(lasting))
            until = at + lasting[best]
            clear = np.flatnonzero(is_clear[:, until:].any(axis=0))
            if not len(clear):
                passages.append(Passage(index, SIDES[best], begin, -1))
                break
            at = until + int(clear[0])  # through the box, if the guess leads through it
            instants.append(0.5 * (until + at) / len(guess))
            end = first_instant + len(instants)
            passages.append(Passage(index, SIDES[best], begin, end))
            begin = end
    return tuple(passages), tuple(instants)


def _length_of_first_run(clear: NDArray[np.bool_]) -> int:
    """Return how many there are before the first that is not."""
    return len(clear) if clear.all() else int(np.argmin(clear))

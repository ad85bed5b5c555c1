"""Route of a move: from point to point, lifted over obstacles, and on which side of them when."""

import itertools

import numpy as np
from numpy.typing import NDArray

from cranectl.planning.checks import check_height_over
from cranectl.planning.limits import SIDES, Box, Limits, clearance, motion
from cranectl.planning.problem import Passage
from cranectl.planning.proof import PROOF_MARGIN
from cranectl.reference import Series, TimeLaw
from cranectl.support import Array

GUESS_POINTS = 401
ROUNDED_SHARE = 0.15  # of a guess's length, over which a corner is rounded
EXTRA_CLEARANCE = 0.1  # of the load's radius, above an obstacle on a path with stops


def add_stops(points: list[Array], limits: Limits, where: str) -> list[Array]:
    """Return the corners of straight lines, lifted over obstacles; raise InputError if one is too high."""
    result = [points[0]]
    for end in points[1:]:
        start = result[-1]
        if is_blocked(start, end, limits):
            top = max(float(box.high[2]) for box in limits.obstacles)
            height = max(top + (1.0 + EXTRA_CLEARANCE) * limits.radius, start[2], end[2])
            check_height_over(height, limits, where)
            over = [np.array([*start[:2], height]), np.array([*end[:2], height])]
            result += [point for point in over if not np.allclose(point, result[-1], atol=1e-9)]
            if np.allclose(result[-1], end, atol=1e-9):
                continue
        result.append(end)
    return result


def is_blocked(start: Array, end: Array, limits: Limits) -> bool:
    """Return True if a load that moves slowly along the straight line meets an obstacle."""
    return any(obstacle_depth(start, end, box, limits.radius) > PROOF_MARGIN for box in limits.obstacles)


def obstacle_depth(start: Array, end: Array, box: Box, radius: float) -> float:
    """Return how deep [m] a straight line enters a box that is grown by the load's radius, negative outside.

    The depth below each face is linear along the line, so the least of them has its maximum at an end of the
    line or where two are equal.
    """
    faces = np.array([*(box.low[:2] - radius), *-(box.high[:2] + radius), -(box.high[2] + radius)])
    first, last = (np.array([*point[:2], *-point[:2], -point[2]]) - faces for point in (start, end))
    slope = last - first
    one, other = np.triu_indices(len(faces), k=1)
    closing = slope[one] - slope[other]
    crossing = (first[other] - first[one])[closing != 0.0] / closing[closing != 0.0]
    parts = np.concatenate([[0.0, 1.0], crossing[(crossing > 0.0) & (crossing < 1.0)]])
    return float((first[:, None] * (1.0 - parts) + last[:, None] * parts).min(axis=0).max())


def round_corners(points: list[Array]) -> Array:
    """Return the path through `points` with rounded corners, at equal steps of time: (GUESS_POINTS, 3)."""
    steps = [float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(points)]
    lengths = np.concatenate([[0.0], np.cumsum(steps)]) / sum(steps)
    # Beyond both ends the path stays there: the filter must not average with zeros.
    fine = np.linspace(-ROUNDED_SHARE, 1.0 + ROUNDED_SHARE, 4 * GUESS_POINTS)
    path = np.stack([np.interp(fine, lengths, column) for column in np.array(points).T], axis=1)
    half = max(1, int(ROUNDED_SHARE / 2 / (fine[1] - fine[0]))) if len(points) > 2 else 0
    kernel = np.ones(2 * half + 1) / (2 * half + 1)
    smooth = np.stack([np.convolve(column, kernel, mode="same") for column in path.T], axis=1)
    progress = TimeLaw().sample(np.linspace(0.0, 1.0, GUESS_POINTS))[0]
    return np.stack([np.interp(progress, fine, column) for column in smooth.T], axis=1)


def find_passages(
    guess: Array, limits: Limits, via_count: int
) -> tuple[tuple[Passage, ...], tuple[float, ...]]:
    """Return passages on the sides where a guess (GUESS_POINTS, 3) stays clear longest, and instants."""
    passages: list[Passage] = []
    instants: list[float] = []
    zero = np.zeros(len(guess))
    crane_motion = motion([Series([column, zero, zero]) for column in guess.T], limits.gravity)
    for index, box in enumerate(limits.obstacles):
        is_clear = clearance(crane_motion, box, limits.radius) >= 0.0
        first = begin = 0
        while True:
            run_lengths = [_length_of_first_run(row) for row in is_clear[:, first:]]
            best = int(np.argmax(run_lengths))
            until = first + run_lengths[best]
            clear = np.flatnonzero(is_clear[:, until:].any(axis=0))
            if not len(clear):
                passages.append(Passage(index, SIDES[best], begin, -1))
                break
            first = until + int(clear[0])  # later than `until` if the guess leads through the box
            instants.append(0.5 * (until + first) / len(guess))
            end = via_count + len(instants)
            passages.append(Passage(index, SIDES[best], begin, end))
            begin = end
    return tuple(passages), tuple(instants)


def _length_of_first_run(clear: NDArray[np.bool_]) -> int:
    """Return the number of elements before the first False."""
    return len(clear) if clear.all() else int(np.argmin(clear))

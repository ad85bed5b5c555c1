"""Sequential convex programs: limits linearised, the duration made less step by step within a trust region.

Each step solves a quadratic program by Clarabel: the duration, a small weight on the mean square of what the
drives do (else axes that do not decide the duration wander), and the Hessian of the limits that act, where it
is convex along them. An excess over a limit costs, so that a step is always possible. After arXiv 2205.00754;
a solver's status is believed, not its numbers.
"""

from dataclasses import dataclass
from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cranectl.planning.problem import Linearisation, Problem
from cranectl.support.arrays import Array

EFFORT_WEIGHT = 1e-2  # of the mean square of the drives' shares of their limits, in durations
PENALTIES = 6.0, 24.0  # on the largest excess in parts of its limit, in durations
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.1, 1.0, 1e-6  # of the trust region, in sizes of the unknowns
MAX_CORRECTIONS = 4  # of a step
MAX_STEPS = 80
MIN_GAIN = 2e-5  # of a step, in durations; less is not worth another
SADDLE = 1e-2  # second derivative, in durations and sizes of the unknowns, that is worth leaving
SADDLE_STEP = 1.0  # way from a saddle, in sizes of the unknowns
MIN_MULTIPLIER = 1e-6  # of a limit that acts
FEASIBLE = 1e-3  # excess that is left, in parts of a limit, of a solution


class Solution(NamedTuple):
    """What was found."""

    x: Array
    solved: bool
    penalty: float = 0.0  # on excesses, with which it was found, in durations


def solve(problem: Problem, x: Array, sizes: Array, least_penalty: float = PENALTIES[0]) -> Solution:
    """Find the x of least duration near the one given; `sizes` (unknowns,) are what is a long way for each.

    A small penalty on excesses allows long steps, one that is too small leaves some: then it is raised.
    """
    unit = problem.duration(x)
    for penalty in (candidate for candidate in PENALTIES if candidate >= least_penalty):
        merit = Merit(problem, sizes, unit, effort=EFFORT_WEIGHT * unit, excess=penalty * unit)
        minimum = _minimise(merit, x)._replace(penalty=penalty)
        x = minimum.x
        if minimum.solved:
            break
    return minimum


@dataclass(frozen=True)
class Merit:
    """What is made less [s]: the duration, and weights on the mean square of efforts, on the largest excess.

    Moves are in sizes of the unknowns.
    """

    problem: Problem
    sizes: Array
    unit: float  # a duration
    effort: float
    excess: float

    def value(self, x: Array) -> tuple[float, Array]:
        """Return the merit [s] and the excesses."""
        excess, efforts = self.problem.values(x)
        most = max(0.0, float(excess.max()))
        effort = self.effort * float(np.mean(efforts**2))
        return self.problem.duration(x) + effort + self.excess * most, excess

    def near(self, x: Array) -> Linearisation:
        """Return the problem near x, by moves."""
        linearised = self.problem.linearised(x)
        return linearised._replace(
            slope=linearised.slope * self.sizes, effort_slope=linearised.effort_slope * self.sizes
        )

    def predicted(self, x: Array, near: Linearisation, hessian: Array, move: Array) -> float:
        """Return what the program takes the merit after `move` for."""
        at, efforts = self.problem.width, near.efforts
        duration = float(x[at] + self.sizes[at] * move[at])
        mean = np.mean(efforts**2) + 2.0 * efforts @ (near.effort_slope @ move) / len(efforts)
        excess = max(0.0, float((near.excess + near.slope @ move).max()))
        return float(duration + self.effort * mean + self.excess * excess + 0.5 * move @ hessian @ move)

    def hessian(self, x: Array, near: Linearisation, multipliers: Array) -> tuple[Array, Array]:
        """Return the Hessian of the efforts, and of the limits that act along them where it is convex.

        And the direction of what is not convex, or zeros.
        """
        slope = near.effort_slope
        hessian: Array = 2.0 * self.effort / len(slope) * slope.T @ slope
        if not multipliers.any():
            return hessian, np.zeros(len(x))
        whole = self.problem.curvature(x, multipliers) * np.outer(self.sizes, self.sizes)
        _, size, directions = np.linalg.svd(near.slope[multipliers > 0.0])
        along = directions[np.count_nonzero(size > 1e-8 * size[0]) :].T
        values, vectors = np.linalg.eigh(along.T @ whole @ along)
        basis = along @ vectors
        total, directions = np.linalg.eigh(along.T @ (whole + hessian) @ along)
        falls = total[:1] < -SADDLE * self.unit
        downhill = along @ directions[:, :1] @ falls
        hessian += (basis * np.maximum(values, 0.0)) @ basis.T
        return hessian, downhill


def _minimise(merit: Merit, x: Array) -> Solution:
    """Descend to a minimum: leave a saddle, as motions in a plane often are, along its negative curvature."""
    minimum, downhill = _descend(merit, x, MAX_STEPS)
    if not minimum.solved or not downhill.any():
        return minimum
    other, _ = _descend(merit, minimum.x + merit.sizes * SADDLE_STEP * downhill, MAX_STEPS // 4)
    better = other.solved and merit.problem.duration(other.x) < merit.problem.duration(minimum.x)
    return other if better else minimum


def _descend(merit: Merit, x: Array, max_steps: int) -> tuple[Solution, Array]:
    """Go to where no step gains enough; return also along what the merit falls there by its Hessian, or 0."""
    radius = FIRST_STEP
    near, multipliers = merit.near(x), np.zeros(0)
    value, _ = merit.value(x)
    hessian, downhill = merit.hessian(x, near, multipliers)
    enough = MIN_GAIN * merit.problem.duration(x)
    chosen = np.zeros(len(near.excess), dtype=bool)
    for _ in range(max_steps):
        step = _program(merit, near, near.excess, hessian, radius=radius, chosen=chosen)
        if step is None:
            return Solution(x, solved=False), downhill
        move, multipliers = step
        gain = value - merit.predicted(x, near, hessian, move)
        if gain < enough:
            break
        reached, excess = merit.value(x + merit.sizes * move)
        for _ in range(MAX_CORRECTIONS):
            if reached < value - 0.7 * gain:
                break
            # The same slopes with the excess that the step has: a correction of second order.
            left = excess - near.slope @ move
            corrected = _program(merit, near, left, hessian, radius=radius, chosen=chosen)
            if corrected is None:
                break
            other, there = merit.value(x + merit.sizes * corrected[0])
            if other >= reached:
                break
            move, reached, excess = corrected[0], other, there
        ratio = (value - reached) / gain
        if ratio < 0.3:
            radius = 0.4 * min(radius, float(np.abs(move).max()))
        elif ratio > 0.7:
            radius = min(2.0 * radius, LONGEST_STEP)
        if radius < SHORTEST_STEP:
            break
        if ratio > 0.1:
            x, value = x + merit.sizes * move, reached
            chosen[:] = multipliers > 0.0
            near = merit.near(x)
            hessian, downhill = merit.hessian(x, near, multipliers)
    return Solution(x, float(near.excess.max()) < FEASIBLE), downhill


def _program(
    merit: Merit,
    near: Linearisation,
    excess: Array,
    hessian: Array,
    *,
    radius: float,
    chosen: NDArray[np.bool_],
) -> tuple[Array, Array] | None:
    """Return the best move within `radius`, and the multiplier of each limit; None where none was found.

    Few limits act: those that a solution without them breaks are put in, and it is solved again. `chosen` are
    those to begin with, and is brought up to date.
    """
    n = len(merit.sizes)
    linear = 2.0 * merit.effort / len(near.efforts) * (near.effort_slope.T @ near.efforts)
    linear[merit.problem.width] += merit.sizes[merit.problem.width]  # the duration
    quadratic = sparse.csc_matrix(np.triu(np.pad(hessian, (0, 1))))
    cost = np.append(linear, merit.excess)
    box = np.vstack([np.eye(n + 1)[:n], -np.eye(n + 1)])
    bounds = np.append(np.full(2 * n, radius), 0.0)
    chosen[np.argpartition(-excess, n)[:n]] = True
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    while True:
        rows = np.flatnonzero(chosen)
        limits = np.hstack([near.slope[rows], np.full((len(rows), 1), -1.0)])
        matrix = sparse.csc_matrix(np.vstack([limits, box]))
        right = np.concatenate([-excess[rows], bounds])
        cones = [clarabel.NonnegativeConeT(len(right))]
        answer = clarabel.DefaultSolver(quadratic, cost, matrix, right, cones, settings).solve()
        if answer.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
            return None
        move = np.array(answer.x)
        left = excess + near.slope @ move[:n] - move[n]
        left[rows] = -np.inf
        worst = np.argpartition(-left, n)[:n]
        worst = worst[left[worst] > 1e-7]
        if not len(worst):
            break
        chosen[worst] = True
    multipliers = np.zeros(len(excess))
    multipliers[rows] = np.array(answer.z)[: len(rows)]
    return move[:n], np.where(multipliers > MIN_MULTIPLIER, multipliers, 0.0)

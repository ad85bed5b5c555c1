"""Minimise the duration by sequential convex programming within a trust region.

Each step solves a quadratic program by Clarabel with linearised limits. Its objective is the sum of

- the duration,
- a small weight on the mean square of the efforts, which determines axes that do not limit the duration,
- the convex part of the Hessian of the active limits, in directions tangent to them,
- a penalty on excesses over the limits, so that the program is always feasible.

The method follows arXiv 2205.00754. A solution counts only if the solver's status says that it is solved.
"""

from dataclasses import dataclass
from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cranectl.planning.problem import Linearisation, Problem
from cranectl.support import Array

EFFORT_WEIGHT = 1e-2  # of the mean square of the efforts, in durations
PENALTIES = 6.0, 24.0  # on the largest excess as a share of its limit, in durations
FIRST_STEP, MAX_TRUST_STEP, MIN_TRUST_STEP = 0.1, 1.0, 1e-6  # of the trust region, in sizes of the unknowns
MAX_CORRECTIONS = 4  # of a step
MAX_STEPS = 80
MAX_PROGRAMS = 2500  # of a search; moves take 100 to 700
MIN_GAIN = 2e-5  # of a step, in durations; a smaller gain ends the descent
SADDLE_CURVATURE = 1e-2  # negative curvature that makes a saddle, in durations and sizes of the unknowns
SADDLE_STEP = 1.0  # away from a saddle, in sizes of the unknowns
MIN_MULTIPLIER = 1e-6  # of an active limit
FEASIBILITY_TOLERANCE = 1e-3  # excess of a solution, as a share of a limit


class ProgramBudget:
    """How many quadratic programs a search may still solve, so that its work has a bound."""

    def __init__(self, programs: int = MAX_PROGRAMS) -> None:
        self.programs = programs

    def spend(self) -> bool:
        """Take one program from the budget; return False if none is left."""
        self.programs -= 1
        return self.programs >= 0


class Solution(NamedTuple):
    """Result of a solver."""

    x: Array
    solved: bool
    penalty: float = 0.0  # on excesses in the last descent, in durations


def solve(
    problem: Problem, x: Array, sizes: Array, budget: ProgramBudget, min_penalty: float = PENALTIES[0]
) -> Solution:
    """Find a local minimum of the duration from the guess `x`; `sizes` (unknowns,) scale the steps.

    It begins with a small penalty on excesses, which allows long steps, and raises it if excesses remain.
    A search whose budget is spent is not solved.
    """
    time_scale = problem.duration(x)
    for penalty in (candidate for candidate in PENALTIES if candidate >= min_penalty):
        weights = {"effort": EFFORT_WEIGHT * time_scale, "excess": penalty * time_scale}
        merit = Merit(problem, sizes, time_scale, **weights, budget=budget)
        minimum = _minimise(merit, x)._replace(penalty=penalty)
        x = minimum.x
        if minimum.solved:
            break
    return minimum


@dataclass(frozen=True)
class Merit:
    """The duration [s] plus weights on mean square effort and largest excess; moves are in `sizes`."""

    problem: Problem
    sizes: Array
    time_scale: float  # [s]
    effort: float
    excess: float
    budget: ProgramBudget

    def value(self, x: Array) -> tuple[float, Array]:
        """Return the merit [s] and the excesses."""
        excess, efforts = self.problem.values(x)
        largest = max(0.0, float(excess.max()))
        effort = self.effort * float(np.mean(efforts**2))
        return self.problem.duration(x) + effort + self.excess * largest, excess

    def linearise(self, x: Array) -> Linearisation:
        """Return the problem linearised at x, with slopes with respect to moves."""
        linearised = self.problem.linearise(x)
        return linearised._replace(
            slope=linearised.slope * self.sizes, effort_slope=linearised.effort_slope * self.sizes
        )

    def predict(self, x: Array, linearised: Linearisation, hessian: Array, move: Array) -> float:
        """Return the merit after `move` as the quadratic program predicts it [s]."""
        at, efforts = self.problem.width, linearised.efforts
        duration = float(x[at] + self.sizes[at] * move[at])
        mean = np.mean(efforts**2) + 2.0 * efforts @ (linearised.effort_slope @ move) / len(efforts)
        excess = max(0.0, float((linearised.excess + linearised.slope @ move).max()))
        return float(duration + self.effort * mean + self.excess * excess + 0.5 * move @ hessian @ move)

    def hessian(self, x: Array, linearised: Linearisation, multipliers: Array) -> tuple[Array, Array]:
        """Return the Hessian of efforts and convex active limits, and a downhill direction, or zeros."""
        slope = linearised.effort_slope
        hessian: Array = 2.0 * self.effort / len(slope) * slope.T @ slope
        if not multipliers.any():
            return hessian, np.zeros(len(x))
        whole = self.problem.hessian_of(x, multipliers) * np.outer(self.sizes, self.sizes)
        _, size, directions = np.linalg.svd(linearised.slope[multipliers > 0.0])
        # The directions beyond the rank change no active limit, to first order.
        tangent = directions[np.count_nonzero(size > 1e-8 * size[0]) :].T
        values, vectors = np.linalg.eigh(tangent.T @ whole @ tangent)
        basis = tangent @ vectors
        total, directions = np.linalg.eigh(tangent.T @ (whole + hessian) @ tangent)
        is_downhill = total[:1] < -SADDLE_CURVATURE * self.time_scale
        downhill = tangent @ directions[:, :1] @ is_downhill
        hessian += (basis * np.maximum(values, 0.0)) @ basis.T
        return hessian, downhill


def _minimise(merit: Merit, x: Array) -> Solution:
    """Descend to a minimum; leave a saddle point, as many planar motions are, along negative curvature."""
    minimum, downhill = _descend(merit, x, MAX_STEPS)
    if not minimum.solved or not downhill.any():
        return minimum
    other, _ = _descend(merit, minimum.x + merit.sizes * SADDLE_STEP * downhill, MAX_STEPS // 4)
    better = other.solved and merit.problem.duration(other.x) < merit.problem.duration(minimum.x)
    return other if better else minimum


def _descend(merit: Merit, x: Array, max_steps: int) -> tuple[Solution, Array]:
    """Descend until the gain is small; also return a direction of negative curvature there, or zeros."""
    radius = FIRST_STEP
    linearised, multipliers = merit.linearise(x), np.zeros(0)
    value, _ = merit.value(x)
    hessian, downhill = merit.hessian(x, linearised, multipliers)
    min_gain = MIN_GAIN * merit.problem.duration(x)
    working_set = np.zeros(len(linearised.excess), dtype=bool)
    for _ in range(max_steps):
        step = _solve_qp(
            merit, linearised, linearised.excess, hessian, radius=radius, working_set=working_set
        )
        if step is None:
            return Solution(x, solved=False), downhill
        move, multipliers = step
        gain = value - merit.predict(x, linearised, hessian, move)
        if gain < min_gain:
            break
        reached, excess = merit.value(x + merit.sizes * move)
        for _ in range(MAX_CORRECTIONS):
            if reached < value - 0.7 * gain:
                break
            # Second-order correction: the same slopes, with the excess after the step.
            remaining = excess - linearised.slope @ move
            corrected = _solve_qp(
                merit, linearised, remaining, hessian, radius=radius, working_set=working_set
            )
            if corrected is None:
                break
            corrected_value, corrected_excess = merit.value(x + merit.sizes * corrected[0])
            if corrected_value >= reached:
                break
            move, reached, excess = corrected[0], corrected_value, corrected_excess
        ratio = (value - reached) / gain
        # The thresholds are customary for trust regions: they change how many steps it takes, not the plan.
        if ratio < 0.3:
            radius = 0.4 * min(radius, float(np.abs(move).max()))
        elif ratio > 0.7:
            radius = min(2.0 * radius, MAX_TRUST_STEP)
        if radius < MIN_TRUST_STEP:
            break
        if ratio > 0.1:
            x, value = x + merit.sizes * move, reached
            working_set[:] = multipliers > 0.0
            linearised = merit.linearise(x)
            hessian, downhill = merit.hessian(x, linearised, multipliers)
    return Solution(x, float(linearised.excess.max()) < FEASIBILITY_TOLERANCE), downhill


def _solve_qp(
    merit: Merit,
    linearised: Linearisation,
    excess: Array,
    hessian: Array,
    *,
    radius: float,
    working_set: NDArray[np.bool_],
) -> tuple[Array, Array] | None:
    """Return the best move within `radius` and the multiplier of each limit, or None.

    There is none if the solver fails, or if the budget is spent.

    Few limits are active. The program begins with the limits in `working_set`, adds those that its solution
    exceeds, and is solved again. `working_set` is updated in place.
    """
    n = len(merit.sizes)
    linear = 2.0 * merit.effort / len(linearised.efforts) * (linearised.effort_slope.T @ linearised.efforts)
    linear[merit.problem.width] += merit.sizes[merit.problem.width]  # the duration
    # Clarabel takes the upper triangle. The last variable is the largest excess, at least 0.
    quadratic = sparse.csc_matrix(np.triu(np.pad(hessian, (0, 1))))
    cost = np.append(linear, merit.excess)
    box = np.vstack([np.eye(n + 1)[:n], -np.eye(n + 1)])
    bounds = np.append(np.full(2 * n, radius), 0.0)
    working_set[np.argpartition(-excess, n)[:n]] = True
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    while merit.budget.spend():
        rows = np.flatnonzero(working_set)
        limits = np.hstack([linearised.slope[rows], np.full((len(rows), 1), -1.0)])
        matrix = sparse.csc_matrix(np.vstack([limits, box]))
        right_side = np.concatenate([-excess[rows], bounds])
        cones = [clarabel.NonnegativeConeT(len(right_side))]
        result = clarabel.DefaultSolver(quadratic, cost, matrix, right_side, cones, settings).solve()
        if result.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
            return None
        move = np.array(result.x)
        remaining = excess + linearised.slope @ move[:n] - move[n]
        remaining[rows] = -np.inf
        worst = np.argpartition(-remaining, n)[:n]
        worst = worst[remaining[worst] > 1e-7]
        if not len(worst):
            multipliers = np.zeros(len(excess))
            multipliers[rows] = np.array(result.z)[: len(rows)]
            return move[:n], np.where(multipliers > MIN_MULTIPLIER, multipliers, 0.0)
        working_set[worst] = True
    return None

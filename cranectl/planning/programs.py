"""Sequential convex programs: limits linearised, the duration made less step by step within a trust region.

Each step solves a quadratic program by Clarabel: the duration, a small price on the mean square of what the
drives do (else axes that do not decide the duration wander), and the bend of the limits that act, where it is
convex along them. An excess over a limit costs, so that a step is always possible. After arXiv 2205.00754; a
solver's status is believed, not its numbers.
"""

from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cranectl.planning.problem import Problem
from cranectl.support.arrays import Array

EFFORT = 1e-2  # price of the mean square of the drives' shares of their limits, in durations
PRICES = 6.0, 24.0  # price of the largest excess in parts of its limit, in durations
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.1, 1.0, 1e-6  # of the trust region, in sizes of the unknowns
CORRECTIONS = 4  # of a step, at most
MOST_STEPS = 80
GOOD_ENOUGH = 2e-5  # gain of a step, in durations, that is not worth another
SADDLE = 1e-2  # second derivative, in durations and sizes of the unknowns, that is worth leaving
ASIDE = 1.0  # way from a saddle, in sizes of the unknowns
PRICED = 1e-6  # of a limit that acts
FEASIBLE = 1e-3  # excess that is left, in parts of a limit, of a solution


class Solution(NamedTuple):
    """What was found."""

    x: Array
    excess: float  # largest over any limit, in parts of it
    steps: int
    solved: bool
    price: float = 0.0  # of excesses with which it was found, in durations


class Prices(NamedTuple):
    """What the merit adds to the duration [s]."""

    unit: float  # a duration
    effort: float  # of the mean square of the efforts
    excess: float  # of the largest excess


def solve(problem: Problem, x: Array, sizes: Array, price: float = PRICES[0]) -> Solution:
    """The x of least duration near the one given; `sizes` (unknowns,) are what is a long way for each.

    A small price on excesses allows long steps, one that is too small leaves some: then it is raised.
    """
    unit, steps, found = problem.duration(x), 0, None
    for penalty in PRICES:
        if penalty < price:
            continue
        found = _descend(problem, x, sizes, Prices(unit, EFFORT * unit, penalty * unit))._replace(
            price=penalty
        )
        x, steps = found.x, steps + found.steps
        if found.solved:
            break
    assert found is not None
    return found._replace(steps=steps)


class Local(NamedTuple):
    """The problem near one x, in sizes of the unknowns."""

    excess: Array  # (R,)
    slope: Array  # (R, n)
    efforts: Array  # (E,)
    effort_slope: Array  # (E, n)

    def model(self, move: Array, bend: Array, duration: float, price: Prices) -> float:
        """What the program takes the merit after `move`, which leads to `duration`, for."""
        mean = np.mean(self.efforts**2) + 2.0 * self.efforts @ (self.effort_slope @ move) / len(self.efforts)
        excess = max(0.0, float((self.excess + self.slope @ move).max()))
        return float(duration + price.effort * mean + price.excess * excess + 0.5 * move @ bend @ move)


def _local(problem: Problem, x: Array, sizes: Array) -> Local:
    excess, efforts = problem.linearised(x)
    return Local(excess.value, excess.slope * sizes, efforts.value, efforts.slope * sizes)


def _merit(problem: Problem, x: Array, price: Prices) -> tuple[float, Array]:
    """What is made less [s], and the excesses."""
    excess, efforts = problem.values(x)
    most = max(0.0, float(excess.max()))
    return problem.duration(x) + price.effort * float(np.mean(efforts**2)) + price.excess * most, excess


def _descend(problem: Problem, x: Array, sizes: Array, price: Prices) -> Solution:
    """To a minimum: a saddle, as motions in a plane often are, is left along its negative curvature."""
    found, downhill = _to_rest(problem, x, sizes, price, MOST_STEPS)
    if not found.solved or not downhill.any():
        return found
    there = found.x + sizes * ASIDE * downhill
    other, _ = _to_rest(problem, there, sizes, price, MOST_STEPS // 4)
    steps = found.steps + other.steps
    better = other.solved and problem.duration(other.x) < problem.duration(found.x)
    return (other if better else found)._replace(steps=steps)


def _to_rest(
    problem: Problem, x: Array, sizes: Array, price: Prices, most_steps: int
) -> tuple[Solution, Array]:
    """To where no step gains enough; and along what the merit falls there by its second derivative, or 0."""
    radius, at = FIRST_STEP, problem.width
    near, prices = _local(problem, x, sizes), np.zeros(0)
    value, _ = _merit(problem, x, price)
    bend, downhill = _bend(problem, x, near, prices, sizes=sizes, price=price)
    enough = GOOD_ENOUGH * float(x[at])
    chosen = np.zeros(len(near.excess), dtype=bool)
    time = np.eye(len(x))[at] * sizes[at]  # the duration's slope
    step = 0
    for step in range(1, most_steps + 1):
        found = _program(near, near.excess, bend, radius, time=time, price=price, chosen=chosen)
        if found is None:
            return Solution(x, float(near.excess.max()), step, False), downhill
        move, prices = found
        gain = value - near.model(move, bend, float(x[at] + time @ move), price)
        if gain < enough:
            break
        reached, excess = _merit(problem, x + sizes * move, price)
        for _ in range(CORRECTIONS):
            if reached < value - 0.7 * gain:
                break
            # The same slopes with the excess that the step has: a correction of second order.
            left = excess - near.slope @ move
            corrected = _program(near, left, bend, radius, time=time, price=price, chosen=chosen)
            if corrected is None:
                break
            other, there = _merit(problem, x + sizes * corrected[0], price)
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
            x, value = x + sizes * move, reached
            chosen[:] = prices > 0.0
            near = _local(problem, x, sizes)
            bend, downhill = _bend(problem, x, near, prices, sizes=sizes, price=price)
    most = float(near.excess.max())
    return Solution(x, most, step, most < FEASIBLE), downhill


def _bend(
    problem: Problem, x: Array, near: Local, prices: Array, *, sizes: Array, price: Prices
) -> tuple[Array, Array]:
    """Second derivative of the priced efforts, and of the limits that act along them where it is convex.

    And the direction of what is not convex, or zeros.
    """
    slope = near.effort_slope
    bend: Array = 2.0 * price.effort / len(slope) * slope.T @ slope
    if not prices.any():
        return bend, np.zeros(len(x))
    whole = problem.curvature(x, prices) * np.outer(sizes, sizes)
    _, size, directions = np.linalg.svd(near.slope[prices > 0.0])
    along = directions[np.count_nonzero(size > 1e-8 * size[0]) :].T
    values, vectors = np.linalg.eigh(along.T @ whole @ along)
    basis = along @ vectors
    total, directions = np.linalg.eigh(along.T @ (whole + bend) @ along)
    falls = total[:1] < -SADDLE * price.unit
    downhill = along @ directions[:, :1] @ falls
    bend += (basis * np.maximum(values, 0.0)) @ basis.T
    return bend, downhill


def _program(
    near: Local,
    excess: Array,
    bend: Array,
    radius: float,
    *,
    time: Array,
    price: Prices,
    chosen: NDArray[np.bool_],
) -> tuple[Array, Array] | None:
    """The best move within `radius`, and the price of each limit; None where none was found.

    Few limits act: those that a solution without them breaks are put in, and it is solved again. `chosen` are
    those to begin with, and is brought up to date.
    """
    n = len(time)
    linear = time + 2.0 * price.effort / len(near.efforts) * (near.effort_slope.T @ near.efforts)
    quadratic = sparse.csc_matrix(np.triu(np.pad(bend, (0, 1))))
    cost = np.append(linear, price.excess)
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
    prices = np.zeros(len(excess))
    prices[rows] = np.array(answer.z)[: len(rows)]
    return move[:n], np.where(prices > PRICED, prices, 0.0)

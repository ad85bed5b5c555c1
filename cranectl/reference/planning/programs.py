"""Sequential convex programs: limits linearised, the duration made less step by step within a trust region.

Each step solves a quadratic program by Clarabel: the duration, a small price on the mean square of what the
drives do (else axes that do not decide the duration wander), and the bend of the limits that act, where it is
convex along them. An excess over a limit costs, so that a step is always possible. After arXiv 2205.00754; a
solver's status is believed, not its numbers.
"""

from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from cranectl.reference.planning.problem import Linearised, Problem
from cranectl.support.arrays import Array

EFFORT = 1e-2  # price of the mean square of the drives' shares of their limits, in durations
PRICES = 0.35, 1.5, 6.0  # price of the largest excess in parts of its limit, in durations
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.05, 1.0, 1e-6  # of the trust region, in sizes of the unknowns
MOST_STEPS = 80
GOOD_ENOUGH = 2e-5  # gain of a step, in durations, that is not worth another
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
        found = _descend(problem, x, sizes, Prices(EFFORT * unit, penalty * unit))._replace(price=penalty)
        x, steps = found.x, steps + found.steps
        if found.solved:
            break
    assert found is not None
    return found._replace(steps=steps)


def _descend(problem: Problem, x: Array, sizes: Array, price: Prices) -> Solution:
    radius, at = FIRST_STEP, problem.width
    near, prices = problem.linearised(x), np.zeros(0)
    value = _merit(near, x[at], price)
    enough = GOOD_ENOUGH * float(x[at])
    step = 0
    for step in range(1, MOST_STEPS + 1):
        bend = _bend(problem, x, near, prices, sizes, price)
        found = _program(near, near.excess.value, bend, sizes, radius, at, price)
        if found is None:
            return Solution(x, float(near.excess.value.max()), step, False)
        move, new_prices = found
        gain = value - _model(near, move, bend, sizes, x[at], at, price)
        if gain < enough:
            break
        new = problem.linearised(x + move)
        reached = _merit(new, (x + move)[at], price)
        if reached > value - 0.7 * gain:
            # The same slopes with the excess that the step has: a correction of second order.
            left = new.excess.value - near.excess.slope @ move
            corrected = _program(near, left, bend, sizes, radius, at, price)
            if corrected is not None:
                other = problem.linearised(x + corrected[0])
                if (merit := _merit(other, (x + corrected[0])[at], price)) < reached:
                    move, new, reached = corrected[0], other, merit
        ratio = (value - reached) / gain
        prices = new_prices
        if ratio > 0.1:
            x, near, value = x + move, new, reached
        if ratio < 0.3:
            radius = 0.4 * min(radius, float(np.abs(move / sizes).max()))
        elif ratio > 0.7:
            radius = min(2.0 * radius, LONGEST_STEP)
        if radius < SHORTEST_STEP:
            break
    excess = float(near.excess.value.max())
    return Solution(x, excess, step, excess < FEASIBLE)


def _merit(near: Linearised, duration: float, price: Prices) -> float:
    excess = max(0.0, float(near.excess.value.max()))
    return float(duration + price.effort * np.mean(near.efforts.value**2) + price.excess * excess)


def _model(
    near: Linearised, move: Array, bend: Array, sizes: Array, duration: float, at: int, price: Prices
) -> float:
    """What the program takes the merit after `move` for."""
    small = move / sizes
    slope = 2.0 * near.efforts.value @ (near.efforts.slope @ move) / len(near.efforts.value)
    mean = np.mean(near.efforts.value**2) + slope
    excess = max(0.0, float((near.excess.value + near.excess.slope @ move).max()))
    bent = 0.5 * small @ bend @ small
    return float(duration + move[at] + price.effort * mean + price.excess * excess + bent)


def _bend(problem: Problem, x: Array, near: Linearised, prices: Array, sizes: Array, price: Prices) -> Array:
    """Second derivative of the priced efforts, and of the limits that act along them where it is convex."""
    slope = near.efforts.slope * sizes
    bend: Array = 2.0 * price.effort / len(slope) * slope.T @ slope
    if not prices.any():
        return bend
    whole = problem.curvature(x, prices) * np.outer(sizes, sizes)
    _, size, directions = np.linalg.svd(near.excess.slope[prices > 0.0] * sizes)
    along = directions[np.count_nonzero(size > 1e-8 * size[0]) :].T
    values, vectors = np.linalg.eigh(along.T @ whole @ along)
    basis = along @ vectors
    bend += (basis * np.maximum(values, 0.0)) @ basis.T
    return bend


def _program(
    near: Linearised, excess: Array, bend: Array, sizes: Array, radius: float, at: int, price: Prices
) -> tuple[Array, Array] | None:
    """The best move within `radius` times `sizes`, and the price of each limit; None where none was found.

    Few limits act: those that a solution without them breaks are put in, and it is solved again.
    """
    n = len(sizes)
    slope = near.excess.slope * sizes
    linear = 2.0 * price.effort / len(near.efforts.value) * (near.efforts.slope.T @ near.efforts.value)
    linear[at] += 1.0
    quadratic = sparse.csc_matrix(np.triu(np.pad(bend, (0, 1))))
    cost = np.append(linear * sizes, price.excess)
    box = np.vstack([np.eye(n + 1)[:n], -np.eye(n + 1)])
    bounds = np.append(np.full(2 * n, radius), 0.0)
    reach = excess + radius * np.abs(slope).sum(axis=1)
    chosen = np.zeros(len(excess), dtype=bool)
    chosen[np.argsort(-excess)[: 3 * n]] = True
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    while True:
        limits = np.hstack([slope[chosen], np.full((np.count_nonzero(chosen), 1), -1.0)])
        matrix = sparse.csc_matrix(np.vstack([limits, box]))
        right = np.concatenate([-excess[chosen], bounds])
        cones = [clarabel.NonnegativeConeT(len(right))]
        answer = clarabel.DefaultSolver(quadratic, cost, matrix, right, cones, settings).solve()
        if answer.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
            return None
        move = np.array(answer.x)
        left = np.where(chosen | (reach < 0.0), -np.inf, excess + slope @ move[:n] - move[n])
        if left.max() < 1e-7:
            break
        chosen[np.argsort(-left)[: min(2 * n, int(np.count_nonzero(left > 0.0)))]] = True
    prices = np.zeros(len(excess))
    prices[chosen] = np.array(answer.z)[: np.count_nonzero(chosen)]
    return sizes * move[:n], np.where(prices > PRICED, prices, 0.0)

"""An independent solver for the planner's problems: IPOPT through CasADi, with exact derivatives.

It finds the durations of `programs` to 1e-4, in six times the time.
"""

from typing import Any

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline

from cranectl.planning.problem import ORDERS, Problem, SampleGroup
from cranectl.planning.programs import EFFORT_WEIGHT, FEASIBILITY_TOLERANCE, Solution
from cranectl.support.arrays import Array

# Only Solve_Succeeded counts. An adaptive barrier takes a fifth of the steps of a monotone one.
OPTIONS = {"print_level": 0, "sb": "yes", "tol": 1e-7, "max_iter": 500, "acceptable_iter": 0}
OPTIONS |= {"mu_strategy": "adaptive"}
SHORTEST, LONGEST = (
    0.05,
    20.0,
)  # bounds of the duration, as shares of the first one; limits hold below zero too


def solve(problem: Problem, x: Array, sizes: Array, penalty: float = 0.0) -> Solution:
    """Solve as `programs.solve` does, with hard limits; return `penalty` unchanged."""
    at, unit = problem.width, problem.duration(x)
    scaled = ca.MX.sym("x", len(x))
    unknowns = x + sizes * scaled
    rows, equal = [], []
    efforts: Any = None
    for group in problem.groups:
        jets = _jets(problem, group, unknowns)
        limits, effort, fixed = _rows(problem, group)
        rows.append(ca.vec(limits.map(len(group.fractions))(jets)))
        equal.append(np.tile(fixed, len(group.fractions)))
        efforts = effort.map(len(group.fractions))(jets) if efforts is None else efforts
    order, slope = problem.order_excesses(x)
    rows.append(order + ca.DM(slope * sizes) @ scaled)
    equal.append(np.zeros(len(order), dtype=bool))
    cost = unknowns[at] / unit + EFFORT_WEIGHT * ca.sumsqr(efforts) / efforts.numel()
    low, high = (np.full(len(x), bound) for bound in (-np.inf, np.inf))
    low[at], high[at] = ((part - 1.0) * unit / sizes[at] for part in (SHORTEST, LONGEST))
    solver = ca.nlpsol(
        "solver",
        "ipopt",
        {"x": scaled, "f": cost, "g": ca.vertcat(*rows)},
        {"expand": False, "print_time": False, "error_on_fail": False, "ipopt": OPTIONS},
    )
    lowest = np.where(np.concatenate(equal), 0.0, -np.inf)
    result = solver(x0=np.zeros(len(x)), lbx=low, ubx=high, lbg=lowest, ubg=0.0)
    solution = x + sizes * result["x"].full().ravel()
    excess = float(problem.linearise(solution).excess.max())
    solved = solver.stats()["return_status"] == "Solve_Succeeded" and excess < FEASIBILITY_TOLERANCE
    return Solution(solution, solved, penalty)


def _rows(problem: Problem, group: SampleGroup) -> tuple[Any, Any, Array]:
    """Return limits (at most zero) and efforts by the jet at a sample, and which limits are equations."""
    jet = ca.SX.sym("jet", ORDERS * len(problem.task.start))
    limits, efforts, fixed = [], [], []
    for bounded in group.bounded(problem.series_of(ca.vertsplit(jet))):
        constraint = bounded.constraint
        value = constraint.series[0] * (bounded.sign / constraint.scale)
        if bounded.bound is None:
            efforts.append(value)
            continue
        equal = constraint.low == constraint.high
        if not equal or bounded.sign > 0.0:  # one equation replaces two inequalities without interior
            limits.append(value - bounded.bound * bounded.sign / constraint.scale)
            fixed.append(equal)
    return (
        ca.Function("limits", [jet], [ca.vertcat(*limits)]),
        ca.Function("efforts", [jet], [ca.vertcat(*efforts)]),
        np.array(fixed),
    )


def _jets(problem: Problem, group: SampleGroup, unknowns: Any) -> Any:
    """Return derivatives of the coordinates in time at the samples, (ORDERS * d, N)."""
    d, at = len(problem.task.start), problem.width
    free, duration = ca.reshape(unknowns[:at], d, at // d), unknowns[at]
    ends = [np.tile(end[:, None], (1, problem.free.start)) for end in (problem.task.start, problem.task.end)]
    coefficients = ca.horzcat(ends[0], free, ends[1])  # (d, spans + degree)
    if group.by_instant.any():
        fractions = group.fractions + ca.DM(group.by_instant) @ unknowns[at + 1 :]
        fractions = ca.fmin(ca.fmax(fractions, 0.0), 1.0).T
        shapes = [coefficients @ _basis(curve, len(group.fractions))(fractions) for curve in problem.curves]
    else:
        basis = problem.basis(group.fractions)
        shapes = [coefficients @ ca.sparsify(ca.DM(basis[:, order].T)) for order in range(ORDERS)]
    return ca.vertcat(*(shape / duration**order for order, shape in enumerate(shapes)))


def _basis(curve: BSpline, count: int) -> Any:
    """Return a function from `count` fractions (1, count) to a derivative of the basis (n, count).

    CasADi's splines with symbolic coefficients cannot be differentiated by them, so these are fixed.
    """
    size = len(curve.t) - curve.k - 1
    part = ca.MX.sym("part")
    value = ca.bspline(
        part, ca.DM(curve.c[:size].ravel()), [curve.t.tolist()], [curve.k], curve.c.shape[1], {}
    )
    return ca.Function("basis", [part], [value]).map(count)

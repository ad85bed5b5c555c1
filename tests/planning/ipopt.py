"""An oracle of the planner: IPOPT through CasADi, with exact derivatives and no line in common.

It finds the durations that `programs` does, to 1e-4, in six times its time.
"""

from typing import Any

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline

from cranectl.planning.problem import ORDERS, Problem, Sampled
from cranectl.planning.programs import EFFORT_WEIGHT, FEASIBLE, Solution
from cranectl.support.arrays import Array

# Only Solve_Succeeded is success. An adaptive barrier takes a fifth of the steps of a monotone one.
OPTIONS = {"print_level": 0, "sb": "yes", "tol": 1e-7, "max_iter": 500, "acceptable_iter": 0}
OPTIONS |= {"mu_strategy": "adaptive"}
SHORTEST, LONGEST = 0.05, 20.0  # of the first duration: below zero limits would hold again


def solve(problem: Problem, x: Array, sizes: Array, penalty: float = 0.0) -> Solution:
    """Solve as `programs.solve` does; limits are not weighted, so return `penalty` as it is."""
    at, unit = problem.width, problem.duration(x)
    scaled = ca.MX.sym("x", len(x))
    unknowns = x + sizes * scaled
    rows, equal = [], []
    efforts: Any = None
    for group in problem.groups:
        jets = _jets(problem, group, unknowns)
        limits, effort, fixed = _rows(problem, group)
        rows.append(ca.vec(limits.map(len(group.parts))(jets)))
        equal.append(np.tile(fixed, len(group.parts)))
        efforts = effort.map(len(group.parts))(jets) if efforts is None else efforts
    order, slope = problem.in_order(x)
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
    answer = solver(x0=np.zeros(len(x)), lbx=low, ubx=high, lbg=lowest, ubg=0.0)
    told = solver.stats()
    found = x + sizes * answer["x"].full().ravel()
    excess = float(problem.linearised(found).excess.max())
    solved = told["return_status"] == "Solve_Succeeded" and excess < FEASIBLE
    return Solution(found, solved, penalty)


def _rows(problem: Problem, group: Sampled) -> tuple[Any, Any, Array]:
    """Of the jet at a sample: what is at most zero, the efforts; which of the former are to be zero."""
    jet = ca.SX.sym("jet", ORDERS * len(problem.task.start))
    limits, efforts, fixed = [], [], []
    for each in group.bounded(problem.series_of(ca.vertsplit(jet))):
        value = each.constraint.series[0] * (each.sign / each.constraint.scale)
        if each.bound is None:
            efforts.append(value)
            continue
        equal = each.constraint.low == each.constraint.high
        if not equal or each.sign > 0.0:  # one equation in place of two inequalities, which have no inside
            limits.append(value - each.bound * each.sign / each.constraint.scale)
            fixed.append(equal)
    return (
        ca.Function("limits", [jet], [ca.vertcat(*limits)]),
        ca.Function("efforts", [jet], [ca.vertcat(*efforts)]),
        np.array(fixed),
    )


def _jets(problem: Problem, group: Sampled, unknowns: Any) -> Any:
    """Derivatives of the coordinates in time at the samples, (ORDERS * d, N)."""
    d, at = len(problem.task.start), problem.width
    free, duration = ca.reshape(unknowns[:at], d, at // d), unknowns[at]
    ends = [np.tile(end[:, None], (1, problem.free.start)) for end in (problem.task.start, problem.task.end)]
    coefficients = ca.horzcat(ends[0], free, ends[1])  # (d, spans + degree)
    if group.by_instant.any():
        parts = group.parts + ca.DM(group.by_instant) @ unknowns[at + 1 :]
        parts = ca.fmin(ca.fmax(parts, 0.0), 1.0).T
        shapes = [coefficients @ _basis(curve, len(group.parts))(parts) for curve in problem.curves]
    else:
        basis = problem.basis(group.parts)
        shapes = [coefficients @ ca.sparsify(ca.DM(basis[:, order].T)) for order in range(ORDERS)]
    return ca.vertcat(*(shape / duration**order for order, shape in enumerate(shapes)))


def _basis(curve: BSpline, count: int) -> Any:
    """One derivative of the basis functions at so many parts of the duration, (1, count) to (n, count).

    CasADi's splines with symbolic coefficients lack derivatives by them: these have fixed ones.
    """
    size = len(curve.t) - curve.k - 1
    part = ca.MX.sym("part")
    value = ca.bspline(
        part, ca.DM(curve.c[:size].ravel()), [curve.t.tolist()], [curve.k], curve.c.shape[1], {}
    )
    return ca.Function("basis", [part], [value]).map(count)

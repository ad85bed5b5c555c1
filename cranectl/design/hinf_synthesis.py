"""H-infinity synthesis for a generalised plant: by SLICOT's SB10AD, or by one Riccati equation.

SLICOT is called through ctrlsys (BSD-3). The norm of the closed loop is computed again here as a check.

The Riccati equation can be used if the state follows from the measurement. With a stable plant, stable
weights and a measurement that contains the disturbance itself, a copy of the plant reconstructs the whole
state. Output feedback then reaches the same norm as feedback of state and disturbance. The computation uses
balanced coordinates, so it stays accurate if weights are many decades apart.

Doyle, Glover, Khargonekar, Francis: State-space solutions to standard H2 and H-infinity control problems,
IEEE TAC 34 (1989) 831, problems of full information and of disturbance feedforward.
"""

import math
from typing import NamedTuple

import control
import ctrlsys
import numpy as np
from scipy.linalg import LinAlgError, schur

from cranectl.design.linear_systems import HinfController, balanced, closed_loop_norm, ill_conditioned
from cranectl.support import Array, InputError, Quantity

GAMMA_ROUNDING = 1e-5  # largest relative error of gamma by SB10AD's bisection; five digits are printed
BISECTION = 1e-9  # relative width at which the bisection for the smallest gamma ends
SEMIDEFINITE = 1e-12  # rounding of eigenvalues of scale 1 that must not be negative
AGREEMENT = 1e-5  # relative difference of gamma in two sets of coordinates; five digits are printed


def hinf_controller(
    generalised: control.StateSpace,
    controls: int,
    measurements: int,
    *,
    name: str,
    back_off: float = 1.0,
    gamma: float | None = None,
) -> HinfController:
    """Design u = K y with a norm from w to z below `gamma`, by default `back_off` >= 1 times the smallest.

    `generalised` maps (w, u) to (z, y). `controls` and `measurements` are the numbers of inputs u and outputs
    y, and `name` is the problem's name in errors. Raises InputError if no controller exists.
    """
    gamma_opt = _smallest_gamma(generalised, controls, measurements, name)
    target = design_gamma(gamma_opt, back_off, gamma, name)
    controller, target = _synthesise(generalised, controls, measurements, name, job=4, gamma=target)
    return checked_controller(controller, gamma_opt, closed_loop_norm(generalised, controller), target, name)


def design_gamma(smallest: float, back_off: float, gamma: float | None, name: str) -> float:
    """Return the gamma to design for; raise InputError for a `gamma` below the smallest."""
    if gamma is not None and gamma < smallest:
        least = Quantity(smallest).at_least(6)
        raise InputError(
            f"{name} with gamma = {gamma:g}",
            allowed=f"gamma of at least {least}, the smallest that these weights allow",
            remedy="raise gamma, or leave it out and set back_off",
        )
    return rounded_up(back_off * smallest) if gamma is None else gamma


def rounded_up(gamma: float) -> float:
    """Round up to five digits, which have no rounding errors, so that all processors design for the same."""
    unit = 10.0 ** (math.floor(math.log10(gamma)) - 4)
    return math.ceil(gamma / unit) * unit


def checked_controller(
    controller: control.StateSpace, smallest: float, achieved: float, target: float, name: str
) -> HinfController:
    """Return the design; raise InputError unless its norm lies between the smallest and the target.

    If the norm is smaller than `smallest` by rounding, it replaces that.
    """
    if not smallest * (1.0 - GAMMA_ROUNDING) <= achieved <= target * (1.0 + 1e-4):
        raise ill_conditioned(name)
    return HinfController(controller, min(smallest, achieved), achieved)


_INFEASIBLE = {
    1: "the input cannot be regularised: the control weight vanishes at infinite frequency",
    2: "the measurement cannot be regularised: the error does not see the reference",
    3: "singular value decomposition failed",
    4: "singular value decomposition failed",
    5: "the singular value of the feed-through exceeds gamma",
    6: "the first Riccati equation has no stabilising solution at this gamma",
    7: "the second Riccati equation has no stabilising solution at this gamma",
    8: "the spectral radius condition fails at this gamma",
    9: "the estimator gain is singular",
    10: "a matrix of the controller is singular",
    11: "a matrix of the controller is singular",
    12: "no gamma gives a stabilising controller",
}


def _smallest_gamma(generalised: control.StateSpace, controls: int, measurements: int, name: str) -> float:
    """Return the smallest gamma; the bisection starts at one with a controller, found by trial."""
    errors = []
    for start in (1.0, 1e2, 1e4, 1e6):
        try:
            return _synthesise(generalised, controls, measurements, name, job=1, gamma=start)[1]
        except InputError as error:
            errors.append(error)
    raise errors[0]


def _synthesise(
    generalised: control.StateSpace, controls: int, measurements: int, name: str, *, job: int, gamma: float
) -> tuple[control.StateSpace, float]:
    """Call SB10AD; `job` 1 bisects for the smallest gamma, from above, and 4 takes the given gamma."""
    matrices = (np.asfortranarray(x) for x in (generalised.A, generalised.B, generalised.C, generalised.D))
    sizes = (generalised.nstates, generalised.ninputs, generalised.noutputs, controls, measurements)
    # The last two: the tolerance of gamma, and the largest real part of a stable pole.
    *_, info = solution = ctrlsys.sb10ad(job, *sizes, *matrices, gamma, 1e-8, 0.0)
    if info != 0:
        raise InputError(
            f"no {name} controller for gamma = {gamma:.6g}: {_INFEASIBLE.get(info, f'SB10AD info {info}')}",
            allowed="weights that some stabilising controller meets",
            remedy="lower the demanded bandwidth or the control weight, or increase back_off",
        )
    return control.ss(*solution[:4]), float(solution[8])


class FullInformation(NamedTuple):
    """The problem from (w, u) to z in balanced coordinates, with D12 orthonormal and y = C2 x + w."""

    a: Array
    b_1: Array  # of the disturbance w
    b_2: Array  # of the control u
    c_1: Array
    d_11: Array
    d_12: Array
    c_2: Array
    control_scale: Array  # (m, m), from the user's control to the scaled one

    def system(self) -> control.StateSpace:
        """Return the problem as a system from (w, u) to (z, y)."""
        measured = np.hstack([np.eye(len(self.c_2)), np.zeros((len(self.c_2), self.b_2.shape[1]))])
        return control.ss(
            self.a,
            np.hstack([self.b_1, self.b_2]),
            np.vstack([self.c_1, self.c_2]),
            np.vstack([np.hstack([self.d_11, self.d_12]), measured]),
        )


def full_information(generalised: control.StateSpace, controls: int, measurements: int) -> FullInformation:
    """Split and balance a stable system from (w, u) to (z, y), with y = C2 x + w and D11' D12 = 0."""
    w, z = generalised.ninputs - controls, generalised.noutputs - measurements
    d_12, scale = np.linalg.qr(generalised.D[:z, w:])
    b = np.hstack([generalised.B[:, :w], np.linalg.solve(scale.T, generalised.B[:, w:].T).T])
    a, b, c = balanced(generalised.A, b, generalised.C)
    return FullInformation(
        a, b[:, :w], b[:, w:], c[:z], generalised.D[:z, :w], d_12, c[z:], control_scale=scale
    )


def smallest_gamma(problem: FullInformation, highest: float) -> float:
    """Find the smallest norm from w to z that a stabilising controller reaches, at most about `highest`.

    It is computed twice, in coordinates that differ by a reflection. Raises InputError if rounding leaves
    less than five digits of it.
    """
    first, other = (_bisect(candidate, highest) for candidate in (problem, _reflected(problem)))
    if not abs(other - first) <= AGREEMENT * first:
        raise ill_conditioned("S/KS")
    return first


def _bisect(problem: FullInformation, highest: float) -> float:
    """Find the smallest feasible gamma; NaN if not even `highest` passes the test."""
    low, high = 1e-12 * highest, highest * (1.0 + BISECTION)
    if not _is_feasible(problem, high):
        return np.nan
    while high / low > 1.0 + BISECTION:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if _is_feasible(problem, middle) else (middle, high)
    return high


def _reflected(problem: FullInformation) -> FullInformation:
    """Return the same problem with its states reflected, so that each new state mixes all of them."""
    n = len(problem.a)
    mirror = np.eye(n) - 2.0 / max(n, 1)  # along (1, …, 1); it is its own inverse
    return problem._replace(
        a=mirror @ problem.a @ mirror,
        b_1=mirror @ problem.b_1,
        b_2=mirror @ problem.b_2,
        c_1=problem.c_1 @ mirror,
        c_2=problem.c_2 @ mirror,
    )


def central_controller(problem: FullInformation, gamma: float) -> control.StateSpace:
    """Return the central controller from y to the scaled u for `gamma` above the smallest.

    It is a copy of the problem with state feedback, in which y - C2 x replaces the disturbance.
    """
    lower, upper, r = _stable_subspace(problem, gamma)
    x = np.linalg.solve(lower.T, upper.T)
    b = np.hstack([problem.b_1, problem.b_2])
    d = np.hstack([problem.d_11, problem.d_12])
    gain = -np.linalg.solve(r, b.T @ (x + x.T) / 2.0 + d.T @ problem.c_1)[problem.b_1.shape[1] :]
    a = problem.a + problem.b_2 @ gain - problem.b_1 @ problem.c_2
    return control.ss(a, problem.b_1, gain, np.zeros((len(gain), problem.b_1.shape[1])))


def in_own_units(problem: FullInformation, controller: control.StateSpace) -> control.StateSpace:
    """Return `controller` with its output u in the unscaled units of the user's weights."""
    c, d = (np.linalg.solve(problem.control_scale, x) for x in (controller.C, controller.D))
    return control.ss(controller.A, controller.B, c, d)


def _is_feasible(problem: FullInformation, gamma: float) -> bool:
    """Return True if the Riccati equation has a stabilising solution X >= 0 for `gamma`."""
    # With the stable subspace [U; V], X is V U⁻¹, and the eigenvalues of U'V have the same signs as those of
    # X. At the smallest gamma X may grow without bound, but U'V stays bounded.
    projected = problem.d_11 - problem.d_12 @ (problem.d_12.T @ problem.d_11)
    if gamma <= np.linalg.norm(projected, 2):
        return False
    try:
        lower, upper, _ = _stable_subspace(problem, gamma)
    except LinAlgError:  # eigenvalues on the imaginary axis
        return False
    product = lower.T @ upper
    return bool(np.linalg.eigvalsh(product + product.T)[0] > -2.0 * SEMIDEFINITE)


def _stable_subspace(problem: FullInformation, gamma: float) -> tuple[Array, Array, Array]:
    """Return the halves of the Hamiltonian's stable subspace, and R; raise LinAlgError if there is none."""
    b, d = np.hstack([problem.b_1, problem.b_2]), np.hstack([problem.d_11, problem.d_12])
    n, w = problem.b_1.shape
    r, s = d.T @ d, d.T @ problem.c_1
    r[:w, :w] -= gamma**2 * np.eye(w)
    a = problem.a - b @ np.linalg.solve(r, s)
    hamiltonian = np.block(
        [
            [a, -b @ np.linalg.solve(r, b.T)],
            [s.T @ np.linalg.solve(r, s) - problem.c_1.T @ problem.c_1, -a.T],
        ]
    )
    _, basis, stable = schur(hamiltonian, sort="lhp")
    if stable != n:
        raise LinAlgError("eigenvalues on the imaginary axis")
    return basis[:n, :n], basis[n:, :n], r

"""H-infinity synthesis where the state follows from the measurement, by one Riccati equation.

With a stable plant, stable weights and a measurement that shows the disturbance itself, a copy of the plant
reconstructs the whole state. Output feedback then reaches the same norm as feedback of state and disturbance.
The computation uses balanced coordinates, so it stays accurate where weights are many decades apart.

Doyle, Glover, Khargonekar, Francis: State-space solutions to standard H2 and H-infinity control problems,
IEEE TAC 34 (1989) 831, problems of full information and of disturbance feedforward.
"""

from typing import NamedTuple

import control
import numpy as np
from scipy.linalg import LinAlgError, schur

from cranectl.design.linear_systems import balanced, ill_conditioned
from cranectl.support.arrays import Array

BISECTION = 1e-9  # relative width at which the bisection for the smallest gamma ends
SEMIDEFINITE = 1e-12  # rounding of the eigenvalues that must not be negative; their scale is 1
AGREEMENT = 1e-5  # relative difference of gamma in two sets of coordinates; five digits are printed


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
    """Split and balance `generalised`, from (w, u) to (z, y) with y = C2 x + w and D11' D12 = 0.

    Parameters
    ----------
    generalised
        Stable system; without the disturbance's path to y it must stay stable.
    controls, measurements
        Numbers of inputs u and of outputs y.

    """
    w, z = generalised.ninputs - controls, generalised.noutputs - measurements
    d_12, scale = np.linalg.qr(generalised.D[:z, w:])
    b = np.hstack([generalised.B[:, :w], np.linalg.solve(scale.T, generalised.B[:, w:].T).T])
    a, b, c = balanced(generalised.A, b, generalised.C)
    return FullInformation(
        a, b[:, :w], b[:, w:], c[:z], generalised.D[:z, :w], d_12, c[z:], control_scale=scale
    )


def smallest_gamma(problem: FullInformation, highest: float) -> float:
    """Find the smallest norm from w to z that a stabilising controller reaches.

    The computation is done twice, in coordinates that differ by a reflection. Where rounding matters, the two
    results differ.

    Parameters
    ----------
    problem
        As `full_information` gives it.
    highest
        A norm that some controller is known to reach.

    Raises
    ------
    InputError
        If rounding leaves less than five digits of the result.

    """
    found, other = (_bisect(each, highest) for each in (problem, _reflected(problem)))
    if not abs(other - found) <= AGREEMENT * found:
        raise ill_conditioned("S/KS")
    return found


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
    mirror = np.eye(n) - 2.0 / max(n, 1)
    return problem._replace(
        a=mirror @ problem.a @ mirror,
        b_1=mirror @ problem.b_1,
        b_2=mirror @ problem.b_2,
        c_1=problem.c_1 @ mirror,
        c_2=problem.c_2 @ mirror,
    )


def central_controller(problem: FullInformation, gamma: float) -> control.StateSpace:
    """Return the central controller from y to the scaled u for `gamma` above the smallest.

    It is a copy of the problem with state feedback, in which y - C2 x stands for the disturbance.
    """
    lower, upper, r = _stable_subspace(problem, gamma)
    x = np.linalg.solve(lower.T, upper.T)
    b = np.hstack([problem.b_1, problem.b_2])
    d = np.hstack([problem.d_11, problem.d_12])
    gain = -np.linalg.solve(r, b.T @ (x + x.T) / 2.0 + d.T @ problem.c_1)[problem.b_1.shape[1] :]
    a = problem.a + problem.b_2 @ gain - problem.b_1 @ problem.c_2
    return control.ss(a, problem.b_1, gain, np.zeros((len(gain), problem.b_1.shape[1])))


def in_own_units(problem: FullInformation, controller: control.StateSpace) -> control.StateSpace:
    """Return `controller` with the control as the user's weights have it, not scaled."""
    c, d = (np.linalg.solve(problem.control_scale, x) for x in (controller.C, controller.D))
    return control.ss(controller.A, controller.B, c, d)


def _is_feasible(problem: FullInformation, gamma: float) -> bool:
    """Return True if the Riccati equation has a stabilising solution X >= 0 for `gamma`.

    With the stable subspace [U; V] X is V U⁻¹, and U'V has the signs of its eigenvalues. It stays bounded
    where X grows without bound, which is what ends the range of gamma.
    """
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
    """Return the halves of the Hamiltonian's stable subspace, and R; raises LinAlgError without one."""
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

"""Check the errata of chapter 4: references, feedback, robustification."""

from collections.abc import Callable

import control
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are

from cranectl.design import design_controller
from cranectl.design.linear_systems import inner_loop
from cranectl.design.loop_shaping import glover_mcfarlane
from cranectl.design.mixed_sensitivity import generalised_plant
from cranectl.reference import TimeLaw
from validation.thesis.errata.registry import erratum, excess_over, max_difference, shaped_plant


@erratum("4.3")
def quintic_is_not_smooth_enough() -> tuple[float, float]:
    """Check (4.3): section 3.6 needs z_d in C^4, but the quintic's z''' jumps.

    Its jump at rest is 60 (theta_f - theta_0)/t_f³.
    """
    ends = np.array([0.0, 1.0])
    jumps = {law: np.abs(TimeLaw(law).sample(ends)[1:]).max() for law in ("degree-5", "degree-9")}
    assert abs(TimeLaw("degree-5").sample(ends)[3] - 60.0).max() < 1e-9
    return float(jumps["degree-5"]), float(jumps["degree-9"])


@erratum("4.5")
def quintic_coefficients() -> tuple[float, float]:
    """Check (4.5): the quintic between unequal accelerations must satisfy the six conditions (4.4)."""
    p0, pf, v0, vf, a0, af, t = 0.2, 1.1, 0.3, -0.2, 0.5, -0.4, 1.7
    right = [
        (20 * pf - 20 * p0 - (8 * vf + 12 * v0) * t - (3 * a0 - af) * t**2) / (2 * t**3),
        (30 * p0 - 30 * pf + (14 * vf + 16 * v0) * t + (3 * a0 - 2 * af) * t**2) / (2 * t**4),
        (12 * pf - 12 * p0 - (6 * vf + 6 * v0) * t - (a0 - af) * t**2) / (2 * t**5),
    ]
    printed = [
        (20 * vf - 20 * v0 - (8 * af + 12 * a0) * t - (3 * af - a0) * t**2) / (2 * t**3),
        (30 * p0 - 30 * pf + (14 * vf + 16 * v0) * t + (3 * af - 2 * a0) * t**2) / (2 * t**4),
        (12 * pf - 12 * p0 - (6 * vf + 6 * v0) * t - (af - a0) * t**2) / (2 * t**5),
    ]

    def error(coefficients: list[float]) -> float:
        polynomial = np.polynomial.Polynomial([p0, v0, a0 / 2, *coefficients])
        ends = [derivative(t) for derivative in (polynomial, polynomial.deriv(), polynomial.deriv(2))]
        return max_difference(ends, [pf, vf, af])

    # Each printed coefficient alone spoils the quintic.
    alone = [error([*right[:i], printed[i], *right[i + 1 :]]) for i in range(3)]
    return min(alone), error(right)


@erratum("4.6, 4.9, 4.17")
def error_sign() -> tuple[float, float]:
    """Check the sign of (4.6, 4.9, 4.17): v = K e for e = z_d - z as in (3.47); v = -K e is unstable."""
    gain = design_controller("lqr").gain
    chain, b = np.diag(np.ones(3), 1), np.eye(4)[:, 3:]
    # e' = A e - B v, since e is reference minus output.
    unstable = np.linalg.eigvals(chain + b @ gain.reshape(1, 4)).real.max()
    stable = np.linalg.eigvals(chain - b @ gain.reshape(1, 4)).real.max()
    return max(unstable, 0.0), max(stable, 0.0)


@erratum("4.7")
def three_chains() -> tuple[float, float]:
    """Check (4.7): A is printed as 11 x 11 beside a B of 12 rows; three chains of four have 12 states."""
    links = [(0, 1), (1, 2), (2, 3), (4, 5), (5, 6), (6, 7), (7, 9), (8, 10)]  # (row, column) of the ones
    printed = np.zeros((11, 11))
    for row, column in links:
        printed[row, column] = 1.0
    right, b = np.kron(np.eye(3), np.diag(np.ones(3), 1)), np.kron(np.eye(3), [[0], [0], [0], [1]])
    reach = np.hstack([np.linalg.matrix_power(right, k) @ b for k in range(4)])
    assert np.abs(np.linalg.matrix_power(printed, 4)).max() == 1.0, "one printed chain has five states"
    return float(abs(len(printed) - len(b))), float(12 - np.linalg.matrix_rank(reach))


@erratum("4.8")
def chain_matrices() -> tuple[float, float]:
    """Check (4.8): three chains of four are 12 x 12, and C selects the first state of each, z."""
    a = np.kron(np.eye(3), np.diag(np.ones(3), 1))
    right, printed = np.zeros((3, 12)), np.zeros((3, 12))
    right[[0, 1, 2], [0, 4, 8]] = 1.0
    printed[1, 3], printed[2, 6] = 1.0, 1.0
    x = np.zeros(12)
    x[[0, 4, 8]] = 1.0, 2.0, 3.0
    assert a.shape == (12, 12)
    return max_difference(printed @ x, x[[0, 4, 8]]), max_difference(right @ x, x[[0, 4, 8]])


@erratum("4.11")
def matrix_exponential() -> tuple[float, float]:
    """Check (4.11): it has s to the power of a matrix, in place of e to the power of the matrix times t."""
    a, start, t = np.array([[-1.0, 2.0], [0.0, -3.0]]), np.array([1.0, -1.0]), 0.8
    truth = control.initial_response(control.ss(a, np.zeros((2, 1)), np.eye(2), 0), [0.0, t], start).outputs[
        :, -1
    ]
    return max_difference(expm(a) @ start, truth), max_difference(expm(a * t) @ start, truth)


@erratum("4.12, 4.13")
def feedback_put_into_the_error_system() -> tuple[float, float]:
    """Check (4.12) in (4.13), which gives A + BK; the error obeys e'''' = z_d'''' - v_1."""
    k = np.asarray(design_controller("lqr").gain).reshape(1, 4)
    a, b = np.diag(np.ones(3), 1), np.eye(4)[:, 3:]
    e, desired = np.array([0.1, -0.2, 0.3, 0.4]), 0.7
    v = desired + (k @ e).item()
    printed, right = a @ e + b[:, 0] * v, a @ e + b[:, 0] * (desired - v)
    return max_difference(printed, (a - b @ k) @ e), max_difference(right, (a - b @ k) @ e)


@erratum("after 4.13")
def characteristic_polynomial() -> tuple[float, float]:
    """Check the text after (4.13): |sI - A - BK| has the poles of A + BK; (4.10) has those of A - BK."""
    gain, chain, b = (
        design_controller("pole-placement").gain.reshape(1, 4),
        np.diag(np.ones(3), 1),
        np.eye(4)[:, 3:],
    )
    expected = np.poly([-2.5] * 4)
    return max_difference(np.poly(chain + b @ gain), expected), max_difference(
        np.poly(chain - b @ gain), expected
    )


@erratum("Definition 1")
def hardy_space() -> tuple[float, float]:
    """Check Definition 1: a bound on Re s = 0 is not enough.

    e^s is analytic with |e^s| = 1 there, but it is unbounded, and a predictor.
    """
    omega = np.linspace(-50.0, 50.0, 2001)
    half_plane = (np.linspace(1e-3, 20.0, 200)[:, None] + 1j * omega).ravel()

    def excess(g: Callable[[np.ndarray], np.ndarray]) -> float:
        """Return by how much g is larger in the half-plane than on its edge, which is 0 in H-infinity."""
        return max(0.0, float(np.abs(g(half_plane)).max() - np.abs(g(1j * omega)).max()))

    assert np.abs(np.exp(1j * omega)).max() == pytest.approx(1.0)
    return excess(np.exp), excess(lambda s: (s / 5 + 0.8) / (s + 0.072))


def standard_problem() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return P, K and the true transfer from w to z at one frequency, by solving the loop's equations."""
    rng = np.random.default_rng(3)
    p = rng.normal(size=(4, 5)) + 1j * rng.normal(size=(4, 5))  # w: 3, u: 2; z: 3, v: 1
    k = rng.normal(size=(2, 1)) + 1j * rng.normal(size=(2, 1))
    columns = []
    for w in np.eye(3):
        # unknowns u (2), v (1): u - K v = 0, v - P22 u = P21 w
        system = np.block([[np.eye(2), -k], [-p[3:, 3:], np.eye(1)]])
        u = np.linalg.solve(system, np.concatenate([np.zeros(2), p[3:, :3] @ w]))[:2]
        columns.append(p[:3, :3] @ w + p[:3, 3:] @ u)
    return p, k, np.array(columns).T


@erratum("4.20")
def fractional_transformation() -> tuple[float, float]:
    """Check (4.20): the sizes in K (I - K P22)^-1 do not match; those in K (I - P22 K)^-1 do."""
    p, k, truth = standard_problem()
    size_mismatch = abs(k.shape[1] - k.shape[0])
    right = p[:3, :3] + p[:3, 3:] @ k @ np.linalg.inv(np.eye(1) - p[3:, 3:] @ k) @ p[3:, :3]
    return float(size_mismatch), float(np.abs(right - truth).max())


@erratum("4.21")
def lost_inverse() -> tuple[float, float]:
    p, k, truth = standard_problem()
    loop = np.eye(1) - p[3:, 3:] @ k
    printed = p[:3, :3] + p[:3, 3:] @ k @ loop @ p[3:, :3]
    right = p[:3, :3] + p[:3, 3:] @ k @ np.linalg.inv(loop) @ p[3:, :3]
    return float(np.abs(printed - truth).max()), float(np.abs(right - truth).max())


@erratum("4.22")
def mixed_sensitivity_plant() -> tuple[float, float]:
    """Check (4.22): without the row of W_ks nothing limits u."""
    g, k = inner_loop(np.array([4.0, 6.0, 4.0, 3.0])), control.ss([[-1.0]], [[1.0]], [[2.0]], [[0.0]])
    w_s, w_ks = control.ss([[-0.1]], [[1.0]], [[0.5]], [[0.2]]), control.ss([], [], [], [[0.3]])
    s = 0.7j
    p = generalised_plant(g, w_s, w_ks)(s)
    loop = p[:2, :1] + p[:2, 1:] * k(s) / (1 - p[2, 1] * k(s)) * p[2, 0]
    sensitivity = 1 / (1 + g(s) * k(s))
    truth = np.array([w_s(s) * sensitivity, w_ks(s) * k(s) * sensitivity])
    printed = np.array([w_s(s) * sensitivity])
    return float(abs(len(printed) - len(truth))), float(np.abs(loop.ravel() - truth).max())


@erratum("4.22 (signals)")
def signals_of_the_generalised_plant() -> tuple[float, float]:
    """Check the signals of (4.22): (z_1, z_2, v) follow from (w, u), not (z_1, z_2) from (v, u)."""
    rng = np.random.default_rng(5)
    g, k, w_s = rng.normal(size=3) + 1j * rng.normal(size=3)
    w = 1.0
    v = -w / (1 + g * k)  # the loop: v = -w - G u, u = K v
    truth = w_s * (w + g * k * v)
    assert max_difference(-w - g * k * v, v) < 1e-12, "the second printed row is v, not z_2"
    literal_first = w_s * v + w_s * g * k * v  # the printed right-hand side has v where w belongs
    literal_second = -v - g * k * v
    w_s_s = w_s / (1 + g * k)
    return min(max_difference(literal_first, truth), max_difference(literal_second, v)), max_difference(
        w_s_s * w, truth
    )


Factors = tuple[control.StateSpace, control.StateSpace]


def coprime_factors(plant: control.StateSpace) -> tuple[Factors, Factors]:
    """Return the normalised factors ((N, M) right, (N, M) left) of a plant without feed-through."""
    a, b, c = plant.A, plant.B, plant.C
    f = -b.T @ solve_continuous_are(a, b, c.T @ c, np.eye(b.shape[1]))
    h = -solve_continuous_are(a.T, c.T, b @ b.T, np.eye(c.shape[0])) @ c.T
    right = control.ss(a + b @ f, b, c, 0), control.ss(a + b @ f, b, f, np.eye(b.shape[1]))
    left = control.ss(a + h @ c, b, c, 0), control.ss(a + h @ c, h, c, np.eye(c.shape[0]))
    return right, left


def random_plant(inputs: int, outputs: int, seed: int = 6) -> control.StateSpace:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(4, 4))
    return control.ss(a, rng.normal(size=(4, inputs)), rng.normal(size=(outputs, 4)), 0)


def evaluate(system: control.StateSpace, s: complex) -> np.ndarray:
    return np.atleast_2d(system(s))


@erratum("Definition 4 (normalisation)")
def normalised_factors() -> tuple[float, float]:
    """Check Definition 4: M M~ + N N~ = I normalises a left factorisation.

    A right factorisation has M~ M + N~ N = I.
    """
    plant, s = random_plant(2, 2), 0.8j
    (n, m), (n_left, m_left) = coprime_factors(plant)
    n, m, n_left, m_left = (evaluate(x, s) for x in (n, m, n_left, m_left))
    assert max_difference(n @ np.linalg.inv(m), evaluate(plant, s)) < 1e-9
    assert max_difference(np.linalg.inv(m_left) @ n_left, evaluate(plant, s)) < 1e-9
    printed = m @ m.conj().T + n @ n.conj().T  # on the imaginary axis X^T(-s) is X^H
    right = m.conj().T @ m + n.conj().T @ n
    left = m_left @ m_left.conj().T + n_left @ n_left.conj().T
    return max_difference(printed, np.eye(2)), max(
        max_difference(right, np.eye(2)), max_difference(left, np.eye(2))
    )


@erratum("Definition 4 (sizes)")
def sizes_of_the_factors() -> tuple[float, float]:
    """Check Definition 4: N is p x q, but M is q x q in a right and p x p in a left factorisation."""
    plant = random_plant(3, 2)
    (n, m), (n_left, m_left) = coprime_factors(plant)
    printed = abs(plant.noutputs - plant.ninputs)  # a p x q matrix M has no inverse
    s = 0.8j
    errors = (
        max_difference(evaluate(n, s) @ np.linalg.inv(evaluate(m, s)), evaluate(plant, s)),
        max_difference(np.linalg.inv(evaluate(m_left, s)) @ evaluate(n_left, s), evaluate(plant, s)),
    )
    return float(printed), max(errors)


@erratum("Definition 4 (G in RH-infinity)")
def plants_with_a_factorisation() -> tuple[float, float]:
    """Check Definition 4: the thesis's shaped plant has factors, but is not in RH-infinity.

    It has a pole at 0.
    """
    shaped = shaped_plant("lqr")
    in_space = float(shaped.poles().real.max() < -1e-9)
    (n, m), _ = coprime_factors(shaped)
    assert max(n.poles().real.max(), m.poles().real.max()) < 0.0
    s = 1.1j
    return 1.0 - in_space, max_difference(n(s) / m(s), shaped(s)) + max_difference(
        abs(n(s)) ** 2 + abs(m(s)) ** 2, 1.0
    )


@erratum("4.23")
def robust_stability_criterion() -> tuple[float, float]:
    """Check (4.23): [I; K] (I - G K)^-1 M^-1 with the left factor M has norm 1/rho.

    The printed blocks contain no loop.
    """
    shaped = shaped_plant("lqr")
    design = glover_mcfarlane(shaped)
    _, (_, m) = coprime_factors(shaped)
    printed, right = [], []
    for omega in np.logspace(-4, 4, 400):
        g, k, factor = (x(1j * omega) for x in (shaped, design.controller, m))
        printed.append(max(1.0, abs(g * k)) / abs(factor))
        right.append(np.hypot(1.0, abs(k)) / abs((1.0 - g * k) * factor))
    # gamma = 1.01 gamma_min is asked for and hardly undercut
    assert design.gamma_min <= max(right) <= design.gamma * (1 + 1e-6)
    mismatch = max(printed) - design.gamma
    # Any size: M^-1 from the right is [I G] up to an isometry, which the rebuilt closed loop has.
    plant, s = random_plant(3, 2), 0.7j
    k = np.random.default_rng(8).normal(size=(3, 2))
    g, m_s = evaluate(plant, s), evaluate(coprime_factors(plant)[1][1], s)
    loop = np.vstack([np.eye(2), k]) @ np.linalg.inv(np.eye(2) - g @ k)
    norms = [np.linalg.norm(x, 2) for x in (loop @ np.linalg.inv(m_s), loop @ np.hstack([np.eye(2), g]))]
    return mismatch, abs(norms[0] - norms[1]) + excess_over(max(right), design.gamma * (1 + 1e-6))


@erratum("K = W_a K_w W_e")
def order_of_weights() -> tuple[float, float]:
    """Check K = W_a K_w W_e: for the plant W_a G W_e with K_w, the controller of G is W_e K_w W_a."""
    rng = np.random.default_rng(4)
    g, w_a, w_e, k = (rng.normal(size=shape) for shape in ((2, 3), (2, 2), (3, 3), (3, 2)))
    truth = np.linalg.eigvals(w_a @ g @ w_e @ k)
    right = np.linalg.eigvals(g @ (w_e @ k @ w_a))
    mismatch = abs(w_a.shape[1] - k.shape[0])  # W_a K_w cannot be multiplied unless G is square
    return float(mismatch), max_difference(np.sort(np.abs(right)[:2]), np.sort(np.abs(truth)))


@erratum("rho < 1")
def acceptable_margin() -> tuple[float, float]:
    """Check rho < 1: rho_max is always below 1, so this rejects every weight; the usual bound is 0.25."""
    rho = [1.0 / glover_mcfarlane(random_plant(2, 2, seed), 1.1).gamma_min for seed in range(20)]
    own = [1.0 / glover_mcfarlane(shaped_plant(feedback)).gamma_min for feedback in ("pole-placement", "lqr")]
    assert max(rho + own) < 1.0
    return 1.0 - max(own), excess_over(0.25, min(own))

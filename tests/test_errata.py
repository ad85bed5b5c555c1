"""Every erratum of docs/errata.md: the printed form fails, the corrected one passes.

`q` is (x_c, y_c, l, alpha, beta). Truth is what no equation of the thesis was used for: the Lagrangian's
manipulator form (validation/derivations/lagrange.py holds it to SymPy), MuJoCo, or plain differentiation.
"""

import re
from collections.abc import Callable

import control
import numpy as np
import pytest
from scipy.linalg import expm

from cranectl import dynamics
from cranectl.design import design_controller
from cranectl.design.linear import inner_loop
from cranectl.design.mixed_sensitivity import generalised_plant
from cranectl.flatness import state_and_input
from cranectl.parameters import RigParameters
from tests.conftest import ROOT, random_states, split

RIG = RigParameters(bridge_mass=5.0, trolley_mass=2.0, load_mass=1.7)
G = RIG.gravity
INPUT = np.array([0.4, -0.3, 0.2])
ERRATA: dict[str, Callable[[], tuple[float, float]]] = {}


def erratum(number: str) -> Callable[[Callable[[], tuple[float, float]]], Callable[[], tuple[float, float]]]:
    """Register a check that returns (error of the printed form, error of the corrected form)."""

    def register(check: Callable[[], tuple[float, float]]) -> Callable[[], tuple[float, float]]:
        ERRATA[number] = check
        return check

    return register


def apart(a: object, b: object) -> float:
    return float(np.abs(np.asarray(a, dtype=float) - np.asarray(b, dtype=float)).max())


def true_cardan_accelerations(state: np.ndarray) -> np.ndarray:
    """From the manipulator form: M22 qdd2 = -(M21 u + C qd + G)."""
    q, qd = split(state)
    m = dynamics.mass_matrix(q, RIG)
    bias = dynamics.coriolis_matrix(q, qd, RIG) @ qd + dynamics.gravity_vector(q, RIG)
    return np.linalg.solve(m[3:, 3:], -(m[3:, :3] @ INPUT + bias[3:]))


def over_states(check: Callable[[np.ndarray], tuple[float, float]]) -> tuple[float, float]:
    """Smallest error of the printed form, largest of the corrected one, over random states."""
    errors = np.array([check(state) for state in random_states(50)])
    return float(errors[:, 0].min()), float(errors[:, 1].max())


@erratum("2.12a")
def cardan_alpha() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, _, _, _, length, rate, a, ad, b, bd = state
        truth = true_cardan_accelerations(state)[0]
        rest = 2 * length * ad * bd * np.sin(b) - G * np.sin(a) - np.cos(a) * INPUT[1]
        printed = rest / (length * np.cos(b) + 2 * length)  # alpha'' on both sides, solved for it
        corrected = (rest - 2 * rate * ad * np.cos(b)) / (length * np.cos(b))
        return abs(printed - truth), abs(corrected - truth)

    return over_states(check)


@erratum("2.12b")
def cardan_beta() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, _, _, _, length, rate, a, ad, b, bd = state
        truth = true_cardan_accelerations(state)[1]
        rest = (
            -length * ad**2 * np.sin(b) * np.cos(b) - np.cos(b) * INPUT[0] + np.sin(a) * np.sin(b) * INPUT[1]
        )
        gravity = G * np.cos(a) * np.sin(b)
        printed = (gravity - 2 * length * bd + rest) / length
        corrected = (-gravity - 2 * rate * bd + rest) / length
        return abs(printed - truth), abs(corrected - truth)

    return over_states(check)


@erratum("M11")
def one_carriage_mass() -> tuple[float, float]:
    """Bridge and trolley move along x, the trolley alone along y: one m_c cannot stand for both."""
    m = dynamics.mass_matrix(split(random_states(1)[0])[0], RIG)[:2, :2]
    best = np.linalg.norm(np.diag(m) - np.diag(m).mean())
    both = np.diag([RIG.bridge_mass + RIG.trolley_mass, RIG.trolley_mass]) + RIG.load_mass * np.eye(2)
    return float(best), apart(m, both)


@erratum("M12, M21")
def inertial_coupling() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        q, _ = split(state)
        _, _, length, a, b = q
        truth = dynamics.mass_matrix(q, RIG)[3:, :3]
        m = RIG.load_mass
        printed = m * np.array([[0, np.cos(a) * np.cos(b), 0], [np.cos(b), -np.sin(a) * np.sin(b), 0]])
        return apart(printed, truth), apart(length * printed, truth)

    return over_states(check)


@erratum("G2")
def gravity_torques() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        q, _ = split(state)
        _, _, length, a, b = q
        truth = dynamics.gravity_vector(q, RIG)[3:]
        printed = RIG.load_mass * G * np.array([np.sin(a) * np.cos(b), np.cos(a) * np.sin(b)])
        return apart(printed, truth), apart(length * printed, truth)

    return over_states(check)


@erratum("C")
def coriolis_blocks() -> tuple[float, float]:
    """As printed the blocks lack l and have a row too few; C qd decides, since C itself is not unique."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd = split(state)
        length, b = q[2], q[4]
        rate, ad, bd = qd[2:]
        m = RIG.load_mass
        truth = (dynamics.coriolis_matrix(q, qd, RIG) @ qd)[3:]
        printed = np.array([2 * m * bd * rate, m * ad * np.cos(b) * np.sin(b) * ad])
        corrected = np.array(
            [
                2 * m * length * np.cos(b) ** 2 * rate * ad
                - 2 * m * length**2 * np.sin(b) * np.cos(b) * ad * bd,
                2 * m * length * rate * bd + m * length**2 * np.sin(b) * np.cos(b) * ad**2,
            ]
        )
        return apart(printed, truth), apart(corrected, truth)

    return over_states(check)


@erratum("3.15")
def input_transformation() -> tuple[float, float]:
    """y'' = a + M u with u = rho + gamma v must give y'' = v."""
    rng = np.random.default_rng(0)
    a, m, v = rng.normal(size=3), rng.normal(size=(3, 3)), rng.normal(size=3)
    rho = -np.linalg.solve(m, a)
    printed = a + m @ (rho - np.linalg.solve(m, v))
    corrected = a + m @ (rho + np.linalg.solve(m, v))
    return apart(printed, v), apart(corrected, v)


@erratum("3.25")
def load_velocity() -> tuple[float, float]:
    """Two rows where there are three: the x component is lost, so the shapes differ."""
    q, qd = split(random_states(1)[0])
    _, _, length, _, b = q
    truth = dynamics.load_jacobian(q) @ qd
    first = qd[0] + qd[2] * np.sin(b) + length * qd[4] * np.cos(b)
    return float(abs(len(truth) - 2)), abs(first - truth[0])


@erratum("3.30")
def rope_direction() -> tuple[float, float]:
    """(r_t - r_l)/|…| points from load to trolley; the vector printed beside it from trolley to load."""
    q, _ = split(random_states(1)[0])
    trolley, load = np.array([q[0], q[1], 0.0]), dynamics.load_position(q)
    n = np.array(dynamics.rope_direction(q[3], q[4]))
    return (
        apart((trolley - load) / np.linalg.norm(trolley - load), n),
        apart((load - trolley) / np.linalg.norm(load - trolley), n),
    )


@erratum("3.37a")
def rope_length() -> tuple[float, float]:
    q, _ = split(random_states(1)[0])
    z_3, cosines = dynamics.load_position(q)[2], np.cos(q[3]) * np.cos(q[4])
    return abs(z_3 / cosines - q[2]), abs(-z_3 / cosines - q[2])


@erratum("3.37, 3.38")
def state_order() -> tuple[float, float]:
    """(3.21) puts x_c first and l fifth; (3.37) calls l the first state and x_c the fifth."""
    flat = np.concatenate([[1.2, 0.7, -0.6], np.zeros(12)])
    state, inputs = np.zeros(10), np.zeros(3)
    state_and_input(flat, G, state, inputs)
    as_printed = np.array([0.6, 0.7, 1.2])  # phi_x1 = l, phi_x3 = y_c, phi_x5 = x_c
    return apart(state[[0, 2, 4]], as_printed), apart(state[[0, 2, 4]], [1.2, 0.7, 0.6])


@erratum("4.5")
def quintic_coefficients() -> tuple[float, float]:
    """From rest to rest with unequal accelerations at the ends; all six conditions of (4.4)."""
    p0, pf, v0, vf, a0, af, t = 0.2, 1.1, 0.3, -0.2, 0.5, -0.4, 1.7
    printed = [
        p0, v0, a0 / 2,
        (20 * vf - 20 * v0 - (8 * af + 12 * a0) * t - (3 * af - a0) * t**2) / (2 * t**3),
        (30 * p0 - 30 * pf + (14 * vf + 16 * v0) * t + (3 * af - 2 * a0) * t**2) / (2 * t**4),
        (12 * pf - 12 * p0 - (6 * vf + 6 * v0) * t - (a0 - af) * t**2) / (2 * t**5),
    ]  # fmt: skip
    corrected = [
        p0, v0, a0 / 2,
        (20 * pf - 20 * p0 - (8 * vf + 12 * v0) * t - (3 * a0 - af) * t**2) / (2 * t**3),
        (30 * p0 - 30 * pf + (14 * vf + 16 * v0) * t + (3 * a0 - 2 * af) * t**2) / (2 * t**4),
        (12 * pf - 12 * p0 - (6 * vf + 6 * v0) * t - (a0 - af) * t**2) / (2 * t**5),
    ]  # fmt: skip

    def error(coefficients: list[float]) -> float:
        polynomial = np.polynomial.Polynomial(coefficients)
        ends = [derivative(t) for derivative in (polynomial, polynomial.deriv(), polynomial.deriv(2))]
        return apart(ends, [pf, vf, af])

    return error(printed), error(corrected)


@erratum("4.6, 4.9, 4.17")
def error_sign() -> tuple[float, float]:
    """With (3.47), v = K e for e = z_d - z; v = -K e for this e drives the load away."""
    gain = design_controller("lqr").gain
    chain, b = np.diag(np.ones(3), 1), np.eye(4)[:, 3:]
    # e' = A e - B v, since e is reference minus output.
    unstable = np.linalg.eigvals(chain + b @ gain.reshape(1, 4)).real.max()
    stable = np.linalg.eigvals(chain - b @ gain.reshape(1, 4)).real.max()
    return max(unstable, 0.0), max(stable, 0.0)


@erratum("4.7, 4.8")
def chain_matrices() -> tuple[float, float]:
    """Three chains of four are 12 x 12, and C picks the first state of each: z, not derivatives."""
    a = np.kron(np.eye(3), np.diag(np.ones(3), 1))
    right, printed = np.zeros((3, 12)), np.zeros((3, 12))
    right[[0, 1, 2], [0, 4, 8]] = 1.0
    printed[1, 3], printed[2, 6] = 1.0, 1.0
    x = np.zeros(12)
    x[[0, 4, 8]] = 1.0, 2.0, 3.0
    assert a.shape == (12, 12)
    return apart(printed @ x, x[[0, 4, 8]]), apart(right @ x, x[[0, 4, 8]])


@erratum("4.11")
def matrix_exponential() -> tuple[float, float]:
    """s to the power of a matrix, without t, against e to the power of the matrix times t."""
    a, start, t = np.array([[-1.0, 2.0], [0.0, -3.0]]), np.array([1.0, -1.0]), 0.8
    truth = control.initial_response(control.ss(a, np.zeros((2, 1)), np.eye(2), 0), [0.0, t], start).outputs[
        :, -1
    ]
    return apart(expm(a) @ start, truth), apart(expm(a * t) @ start, truth)


@erratum("after 4.13")
def characteristic_polynomial() -> tuple[float, float]:
    """|sI - A - BK| has the poles of A + BK, not those of A - BK that (4.10) is about."""
    gain, chain, b = (
        design_controller("pole-placement").gain.reshape(1, 4),
        np.diag(np.ones(3), 1),
        np.eye(4)[:, 3:],
    )
    wanted = np.poly([-2.5] * 4)
    return apart(np.poly(chain + b @ gain), wanted), apart(np.poly(chain - b @ gain), wanted)


def standard_problem() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """P, K and the true transfer from w to z at one frequency, by solving the loop equations."""
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
    """K (I - K P22)^-1 does not even have matching sizes; K (I - P22 K)^-1 does."""
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
    """Without the row of W_ks nothing limits u; with it the loop's norm is that of [W_s S; W_ks K S]."""
    g, k = inner_loop(np.array([4.0, 6.0, 4.0, 3.0])), control.ss([[-1.0]], [[1.0]], [[2.0]], [[0.0]])
    w_s, w_ks = control.ss([[-0.1]], [[1.0]], [[0.5]], [[0.2]]), control.ss([], [], [], [[0.3]])
    s = 0.7j
    p = generalised_plant(g, w_s, w_ks)(s)
    loop = p[:2, :1] + p[:2, 1:] * k(s) / (1 - p[2, 1] * k(s)) * p[2, 0]
    sensitivity = 1 / (1 + g(s) * k(s))
    truth = np.array([w_s(s) * sensitivity, w_ks(s) * k(s) * sensitivity])
    printed = np.array([w_s(s) * sensitivity])
    return float(abs(len(printed) - len(truth))), float(np.abs(loop.ravel() - truth).max())


@erratum("K = W_a K_w W_e")
def order_of_weights() -> tuple[float, float]:
    """G_s = W_a G W_e in a loop with K_w: back on G the controller is W_e K_w W_a."""
    rng = np.random.default_rng(4)
    g, w_a, w_e, k = (rng.normal(size=shape) for shape in ((2, 3), (2, 2), (3, 3), (3, 2)))
    truth = np.linalg.eigvals(w_a @ g @ w_e @ k)
    right = np.linalg.eigvals(g @ (w_e @ k @ w_a))
    mismatch = abs(w_a.shape[1] - k.shape[0])  # W_a K_w cannot be multiplied unless G is square
    return float(mismatch), apart(np.sort(np.abs(right)[:2]), np.sort(np.abs(truth)))


@erratum("epsilon")
def stability_margin() -> tuple[float, float]:
    """The printed 2.4489 and 1.7600 are called epsilon, a margin, but are its inverse."""
    gamma = design_controller("lqr+loop-shaping").gamma
    assert gamma is not None
    assert 1.0 / gamma < 1.0
    return 1.7600 - 1.0, abs(1.7600 - gamma) if abs(1.7600 - gamma) > 1e-4 else 0.0


@pytest.mark.parametrize("number", ERRATA)
def test_printed_form_fails_and_corrected_form_passes(number: str) -> None:
    printed, corrected = ERRATA[number]()
    assert printed > 1e-3
    assert corrected < 1e-9


def test_every_erratum_is_in_the_table_and_only_those() -> None:
    page = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| \*\*(.+?)\*\* \|", page, re.MULTILINE)
    assert listed == list(ERRATA)

"""Check the errata of chapter 3: flatness and exact linearisation."""

from collections.abc import Callable

import numpy as np
import sympy as sp

from cranectl.design import design_controller
from cranectl.model import dynamics
from cranectl.model.flatness import state_and_input
from validation.thesis.errata.registry import (
    INPUT,
    G,
    check_states,
    erratum,
    max_difference,
    motion_terms,
    random_states,
    split,
)


def third_order_example() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return A, b of a controllable system, an output of relative degree 2, and a flat output."""
    a, b = np.array([[0.0, 1, 0], [0, 0, 0], [0, 0, -1]]), np.array([[0.0], [1], [1]])
    reach = np.hstack([b, a @ b, a @ a @ b])
    return a, b, np.array([[1.0, 0, 0]]), np.array([[0.0, 0, 1]]) @ np.linalg.inv(reach)


@erratum("3.5")
def relative_degree_of_a_flat_output() -> tuple[float, float]:
    """Check (3.5), which has r in place of n: every output with a relative degree would be flat.

    T of (3.9) is then no diffeomorphism.
    """
    a, b, short, flat = third_order_example()
    assert max_difference(short @ b, 0) == 0.0
    assert abs((short @ a @ b).item()) > 0.1, "(3.5) as printed holds for it, with r = 2"
    assert max_difference(np.hstack([flat @ b, flat @ a @ b]), 0) < 1e-12
    assert abs((flat @ a @ a @ b).item()) > 0.1
    ranks = [np.linalg.matrix_rank(np.vstack([c, c @ a, c @ a @ a])) for c in (short, flat)]
    return float(3 - ranks[0]), float(3 - ranks[1])


@erratum("3.7")
def stray_transpose() -> tuple[float, float]:
    """Check (3.7): D lambda is 1 x n and the bracket n x (n-1), so its transpose does not fit."""
    a, b, _, flat = third_order_example()
    bracket = np.hstack([b, a @ b])  # ad_{-f} g = A b for f = A x
    return float(abs(flat.shape[1] - bracket.T.shape[0])), max_difference(flat @ bracket, np.zeros((1, 2)))


@erratum("after 3.12")
def relative_degree_condition() -> tuple[float, float]:
    """Check the condition after (3.12): L_g L_f^k h = 0, not L_g^k h = 0.

    The example is x1' = x2, x2' = x3 + u, x3' = u, h = x1 at 0, with r = 2.
    """
    x = sp.Matrix(sp.symbols("x1:4"))
    f, g = sp.Matrix([x[1], x[2], 0]), sp.Matrix([0, 1, 1])

    def lie(h: sp.Expr, field: sp.Matrix, times: int = 1) -> sp.Expr:
        for _ in range(times):
            h = (sp.Matrix([h]).jacobian(x) * field)[0]
        return h

    def largest(condition: Callable[[int], sp.Expr]) -> int:
        """Return the largest r <= n for which the condition holds for k <= r - 2 at 0, and M(x0) != 0."""
        at = dict.fromkeys(x, 0)
        return max(
            r
            for r in (1, 2, 3)
            if all(condition(k).subs(at) == 0 for k in range(r - 1)) and lie(lie(x[0], f, r - 1), g) != 0
        )

    first_with_input = next(r for r in (1, 2, 3) if lie(lie(x[0], f, r - 1), g) != 0)
    printed, right = (largest(c) for c in (lambda k: lie(x[0], g, k), lambda k: lie(lie(x[0], f, k), g)))
    return float(abs(printed - first_with_input)), float(abs(right - first_with_input))


@erratum("3.14")
def derivative_of_the_derivative() -> tuple[float, float]:
    """Check (3.14): the new input is y^(r), as in (3.13), for y'' = a + M u along y = sin 2t."""
    t, a, m = 0.4, 1.3, -0.7
    truth = -4 * np.sin(2 * t)

    def response(v: float) -> float:
        return float(a + m * (-a / m + v / m))

    return abs(response(-8 * np.cos(2 * t)) - truth), abs(response(truth) - truth)


@erratum("3.15")
def input_transformation() -> tuple[float, float]:
    """Check (3.15): y'' = a + M u with u = rho + gamma v must give y'' = v."""
    rng = np.random.default_rng(0)
    a, m, v = rng.normal(size=3), rng.normal(size=(3, 3)), rng.normal(size=3)
    rho = -np.linalg.solve(m, a)
    printed = a + m @ (rho - np.linalg.solve(m, v))
    corrected = a + m @ (rho + np.linalg.solve(m, v))
    return max_difference(printed, v), max_difference(corrected, v)


def crane_fields() -> tuple[sp.Matrix, sp.Matrix, sp.Matrix, sp.Matrix, sp.Matrix]:
    """Return (x, f, g, u, h) of (3.21), (3.22), (3.24) with the corrected (2.12)."""
    x = sp.Matrix(sp.symbols("x xd y yd l ld a ad b bd"))
    u = sp.Matrix(sp.symbols("u_x u_y u_l"))
    _, xd, _, yd, length, rate, a, ad, b, bd = x
    sa, ca, sb, cb = sp.sin(a), sp.cos(a), sp.sin(b), sp.cos(b)
    add = (2 * length * ad * bd * sb - G * sa - 2 * rate * ad * cb - ca * u[1]) / (length * cb)
    bdd = (-G * ca * sb - 2 * rate * bd - length * ad**2 * sb * cb - cb * u[0] + sa * sb * u[1]) / length
    field = sp.Matrix([xd, u[0], yd, u[1], rate, u[2], ad, add, bd, bdd])
    h = sp.Matrix([x[0] + length * sb, x[2] + length * cb * sa, -length * ca * cb])
    return x, field.subs(dict.fromkeys(u, 0)), field.jacobian(u), u, h


def true_load_acceleration(state: np.ndarray) -> np.ndarray:
    q, qd, qdd, *_ = motion_terms(state)
    return dynamics.load_jacobian(q) @ qdd + dynamics.load_jacobian_rate(q, qd) @ qd


def lie_derivative_errors(*forms: Callable[..., sp.Matrix]) -> tuple[float, ...]:
    """Return errors of formulas for the load's acceleration.

    They are the least error of each formula but the last, and the largest error of the last.
    """
    x, f, g, u, h = crane_fields()

    def lf(m: sp.Matrix) -> sp.Matrix:
        return m.jacobian(x) * f

    def lg(m: sp.Matrix) -> sp.Matrix:
        return m.jacobian(x) * g

    compiled = [sp.lambdify([x], form(h, u, lf, lg).subs(dict(zip(u, INPUT, strict=True)))) for form in forms]
    states = random_states(20)
    errors = np.array(
        [[max_difference(c(s).ravel(), true_load_acceleration(s)) for c in compiled] for s in states]
    )
    return (*errors[:, :-1].min(axis=0), errors[:, -1].max())


@erratum("3.25")
def load_velocity() -> tuple[float, float]:
    """Check (3.25): it is printed with two rows in place of three; x is missing."""
    q, qd = split(random_states(1)[0])
    _, _, length, _, b = q
    truth = dynamics.load_jacobian(q) @ qd
    first = qd[0] + qd[2] * np.sin(b) + length * qd[4] * np.cos(b)
    return float(abs(len(truth) - 2)), abs(first - truth[0])


@erratum("3.26")
def second_lie_derivative() -> tuple[float, float]:
    """Check (3.26): with h' = L_f h the second term has one L_f too many, with h one too few."""
    first, second, right = lie_derivative_errors(
        lambda h, u, lf, lg: lf(lf(h)) + lg(lf(lf(h))) * u,
        lambda h, u, lf, lg: lf(h) + lg(lf(h)) * u,
        lambda h, u, lf, lg: lf(lf(h)) + lg(lf(h)) * u,
    )
    return min(first, second), right


@erratum("3.28")
def acceleration_of_the_load() -> tuple[float, float]:
    """Check (3.28): the right-hand side is z'', not z' (also in the sentence before (3.33))."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd = split(state)
        a_r = dynamics.specific_rope_force(q[2], q[3], qd[3], q[4], qd[4], *INPUT, G)
        row = a_r * np.array(dynamics.rope_direction(q[3], q[4])) - [0.0, 0.0, G]
        return max_difference(row, dynamics.load_velocity(q, qd)), max_difference(
            row, true_load_acceleration(state)
        )

    return check_states(check)


@erratum("3.30")
def rope_direction() -> tuple[float, float]:
    """Check (3.30): (r_t - r_l)/|…| points from load to trolley, unlike the vector printed beside it."""
    q, _ = split(random_states(1)[0])
    trolley, load = np.array([q[0], q[1], 0.0]), dynamics.load_position(q)
    n = np.array(dynamics.rope_direction(q[3], q[4]))
    return (
        max_difference((trolley - load) / np.linalg.norm(trolley - load), n),
        max_difference((load - trolley) / np.linalg.norm(load - trolley), n),
    )


@erratum("3.37")
def state_order() -> tuple[float, float]:
    """Check (3.37): (3.21) has x_c first and l fifth, (3.37) the other way round."""
    flat = np.concatenate([[1.2, 0.7, -0.6], np.zeros(12)])
    state, inputs = np.zeros(10), np.zeros(3)
    state_and_input(flat, G, state, inputs)
    as_printed = np.array([0.6, 0.7, 1.2])  # phi_x1 = l, phi_x3 = y_c, phi_x5 = x_c
    return max_difference(state[[0, 2, 4]], as_printed), max_difference(state[[0, 2, 4]], [1.2, 0.7, 0.6])


@erratum("3.37a")
def rope_length() -> tuple[float, float]:
    q, _ = split(random_states(1)[0])
    z_3, cosines = dynamics.load_position(q)[2], np.cos(q[3]) * np.cos(q[4])
    return abs(z_3 / cosines - q[2]), abs(-z_3 / cosines - q[2])


@erratum("3.39")
def arguments_of_the_input_map() -> tuple[float, float]:
    """Check (3.39): references with equal z, z', z'' need different inputs."""
    flat = np.concatenate([[1.0, 0.8, -0.7], [0.1, 0.2, -0.1], [0.3, -0.2, 0.4], np.zeros(6)])
    higher = np.concatenate([np.zeros(9), [0.5, -0.4, 0.3], [1.0, 2.0, -1.5]])
    inputs = [np.zeros(3), np.zeros(3)]
    for values, row in zip(inputs, (flat, flat + higher), strict=True):
        state_and_input(row, G, np.zeros(10), values)
    # With all arguments the map is the right one: its inputs give back z''.
    state, u = np.zeros(10), np.zeros(3)
    state_and_input(flat + higher, G, state, u)
    q, qd = split(state)
    a_r = dynamics.specific_rope_force(q[2], q[3], qd[3], q[4], qd[4], *u, G)
    acceleration = a_r * np.array(dynamics.rope_direction(q[3], q[4])) - [0.0, 0.0, G]
    return max_difference(*inputs), max_difference(acceleration, flat[6:9])


@erratum("r = [4 4 2]")
def no_vector_relative_degree() -> tuple[float, float]:
    """Check r = [4 4 2]: u already appears in z_1'' and z_2'', so r_1 = r_2 = 2 with an M of rank 1.

    The extended system has [4 4 4].
    """
    x, f, g, _, h = crane_fields()
    assert h.jacobian(x) * g == sp.zeros(3), "u is not in z'"
    decoupling = (h.jacobian(x) * f).jacobian(x) * g
    at = dict(zip(x, random_states(1)[0], strict=True))
    matrix = np.array(decoupling.subs(at), dtype=float)
    degrees = [2 if np.abs(row).max() > 1e-9 else 4 for row in matrix]
    # Extended: dz''''/d(u_x, u_y, v_3) by differences of the inverse map, which must be regular.
    rng = np.random.default_rng(1)
    flat = np.concatenate([[1.0, 0.8, -0.7], 0.3 * rng.normal(size=12)])
    jacobian = np.empty((3, 3))
    for column in range(3):
        inputs = []
        for sign in (1.0, -1.0):
            row, u = flat.copy(), np.zeros(3)
            row[12 + column] += sign
            state_and_input(row, G, np.zeros(10), u)
            inputs.append([u[0], u[1], row[14]])
        jacobian[:, column] = (np.array(inputs[0]) - inputs[1]) / 2
    h_drop, lift = -flat[2], flat[8] + G
    return float(np.abs(np.array([4, 4, 2]) - degrees).max()), abs(
        np.linalg.det(jacobian) * (lift / h_drop) ** 2 - 1
    )


@erratum("3.40")
def second_lie_derivative_again() -> tuple[float, float]:
    """Check (3.40): L_f h is the load's velocity, so its acceleration contains L_f² h."""
    printed, right = lie_derivative_errors(
        lambda h, u, lf, lg: lf(h) + lg(lf(h)) * u, lambda h, u, lf, lg: lf(lf(h)) + lg(lf(h)) * u
    )
    return printed, right


@erratum("3.46c")
def vertical_input() -> tuple[float, float]:
    """Check (3.46c): the map of (x, u) gives v_3 = z_3'' as in (3.41), not the fourth derivative."""
    flat = np.concatenate(
        [[1.0, 0.8, -0.7], [0.1, 0.2, -0.1], [0.3, -0.2, 0.4], [0.5, -0.4, 0.3], [1, 2, -1.5]]
    )
    state, u = np.zeros(10), np.zeros(3)
    state_and_input(flat, G, state, u)
    q, qd = split(state)
    a_r = dynamics.specific_rope_force(q[2], q[3], qd[3], q[4], qd[4], *u, G)
    v_3 = -G - np.cos(q[4]) * np.cos(q[3]) * a_r  # (3.41)
    return abs(v_3 - flat[14]), abs(v_3 - flat[8])


@erratum("3.47")
def third_derivative_of_the_error() -> tuple[float, float]:
    """Check (3.47): k_3^(3) e is the derivative of a constant, so e''' is missing and the loop unstable.

    (4.12) prints it correctly.
    """
    k = np.asarray(design_controller("pole-placement").gain)
    printed = np.roots([1, 0, k[2], k[1], k[0]]).real.max()
    return max(printed, 0.0), max(np.roots([1, *k[::-1]]).real.max(), 0.0)

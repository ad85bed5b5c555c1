"""Prove flatness and relative degree of the crane with inputs u = (x_c'', y_c'', l'') by symbols.

1. Without extension every load coordinate has relative degree 2. The decoupling matrix of [2 2 2] is
   n (n_x, n_y, 1), with rank 1, so there is no vector relative degree. [4 4 2] is none either, because u
   already appears in z_1'' and z_2''.
2. With the states zeta = z_3'' and zeta', the input zeta'' = v_3, and l'' chosen to realise zeta, the inputs
   u_x, u_y, v_3 first appear in the fourth derivatives: [4 4 4]. The determinant of the decoupling matrix is
   ((zeta + g) / h)² with the vertical drop h = l cos(alpha) cos(beta). It is singular for a slack rope, and
   not defined for a rope length of zero or an angle of pi/2.

Run this file to print the matrices. The tests call `verify`.
"""

import sympy as sp

ALPHA, BETA, ALPHA_DOT, BETA_DOT = sp.symbols("alpha beta alpha_dot beta_dot", real=True)
LENGTH, LENGTH_DOT, GRAVITY = sp.symbols("l l_dot g", positive=True)
ZETA, ZETA_DOT, V_3 = sp.symbols("zeta zeta_dot v_3", real=True)
U = sp.Matrix(sp.symbols("u_x u_y u_l", real=True))

N = sp.Matrix(
    [sp.sin(BETA), sp.cos(BETA) * sp.sin(ALPHA), -sp.cos(ALPHA) * sp.cos(BETA)]
)  # rope direction, trolley to load


def cardan_accelerations() -> sp.Matrix:
    """Return (alpha'', beta'') for the input u, by the corrected (2.12)."""
    sa, ca, sb, cb = sp.sin(ALPHA), sp.cos(ALPHA), sp.sin(BETA), sp.cos(BETA)
    alpha = (
        2 * LENGTH * ALPHA_DOT * BETA_DOT * sb - GRAVITY * sa - 2 * LENGTH_DOT * ALPHA_DOT * cb - ca * U[1]
    ) / (LENGTH * cb)
    beta = (
        -GRAVITY * ca * sb
        - 2 * LENGTH_DOT * BETA_DOT
        - LENGTH * ALPHA_DOT**2 * sb * cb
        - cb * U[0]
        + sa * sb * U[1]
    ) / LENGTH
    return sp.Matrix([alpha, beta])


def load_acceleration() -> sp.Matrix:
    """Return the load's acceleration, the second derivative of (x_c, y_c, 0) + l n."""
    angles, rates = sp.Matrix([ALPHA, BETA]), sp.Matrix([ALPHA_DOT, BETA_DOT])
    jacobian = N.jacobian(angles)
    n_dot = jacobian * rates
    n_ddot = n_dot.jacobian(angles) * rates + jacobian * cardan_accelerations()
    trolley = sp.Matrix([U[0], U[1], 0])
    return (trolley + U[2] * N + 2 * LENGTH_DOT * n_dot + LENGTH * n_ddot).applyfunc(sp.simplify)


def decoupling_without_extension() -> sp.Matrix:
    """Return d(z'')/du, the matrix M(x) of (3.12) for [2 2 2]."""
    return load_acceleration().jacobian(U).applyfunc(sp.simplify)


def slopes() -> sp.Matrix:
    """Return the rope's slopes (p_x, p_y), with z_1'' = -p_x (zeta + g) and z_2'' = -p_y (zeta + g)."""
    return sp.Matrix([sp.tan(BETA) / sp.cos(ALPHA), sp.tan(ALPHA)])


def decoupling_with_extension() -> sp.Matrix:
    """Return d(z'''')/d(u_x, u_y, v_3) of the extended system with the states x, zeta, zeta'."""
    angles, rates = sp.Matrix([ALPHA, BETA]), sp.Matrix([ALPHA_DOT, BETA_DOT])
    p = slopes()
    jacobian = p.jacobian(angles)
    p_dot = jacobian * rates
    p_ddot = p_dot.jacobian(angles) * rates + jacobian * cardan_accelerations()
    lateral = -(p_ddot * (ZETA + GRAVITY) + 2 * p_dot * ZETA_DOT + p * V_3)
    inputs = sp.Matrix([U[0], U[1], V_3])
    return sp.Matrix([lateral, sp.Matrix([V_3])]).jacobian(inputs).applyfunc(sp.simplify)


def verify() -> dict[str, sp.Expr]:
    """Assert the statements at the top of this file, and return the matrices."""
    acceleration = load_acceleration()
    matrix = decoupling_without_extension()
    pull = sp.Matrix([[N[0], N[1], 1]])  # components of the inputs along the rope
    assert sp.simplify(matrix - N * pull) == sp.zeros(3), "the rope transmits one force, along n"
    assert sp.simplify(matrix.det()) == 0
    assert all(sp.simplify(minor) == 0 for minor in _minors(matrix)), "its rank is 1"
    for row in range(3):
        assert matrix[row, :] != sp.zeros(1, 3), "each output has relative degree 2, not 4"
    # z'' lies in the plane of n and gravity, so the lateral accelerations follow from the vertical one.
    lift = acceleration[2] + GRAVITY
    for lateral, slope in zip(acceleration[:2], slopes(), strict=True):
        assert sp.simplify(lateral + slope * lift) == 0
    # l'' can realise any zeta, because its factor in z_3'' is -cos(alpha) cos(beta), not 0 if |angles| <
    # pi/2.
    assert sp.simplify(acceleration[2].diff(U[2]) - N[2]) == 0
    extended = decoupling_with_extension()
    determinant = sp.simplify(extended.det())
    expected = (ZETA + GRAVITY) ** 2 / (LENGTH**2 * sp.cos(ALPHA) ** 2 * sp.cos(BETA) ** 2)
    assert sp.simplify(determinant - expected) == 0
    return {"matrix": matrix, "extended": extended, "determinant": expected}


def _minors(matrix: sp.Matrix) -> list[sp.Expr]:
    return [matrix.minor(row, column) for row in range(3) for column in range(3)]


if __name__ == "__main__":
    for name, value in verify().items():
        print(f"{name}:")
        sp.pprint(value)

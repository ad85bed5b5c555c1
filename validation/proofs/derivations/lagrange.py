"""Derive the equations of motion from the Lagrangian, and compare the code with them.

    python validation/proofs/derivations/lagrange.py

From the energies, Lagrange's equations give M, C, G, the angular accelerations without masses, and the rope
force. SymPy proves identities of symbols. Random states show that `cranectl.model.dynamics` agrees.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp

from cranectl.model import dynamics
from cranectl.scenario.rig import RigParameters

t = sp.Symbol("t")
m_b, m_t, m_w, m_l, g = sp.symbols("m_b m_t m_w m_l g", positive=True)
q = sp.Matrix([sp.Function(name)(t) for name in ("x_c", "y_c", "l", "alpha", "beta")])
qd, qdd = q.diff(t), q.diff(t, 2)

# Plain symbols for evaluation, in place of functions of time.
Q = sp.Matrix(sp.symbols("x_c y_c l alpha beta"))
QD = sp.Matrix(sp.symbols("xd_c yd_c ld alphad betad"))
QDD = sp.Matrix(sp.symbols("xdd_c ydd_c ldd alphadd betadd"))
MASSES = (m_b, m_t, m_w, m_l, g)


def without_time(expression: Any) -> Any:
    """Replace functions of time by symbols, highest derivatives first."""
    for functions, symbols in ((qdd, QDD), (qd, QD), (q, Q)):
        expression = expression.subs(list(zip(functions, symbols, strict=True)))
    return expression


def derive() -> dict[str, Any]:
    """Derive the equations from kinematics and energies, and return them by name."""
    x_c, y_c, length, alpha, beta = q
    # The kinematics follow from the joints: rotate a plumb rope by beta about -y, then by alpha about x.
    about_x = sp.rot_axis1(-alpha)
    about_minus_y = sp.rot_axis2(beta)
    rope = about_x * about_minus_y * sp.Matrix([0, 0, -length])
    load = sp.Matrix([x_c, y_c, 0]) + rope

    load_velocity = load.diff(t)
    drives = m_b * qd[0] ** 2 + m_t * (qd[0] ** 2 + qd[1] ** 2) + m_w * qd[2] ** 2
    kinetic = (drives + m_l * load_velocity.dot(load_velocity)) / 2
    potential = m_l * g * load[2]
    lagrangian = kinetic - potential
    pairs = zip(q, qd, strict=True)
    forces = sp.Matrix([lagrangian.diff(v).diff(t) - lagrangian.diff(p) for p, v in pairs])
    forces = without_time(forces.doit())
    mass = sp.simplify(forces.jacobian(QDD))
    gravity = without_time(sp.Matrix([potential.diff(position) for position in q]))
    velocity_terms = (forces - mass * QDD - gravity).expand()
    acceleration = without_time(load.diff(t, 2))
    direction = without_time(rope / length)
    return {
        "load": without_time(load),
        "load_velocity": without_time(load_velocity),
        "kinetic": without_time(kinetic),
        "potential": without_time(potential),
        "mass": mass,
        "velocity_terms": velocity_terms,
        "gravity": gravity,
        # The rows of the angles, solved for their accelerations; the mass must cancel.
        "cardan": sp.simplify(mass[3:, 3:].LUsolve(mass[3:, 3:] * QDD[3:, :] - forces[3:, :])),
        # By Newton's law the rope force acts along n: a_r = n · (z'' + g e_z).
        "rope_force": sp.simplify(direction.dot(acceleration + sp.Matrix([0, 0, g]))),
    }


def check_identities(equations: dict[str, Any]) -> None:
    """Prove that the angular accelerations contain no masses, and equal the corrected (2.12)."""
    masses = {m_b, m_t, m_w, m_l}
    assert not equations["cardan"].free_symbols & masses, "the cardan accelerations depend on a mass"
    assert equations["mass"].is_symmetric()
    length, a, b = Q[2:]
    length_rate, ad, bd = QD[2:]
    xdd, ydd = QDD[:2]
    sin, cos = sp.sin, sp.cos
    alpha = 2 * length * ad * bd * sin(b) - g * sin(a) - 2 * length_rate * ad * cos(b) - cos(a) * ydd
    beta = (
        -g * cos(a) * sin(b)
        - 2 * length_rate * bd
        - length * ad**2 * sin(b) * cos(b)
        - cos(b) * xdd
        + sin(a) * sin(b) * ydd
    )
    corrected = sp.Matrix([alpha / (length * cos(b)), beta / length])
    assert sp.simplify(equations["cardan"] - corrected) == sp.zeros(2, 1), "corrected (2.12)"


def check_code(equations: dict[str, Any], *, samples: int = 200, seed: int = 1) -> float:
    """Return the largest relative difference of `cranectl.model.dynamics` from the derivation."""
    rng = np.random.default_rng(seed)
    evaluate = {
        name: sp.lambdify([Q, QD, QDD, MASSES], expression, "numpy", cse=True)
        for name, expression in equations.items()
    }
    largest = 0.0
    for _ in range(samples):
        position = rng.uniform([0.0, 0.0, 0.05, -1.4, -1.4], [2.0, 1.54, 1.4, 1.4, 1.4])
        velocity, acceleration = rng.normal(size=5), rng.normal(size=5)
        m = rng.uniform([0.1, 0.1, 0.1, 0.1, 1.0], 10.0)
        names = ("bridge_mass", "trolley_mass", "winch_mass", "load_mass", "gravity")
        rig = RigParameters(**dict(zip(names, m.tolist(), strict=True)))
        for name, code in code_values(position, velocity, acceleration, rig).items():
            derived = np.asarray(evaluate[name](position, velocity, acceleration, m), dtype=float).squeeze()
            scale = max(1.0, float(np.abs(derived).max()))
            difference = float(np.abs(derived - code).max()) / scale
            assert difference < 1e-11, f"{name} differs by {difference:.1e}"
            largest = max(largest, difference)
    return largest


def code_values(position: Any, velocity: Any, acceleration: Any, rig: RigParameters) -> dict[str, Any]:
    """Return the same quantities, computed by `cranectl.model.dynamics`."""
    _, _, length, alpha, beta = position
    _, _, length_rate, alpha_rate, beta_rate = velocity
    u = acceleration[:3]
    rope: Callable[..., float] = dynamics.specific_rope_force
    return {
        "load": dynamics.load_position(position),
        "load_velocity": dynamics.load_velocity(position, velocity),
        "kinetic": dynamics.kinetic_energy(position, velocity, rig),
        "potential": dynamics.potential_energy(position, rig),
        "mass": dynamics.mass_matrix(position, rig),
        "velocity_terms": dynamics.coriolis_matrix(position, velocity, rig) @ velocity,
        "gravity": dynamics.gravity_vector(position, rig),
        "cardan": dynamics.angular_accelerations(
            length, length_rate, alpha, alpha_rate, beta, beta_rate, u[0], u[1], rig.gravity
        ),
        "rope_force": rope(length, alpha, alpha_rate, beta, beta_rate, *u, rig.gravity),
    }


def main() -> None:
    """Derive the equations, check them and the code, and print the largest difference."""
    equations = derive()
    check_identities(equations)
    difference = check_code(equations)
    print(f"cranectl.model.dynamics agrees with the derived equations to {difference:.1e}")


if __name__ == "__main__":
    main()

"""Equations of motion of the crane with a rope of variable length (thesis chapter 2, corrected).

Coordinates q = (x_c, y_c, l, alpha, beta); the load is a point at r = (x_c, y_c, 0) + l n with the rope
direction n = (sin b, cos b sin a, -cos a cos b). With J = dr/dq the manipulator form is

    M = M_drives + m J'J,    C = m J' dJ/dt,    G = m g dr_3/dq,    M qdd + C qd + G = F

and this C makes dM/dt - 2C skew. `validation/proofs/derivations/lagrange.py` derives the equations from the
Lagrangian.
"""

from math import cos, inf, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.scenario import RigParameters
from cranectl.signals import ALPHA, ALPHA_RATE, BETA, BETA_RATE, ROPE
from cranectl.support import jit

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@jit
def angular_accelerations(rope_length, rope_rate, alpha, alpha_rate, beta, beta_rate, u_x, u_y, gravity):
    """Return (alpha'', beta'') [rad/s²] at the accelerations u_x, u_y of bridge and trolley [m/s²].

    This is the corrected (2.12). It contains no masses. It needs rope_length > 0, and beta within
    -pi/2 and pi/2.
    """
    sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
    alpha_ddot = (
        2.0 * rope_length * alpha_rate * beta_rate * sb
        - gravity * sa
        - 2.0 * rope_rate * alpha_rate * cb
        - ca * u_y
    ) / (rope_length * cb)
    beta_ddot = (
        -gravity * ca * sb
        - 2.0 * rope_rate * beta_rate
        - rope_length * alpha_rate * alpha_rate * sb * cb
        - cb * u_x
        + sa * sb * u_y
    ) / rope_length
    return alpha_ddot, beta_ddot


@jit
def specific_rope_force(rope_length, alpha, alpha_rate, beta, beta_rate, u_x, u_y, u_l, gravity):
    """Return the acceleration of the load along n that the rope causes [m/s²], by (3.27).

    It is negative while the rope pulls. The rope tension is minus the load mass times this.
    """
    sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
    centripetal = rope_length * (alpha_rate * alpha_rate * cb * cb + beta_rate * beta_rate)
    return u_x * sb + u_y * sa * cb + u_l - gravity * ca * cb - centripetal


@jit
def rope_direction(alpha, beta):
    """Return the unit vector n from the trolley to the load."""
    return sin(beta), cos(beta) * sin(alpha), -cos(alpha) * cos(beta)


@jit
def rope_direction_rate(alpha, alpha_rate, beta, beta_rate):
    """Return the time derivative of n [1/s]."""
    sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
    return (
        beta_rate * cb,
        alpha_rate * cb * ca - beta_rate * sb * sa,
        alpha_rate * sa * cb + beta_rate * ca * sb,
    )


class AxisMasses(NamedTuple):
    """The masses that the forces of the drives move [kg], and gravity [m/s²].

    An infinite mass is one that nothing can move: that of a fixed axis.
    """

    bridge: float  # bridge and trolley, along x
    trolley: float  # trolley and its motor, along y
    winch: float  # of the winch, as a mass at the rope
    load: float  # of the load
    gravity: float  # [m/s²]


def axis_masses(rig: RigParameters) -> AxisMasses:
    """Return the masses of `rig`."""
    bridge, trolley, winch = rig.axis_masses.tolist()
    return AxisMasses(bridge, trolley, winch, load=rig.load_mass, gravity=rig.gravity)


def movable_masses(rig: RigParameters) -> AxisMasses:
    """Return the masses of `rig`, with infinite ones for its fixed axes."""
    masses = axis_masses(rig)
    own = dict(zip(masses._fields, rig.moves, strict=False))
    return masses._replace(**{name: inf for name, moves in own.items() if not moves})


@jit
def _rope_force(state, u_x, u_y, u_l, gravity):
    """Return `specific_rope_force` at `state` (10,), in the order of `SignalGroup.STATE`."""
    return specific_rope_force(
        state[ROPE], state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE], u_x, u_y, u_l, gravity
    )


@jit
def drive_forces(masses, state, u_x, u_y, u_l):
    """Return the forces [N] that accelerate bridge, trolley, rope by (u_x, u_y, u_l) [m/s²].

    Each drive moves its own mass against the rope's tension S = -m a_r, which pulls along (n_x, n_y, 1). So
    F = P u + w with P = M_drives + m (n_x, n_y, 1)'(n_x, n_y, 1). `state` (10,) is as `SignalGroup.STATE`.
    On a fixed axis there is no drive, and its force is 0.
    """
    n = rope_direction(state[ALPHA], state[BETA])
    tension = -masses.load * _rope_force(state, u_x, u_y, u_l, masses.gravity)
    return (
        axis_force(masses.bridge, u_x, tension * n[0]),
        axis_force(masses.trolley, u_y, tension * n[1]),
        axis_force(masses.winch, u_l, tension),
    )


@jit
def axis_force(mass, acceleration, pull):
    """Return the force [N] that accelerates a mass [kg] against a pull [N]; 0 for a fixed axis."""
    return mass * acceleration - pull if mass < inf else 0.0


@jit
def _tension(masses, state, n, u_x, u_y, u_l, winch_mobility):
    """Return the tension of the rope [N]; u are the accelerations without it (Sherman-Morrison formula)."""
    alone = _rope_force(state, u_x, u_y, u_l, masses.gravity)
    mobility = n[0] * n[0] / masses.bridge + n[1] * n[1] / masses.trolley + winch_mobility
    return -masses.load * alone / (1.0 + masses.load * mobility)


@jit
def forced_accelerations(masses, state, f_x, f_y, f_l):
    """Return the accelerations of bridge, trolley, rope [m/s²] under forces [N]; inverse of `drive_forces`.

    They are P^-1 (F - w): what the forces alone would cause, minus what the tension causes.
    """
    n = rope_direction(state[ALPHA], state[BETA])
    u_x, u_y, u_l = f_x / masses.bridge, f_y / masses.trolley, f_l / masses.winch
    tension = _tension(masses, state, n, u_x, u_y, u_l, 1.0 / masses.winch)
    return (
        u_x + tension * n[0] / masses.bridge,
        u_y + tension * n[1] / masses.trolley,
        u_l + tension / masses.winch,
    )


@jit
def winch_force(masses, state, f_x, f_y, u_l):
    """Return the winch force [N] for the rope acceleration u_l [m/s²], with f_x, f_y on the axes [N]."""
    n = rope_direction(state[ALPHA], state[BETA])
    tension = _tension(masses, state, n, f_x / masses.bridge, f_y / masses.trolley, u_l, 0.0)
    return masses.winch * u_l - tension


def load_jacobian(q: Vector) -> Matrix:
    """Return J = dr/dq, shape (3, 5), for q = (x_c, y_c, l, alpha, beta)."""
    _, _, length, alpha, beta = q
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    return np.array(
        [
            [1.0, 0.0, sb, 0.0, length * cb],
            [0.0, 1.0, cb * sa, length * cb * ca, -length * sb * sa],
            [0.0, 0.0, -ca * cb, length * sa * cb, length * ca * sb],
        ]
    )


def load_jacobian_rate(q: Vector, qd: Vector) -> Matrix:
    """Return dJ/dt along the velocity `qd`, shape (3, 5)."""
    _, _, length, a, b = q
    _, _, length_rate, ad, bd = qd
    sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
    n_dot = rope_direction_rate(a, ad, b, bd)
    return np.array(
        [
            [0.0, 0.0, n_dot[0], 0.0, length_rate * cb - length * bd * sb],
            [
                0.0,
                0.0,
                n_dot[1],
                length_rate * cb * ca - length * (bd * sb * ca + ad * cb * sa),
                -length_rate * sb * sa - length * (bd * cb * sa + ad * sb * ca),
            ],
            [
                0.0,
                0.0,
                n_dot[2],
                length_rate * sa * cb + length * (ad * ca * cb - bd * sa * sb),
                length_rate * ca * sb + length * (bd * ca * cb - ad * sa * sb),
            ],
        ]
    )


def mass_matrix(q: Vector, rig: RigParameters) -> Matrix:
    """Return M(q), shape (5, 5) [kg, kg m, kg m²]; positive definite for l > 0 and |beta| < pi/2."""
    jacobian = load_jacobian(q)
    return np.diag([*rig.axis_masses, 0.0, 0.0]) + rig.load_mass * jacobian.T @ jacobian


def coriolis_matrix(q: Vector, qd: Vector, rig: RigParameters) -> Matrix:
    """Return C(q, qd), shape (5, 5), such that dM/dt - 2C is skew."""
    return rig.load_mass * load_jacobian(q).T @ load_jacobian_rate(q, qd)


def gravity_vector(q: Vector, rig: RigParameters) -> Vector:
    """Return G(q) = dV/dq, shape (5,) [N, N m]."""
    weight: Vector = rig.weight * load_jacobian(q)[2]
    return weight


def kinetic_energy(q: Vector, qd: Vector, rig: RigParameters) -> float:
    """Return the kinetic energy of bridge, trolley, winch rotor and load [J]."""
    return float(0.5 * qd @ mass_matrix(q, rig) @ qd)


def potential_energy(q: Vector, rig: RigParameters) -> float:
    """Return the potential energy of the load [J], zero at trolley height."""
    return float(rig.weight * load_position(q)[2])


def load_position(q: Vector) -> Vector:
    """Return the load position [m] in the world, shape (3,)."""
    bridge, trolley, length, alpha, beta = q
    n = rope_direction(alpha, beta)
    return np.array([bridge + length * n[0], trolley + length * n[1], length * n[2]])


def load_velocity(q: Vector, qd: Vector) -> Vector:
    """Return the load velocity [m/s] in the world, shape (3,)."""
    return load_jacobian(q) @ qd


def rope_tension(q: Vector, qd: Vector, accelerations: Vector, rig: RigParameters) -> float:
    """Return the rope tension [N], positive when it pulls, at accelerations (u_x, u_y, u_l) [m/s²]."""
    _, _, length, alpha, beta = q
    u_x, u_y, u_l = accelerations
    force = specific_rope_force(length, alpha, qd[3], beta, qd[4], u_x, u_y, u_l, rig.gravity)
    return float(-rig.load_mass * force)

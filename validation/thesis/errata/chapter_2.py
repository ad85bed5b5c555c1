"""Chapter 2: the model."""

import numpy as np

from cranectl.model import dynamics
from validation.thesis.errata.registry import (
    INPUT,
    RIG,
    G,
    apart,
    erratum,
    manipulator,
    over_states,
    random_states,
    split,
)


@erratum("2.3")
def kinetic_energy() -> tuple[float, float]:
    """Check T: one mass for r_t loses the bridge, which moves along x only; M11 inherits it."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd = split(state)
        load = 0.5 * RIG.load_mass * np.sum(dynamics.load_velocity(q, qd) ** 2)
        truth = dynamics.kinetic_energy(q, qd, RIG)
        winch = 0.5 * RIG.winch_mass * qd[2] ** 2  # actuator dynamics, which the thesis leaves out on purpose
        printed = 0.5 * RIG.trolley_mass * (qd[0] ** 2 + qd[1] ** 2) + load + winch
        return abs(printed - truth), abs(printed + 0.5 * RIG.bridge_mass * qd[0] ** 2 - truth)

    errors = np.array([check(state) for state in random_states(50)])
    return float(np.median(errors[:, 0])), float(errors[:, 1].max())  # at xd = 0 there is no difference


@erratum("2.3 (arguments)")
def velocity_of_the_bridge() -> tuple[float, float]:
    """T is said to depend on a velocity x_t', which no coordinate has: x_c would then have no momentum."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd, _, m, *_ = manipulator(state)
        momentum = (m @ qd)[0]
        one = np.eye(5)[0]  # a central difference of a quadratic form is exact
        right = 0.5 * (dynamics.kinetic_energy(q, qd + one, RIG) - dynamics.kinetic_energy(q, qd - one, RIG))
        return abs(momentum), abs(right - momentum)

    return over_states(check)


@erratum("2.6")
def acceleration_in_the_model() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, qd, qdd, m, coriolis, gravity, force = manipulator(state)
        return apart(m @ qd + coriolis + gravity, force), apart(m @ qdd + coriolis + gravity, force)

    return over_states(check)


@erratum("q_1 (before 2.7a)")
def actuated_coordinates() -> tuple[float, float]:
    """Four entries, c between y_c and l: with the two angles six coordinates of a crane that has five."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, _, qdd, m, coriolis, gravity, force = manipulator(state)
        rows = m[:3, :3] @ qdd[:3] + m[:3, 3:] @ qdd[3:] + (coriolis + gravity)[:3]
        return float(abs(4 + 2 - len(q))), apart(rows, force[:3])

    return over_states(check)


@erratum("F_1 (before 2.7a)")
def forces_of_the_drives() -> tuple[float, float]:
    """Check F_1: a coordinate y stands where the trolley's force belongs."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, _, qdd, m, coriolis, gravity, force = manipulator(state)
        rows = (m @ qdd + coriolis + gravity)[:3]
        return abs(rows[1] - q[1]), apart(rows, force[:3])

    return over_states(check)


@erratum("2.7b")
def acceleration_in_the_unactuated_rows() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, qd, qdd, m, coriolis, gravity, _ = manipulator(state)
        rest = (coriolis + gravity)[3:]
        return apart(m[3:] @ qd + rest, 0.0), apart(m[3:] @ qdd + rest, 0.0)

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


@erratum("M12 (shape)")
def shape_of_the_coupling() -> tuple[float, float]:
    """Check M12: printed 2 x 3, it has to multiply the two angles and add to three forces."""
    q, _ = split(random_states(1)[0])
    _, _, length, a, b = q
    rows = [[0, np.cos(b)], [np.cos(a) * np.cos(b), -np.sin(a) * np.sin(b)], [0, 0]]
    return float(abs(2 - 3)), apart(
        RIG.load_mass * length * np.array(rows), dynamics.mass_matrix(q, RIG)[:3, 3:]
    )


@erratum("M21 (shape)")
def shape_of_the_coupling_back() -> tuple[float, float]:
    """Check M21: printed 2 x 2, it has to multiply three accelerations; the lost column is zero."""
    q, _, qdd, m, coriolis, gravity, _ = manipulator(random_states(1)[0])
    _, _, length, a, b = q
    rows = [[0, np.cos(a) * np.cos(b), 0], [np.cos(b), -np.sin(a) * np.sin(b), 0]]
    right = RIG.load_mass * length * np.array(rows)
    return float(abs(2 - len(qdd[:3]))), apart(
        right @ qdd[:3] + m[3:, 3:] @ qdd[3:] + (coriolis + gravity)[3:], 0.0
    )


@erratum("M22 > 0")
def positive_definite_where() -> tuple[float, float]:
    """Beta < pi/2 admits beta = -pi/2, where M22 is singular; |beta| < pi/2 does not."""

    def smallest(beta: float) -> float:
        return float(
            np.linalg.eigvalsh(dynamics.mass_matrix(np.array([0, 0, 0.7, 0.2, beta]), RIG)[3:, 3:])[0]
        )

    printed = [smallest(b) for b in np.linspace(-np.pi / 2, 1.5, 100)]
    right = [smallest(b) for b in np.linspace(-1.5, 1.5, 100)]
    return float(min(printed) < 1e-12), float(min(right) < 1e-12)


@erratum("C11")
def coriolis_of_hoisting_on_the_trolley() -> tuple[float, float]:
    """Parentheses and sign: -2 m (bd sa sb - ad ca cb), not -2 m bd sa sb - ad ca cb."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd = split(state)
        _, _, _, a, b = q
        _, _, rate, ad, bd = qd
        # Only hoisting couples to l': what remains of (C qd)_y when the centripetal part is taken off.
        still = np.array([0.0, 0.0, 0.0, ad, bd])
        y = (dynamics.coriolis_matrix(q, qd, RIG) @ qd - dynamics.coriolis_matrix(q, still, RIG) @ still)[1]
        m = RIG.load_mass
        sines, cosines = np.sin(a) * np.sin(b), np.cos(a) * np.cos(b)
        printed = (-2 * m * bd * sines - ad * cosines) * rate
        return abs(printed - y), abs(-2 * m * (bd * sines - ad * cosines) * rate - y)

    return over_states(check)


@erratum("C12")
def centripetal_forces() -> tuple[float, float]:
    """Check C12: printed without l and the row of x, and with sin b for cos b in the row of y."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd = split(state)
        _, _, length, a, b = q
        ad, bd = qd[3:]
        sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
        still = np.array([0.0, 0.0, 0.0, ad, bd])
        truth = (dynamics.coriolis_matrix(q, still, RIG) @ still)[:3]
        m = RIG.load_mass
        printed = m * np.array([[-ad * cb * sa, -bd * sb * sa], [-ad * cb**2, -bd]]) @ qd[3:]  # y and l
        right = m * length * np.array(
            [
                [0.0, -bd * sb],
                [-ad * cb * sa - bd * ca * sb, -bd * cb * sa - ad * ca * sb],
                [-ad * cb**2, -bd],
            ]
        ) @ qd[3:]  # fmt: skip
        return apart(printed, truth[1:]), apart(right, truth)

    return over_states(check)


@erratum("C21, C22")
def coriolis_blocks() -> tuple[float, float]:
    """Check C21, C22: as printed they lack l and a row; C qd decides, since C is not unique."""

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


@erratum("G1 (shape)")
def shape_of_gravity() -> tuple[float, float]:
    """Four entries; the fourth is the first of G2, so G has five only if G2 has one."""
    q, _ = split(random_states(1)[0])
    three = [0.0, 0.0, -RIG.load_mass * G * np.cos(q[3]) * np.cos(q[4])]
    return float(abs(4 - 3)), apart(three, dynamics.gravity_vector(q, RIG)[:3])


@erratum("G2")
def gravity_torques() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        q, _ = split(state)
        _, _, length, a, b = q
        truth = dynamics.gravity_vector(q, RIG)[3:]
        printed = RIG.load_mass * G * np.array([np.sin(a) * np.cos(b), np.cos(a) * np.sin(b)])
        return apart(printed, truth), apart(length * printed, truth)

    return over_states(check)


@erratum("u before 2.12, y_c in 2.12")
def velocities_as_inputs() -> tuple[float, float]:
    """Check (2.12): with y_c' where y_c'' belongs the angles' accelerations are wrong."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd, qdd, *_ = manipulator(state)
        common = (q[2], qd[2], q[3], qd[3], q[4], qd[4], INPUT[0])
        printed = dynamics.angular_accelerations(*common, qd[1], G)
        right = dynamics.angular_accelerations(*common, INPUT[1], G)
        return apart(printed, qdd[3:]), apart(right, qdd[3:])

    return over_states(check)


@erratum("2.12a")
def cardan_alpha() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, _, _, _, length, rate, a, ad, b, bd = state
        truth = manipulator(state)[2][3]
        rest = 2 * length * ad * bd * np.sin(b) - G * np.sin(a) - np.cos(a) * INPUT[1]
        printed = rest / (length * np.cos(b) + 2 * length)  # alpha'' on both sides, solved for it
        corrected = (rest - 2 * rate * ad * np.cos(b)) / (length * np.cos(b))
        return abs(printed - truth), abs(corrected - truth)

    return over_states(check)


@erratum("2.12b")
def cardan_beta() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, _, _, _, length, rate, a, ad, b, bd = state
        truth = manipulator(state)[2][4]
        rest = (
            -length * ad**2 * np.sin(b) * np.cos(b) - np.cos(b) * INPUT[0] + np.sin(a) * np.sin(b) * INPUT[1]
        )
        gravity = G * np.cos(a) * np.sin(b)
        printed = (gravity - 2 * length * bd + rest) / length
        corrected = (-gravity - 2 * rate * bd + rest) / length
        return abs(printed - truth), abs(corrected - truth)

    return over_states(check)

"""Check the errata of chapter 2: the model."""

import numpy as np

from cranectl.model import dynamics
from validation.thesis.errata.registry import (
    INPUT,
    RIG,
    G,
    check_states,
    erratum,
    max_difference,
    motion_terms,
    random_states,
    split,
)


@erratum("2.3")
def kinetic_energy() -> tuple[float, float]:
    """Check T: one mass for r_t leaves out the bridge, which moves along x only; M11 repeats this."""

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
    """Check the arguments of T: with a velocity x_t' that is no coordinate, x_c would have no momentum."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd, _, m, *_ = motion_terms(state)
        momentum = (m @ qd)[0]
        one = np.eye(5)[0]  # a central difference of a quadratic form is exact
        right = 0.5 * (dynamics.kinetic_energy(q, qd + one, RIG) - dynamics.kinetic_energy(q, qd - one, RIG))
        return abs(momentum), abs(right - momentum)

    return check_states(check)


@erratum("2.6")
def acceleration_in_the_model() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, qd, qdd, m, coriolis, gravity, force = motion_terms(state)
        return max_difference(m @ qd + coriolis + gravity, force), max_difference(
            m @ qdd + coriolis + gravity, force
        )

    return check_states(check)


@erratum("q_1 (before 2.7a)")
def actuated_coordinates() -> tuple[float, float]:
    """Check q_1: four entries, with c between y_c and l, give six coordinates of a crane that has five."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, _, qdd, m, coriolis, gravity, force = motion_terms(state)
        rows = m[:3, :3] @ qdd[:3] + m[:3, 3:] @ qdd[3:] + (coriolis + gravity)[:3]
        return float(abs(4 + 2 - len(q))), max_difference(rows, force[:3])

    return check_states(check)


@erratum("F_1 (before 2.7a)")
def forces_of_the_drives() -> tuple[float, float]:
    """Check F_1: the coordinate y is printed in place of the trolley's force."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, _, qdd, m, coriolis, gravity, force = motion_terms(state)
        rows = (m @ qdd + coriolis + gravity)[:3]
        return abs(rows[1] - q[1]), max_difference(rows, force[:3])

    return check_states(check)


@erratum("2.7b")
def acceleration_in_the_unactuated_rows() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, qd, qdd, m, coriolis, gravity, _ = motion_terms(state)
        rest = (coriolis + gravity)[3:]
        return max_difference(m[3:] @ qd + rest, 0.0), max_difference(m[3:] @ qdd + rest, 0.0)

    return check_states(check)


@erratum("M11")
def one_carriage_mass() -> tuple[float, float]:
    """Check M11: bridge and trolley move along x, the trolley alone along y, so one m_c is not enough."""
    m = dynamics.mass_matrix(split(random_states(1)[0])[0], RIG)[:2, :2]
    best = np.linalg.norm(np.diag(m) - np.diag(m).mean())
    both = np.diag([RIG.bridge_mass + RIG.trolley_mass, RIG.trolley_mass]) + RIG.load_mass * np.eye(2)
    return float(best), max_difference(m, both)


@erratum("M12, M21")
def inertial_coupling() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        q, _ = split(state)
        _, _, length, a, b = q
        truth = dynamics.mass_matrix(q, RIG)[3:, :3]
        m = RIG.load_mass
        printed = m * np.array([[0, np.cos(a) * np.cos(b), 0], [np.cos(b), -np.sin(a) * np.sin(b), 0]])
        return max_difference(printed, truth), max_difference(length * printed, truth)

    return check_states(check)


@erratum("M12 (shape)")
def shape_of_the_coupling() -> tuple[float, float]:
    """Check M12: it is printed as 2 x 3, but multiplies two angles and gives three forces."""
    q, _ = split(random_states(1)[0])
    _, _, length, a, b = q
    rows = [[0, np.cos(b)], [np.cos(a) * np.cos(b), -np.sin(a) * np.sin(b)], [0, 0]]
    return float(abs(2 - 3)), max_difference(
        RIG.load_mass * length * np.array(rows), dynamics.mass_matrix(q, RIG)[:3, 3:]
    )


@erratum("M21 (shape)")
def shape_of_the_coupling_back() -> tuple[float, float]:
    """Check M21: it is printed as 2 x 2, but multiplies three accelerations; the missing column is zero."""
    q, _, qdd, m, coriolis, gravity, _ = motion_terms(random_states(1)[0])
    _, _, length, a, b = q
    rows = [[0, np.cos(a) * np.cos(b), 0], [np.cos(b), -np.sin(a) * np.sin(b), 0]]
    right = RIG.load_mass * length * np.array(rows)
    return float(abs(2 - len(qdd[:3]))), max_difference(
        right @ qdd[:3] + m[3:, 3:] @ qdd[3:] + (coriolis + gravity)[3:], 0.0
    )


@erratum("M22 > 0")
def positive_definite_where() -> tuple[float, float]:
    """Check M22 > 0: beta < pi/2 includes beta = -pi/2, where M22 is singular; |beta| < pi/2 does not."""

    def smallest(beta: float) -> float:
        return float(
            np.linalg.eigvalsh(dynamics.mass_matrix(np.array([0, 0, 0.7, 0.2, beta]), RIG)[3:, 3:])[0]
        )

    printed = [smallest(b) for b in np.linspace(-np.pi / 2, 1.5, 100)]
    right = [smallest(b) for b in np.linspace(-1.5, 1.5, 100)]
    return float(min(printed) < 1e-12), float(min(right) < 1e-12)


@erratum("C11")
def coriolis_of_hoisting_on_the_trolley() -> tuple[float, float]:
    """Check C11: -2 m (bd sa sb - ad ca cb), not -2 m bd sa sb - ad ca cb."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd = split(state)
        _, _, _, a, b = q
        _, _, rate, ad, bd = qd
        # C11 is the part of (C qd)_y that depends on l': subtract the centripetal part.
        without_hoisting = np.array([0.0, 0.0, 0.0, ad, bd])
        y = (
            dynamics.coriolis_matrix(q, qd, RIG) @ qd
            - dynamics.coriolis_matrix(q, without_hoisting, RIG) @ without_hoisting
        )[1]
        m = RIG.load_mass
        sines, cosines = np.sin(a) * np.sin(b), np.cos(a) * np.cos(b)
        printed = (-2 * m * bd * sines - ad * cosines) * rate
        return abs(printed - y), abs(-2 * m * (bd * sines - ad * cosines) * rate - y)

    return check_states(check)


@erratum("C12")
def centripetal_forces() -> tuple[float, float]:
    """Check C12: l and the row of x are missing, and the row of y has sin b in place of cos b."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd = split(state)
        _, _, length, a, b = q
        ad, bd = qd[3:]
        sa, ca, sb, cb = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
        without_hoisting = np.array([0.0, 0.0, 0.0, ad, bd])
        truth = (dynamics.coriolis_matrix(q, without_hoisting, RIG) @ without_hoisting)[:3]
        m = RIG.load_mass
        printed = m * np.array([[-ad * cb * sa, -bd * sb * sa], [-ad * cb**2, -bd]]) @ qd[3:]  # y and l
        right = m * length * np.array(
            [
                [0.0, -bd * sb],
                [-ad * cb * sa - bd * ca * sb, -bd * cb * sa - ad * ca * sb],
                [-ad * cb**2, -bd],
            ]
        ) @ qd[3:]  # fmt: skip
        return max_difference(printed, truth[1:]), max_difference(right, truth)

    return check_states(check)


@erratum("C21, C22")
def coriolis_blocks() -> tuple[float, float]:
    """Check C21, C22: l and a row are missing; C is not unique, so the check compares C q'."""

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
        return max_difference(printed, truth), max_difference(corrected, truth)

    return check_states(check)


@erratum("G1 (shape)")
def shape_of_gravity() -> tuple[float, float]:
    """Check G1: it is printed with four entries; the fourth belongs to G2."""
    q, _ = split(random_states(1)[0])
    three = [0.0, 0.0, -RIG.load_mass * G * np.cos(q[3]) * np.cos(q[4])]
    return float(abs(4 - 3)), max_difference(three, dynamics.gravity_vector(q, RIG)[:3])


@erratum("G2")
def gravity_torques() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        q, _ = split(state)
        _, _, length, a, b = q
        truth = dynamics.gravity_vector(q, RIG)[3:]
        printed = RIG.load_mass * G * np.array([np.sin(a) * np.cos(b), np.cos(a) * np.sin(b)])
        return max_difference(printed, truth), max_difference(length * printed, truth)

    return check_states(check)


@erratum("u before 2.12, y_c in 2.12")
def velocities_as_inputs() -> tuple[float, float]:
    """Check (2.12): with y_c' in place of y_c'' the angular accelerations are wrong."""

    def check(state: np.ndarray) -> tuple[float, float]:
        q, qd, qdd, *_ = motion_terms(state)
        common = (q[2], qd[2], q[3], qd[3], q[4], qd[4], INPUT[0])
        printed = dynamics.angular_accelerations(*common, qd[1], G)
        right = dynamics.angular_accelerations(*common, INPUT[1], G)
        return max_difference(printed, qdd[3:]), max_difference(right, qdd[3:])

    return check_states(check)


@erratum("2.12a")
def cardan_alpha() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, _, _, _, length, rate, a, ad, b, bd = state
        truth = motion_terms(state)[2][3]
        rest = 2 * length * ad * bd * np.sin(b) - G * np.sin(a) - np.cos(a) * INPUT[1]
        printed = rest / (length * np.cos(b) + 2 * length)  # alpha'' on both sides, solved for it
        corrected = (rest - 2 * rate * ad * np.cos(b)) / (length * np.cos(b))
        return abs(printed - truth), abs(corrected - truth)

    return check_states(check)


@erratum("2.12b")
def cardan_beta() -> tuple[float, float]:
    def check(state: np.ndarray) -> tuple[float, float]:
        _, _, _, _, length, rate, a, ad, b, bd = state
        truth = motion_terms(state)[2][4]
        rest = (
            -length * ad**2 * np.sin(b) * np.cos(b) - np.cos(b) * INPUT[0] + np.sin(a) * np.sin(b) * INPUT[1]
        )
        gravity = G * np.cos(a) * np.sin(b)
        printed = (gravity - 2 * length * bd + rest) / length
        corrected = (-gravity - 2 * rate * bd + rest) / length
        return abs(printed - truth), abs(corrected - truth)

    return check_states(check)

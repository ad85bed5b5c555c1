"""The equations of motion equal their derivation, and have the properties of a mechanical system."""

import runpy

import numpy as np
import pytest

from cranectl.model import dynamics
from cranectl.scenario.rig import RigParameters
from tests.conftest import ROOT, random_states, split

RIG = RigParameters(bridge_mass=5.0, trolley_mass=2.0, winch_mass=0.3, load_mass=1.7, gravity=9.7)
STEP = 1e-6


@pytest.mark.slow
def test_derivation_from_the_lagrangian_equals_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """The derivation also notices a wrong sign."""
    derivation = runpy.run_path(str(ROOT / "validation" / "proofs" / "derivations" / "lagrange.py"))
    equations = derivation["derive"]()
    derivation["check_identities"](equations)
    assert derivation["check_code"](equations, samples=1000) < 1e-12
    right = dynamics.angular_accelerations
    monkeypatch.setattr(dynamics, "angular_accelerations", lambda *a: (right(*a)[0], -right(*a)[1]))
    with pytest.raises(AssertionError, match="cardan"):
        derivation["check_code"](equations, samples=5)


def test_jacobian_is_the_derivative_of_the_load_position() -> None:
    for state in random_states(50):
        q, qd = split(state)
        numeric = np.array(
            [
                (dynamics.load_position(q + STEP * e) - dynamics.load_position(q - STEP * e)) / (2 * STEP)
                for e in np.eye(5)
            ]
        ).T
        assert dynamics.load_jacobian(q) == pytest.approx(numeric, abs=1e-8)
        rate = (dynamics.load_jacobian(q + STEP * qd) - dynamics.load_jacobian(q - STEP * qd)) / (2 * STEP)
        assert dynamics.load_jacobian_rate(q, qd) == pytest.approx(rate, abs=1e-8)


def test_mass_matrix_is_symmetric_positive_definite_and_rate_minus_twice_coriolis_is_skew() -> None:
    for state in random_states(200):
        q, qd = split(state)
        mass = dynamics.mass_matrix(q, RIG)
        assert mass == pytest.approx(mass.T, abs=1e-14)
        assert np.linalg.eigvalsh(mass).min() > 0.0
        rate = (dynamics.mass_matrix(q + STEP * qd, RIG) - dynamics.mass_matrix(q - STEP * qd, RIG)) / (
            2 * STEP
        )
        skew = rate - 2.0 * dynamics.coriolis_matrix(q, qd, RIG)
        assert skew + skew.T == pytest.approx(np.zeros((5, 5)), abs=1e-7)


def test_forces_of_the_drives_are_those_of_the_manipulator_form_and_back() -> None:
    """F = P u + w, P = M_aa - M_au M_uu^-1 M_ua, at 1000 states, and its inverse."""
    masses, rng = dynamics.axis_masses(RIG), np.random.default_rng(6)
    for state in random_states(1000, seed=6):
        q, qd = split(state)
        mass, u = dynamics.mass_matrix(q, RIG), rng.normal(size=3)
        bias = dynamics.coriolis_matrix(q, qd, RIG) @ qd + dynamics.gravity_vector(q, RIG)
        coupling = mass[:3, 3:] @ np.linalg.inv(mass[3:, 3:])
        expected = (mass[:3, :3] - coupling @ mass[3:, :3]) @ u + bias[:3] - coupling @ bias[3:]
        forces = np.array(dynamics.drive_forces(masses, state, *u))
        scale = max(1.0, np.abs(mass).max(), np.abs(bias).max())
        assert np.abs(forces - expected).max() < 1e-12 * scale
        again = np.array(dynamics.forced_accelerations(masses, state, *forces))
        assert np.abs(again - u).max() < 1e-12 * scale
        hoist = dynamics.winch_force(masses, state, forces[0], forces[1], u[2])
        assert abs(hoist - forces[2]) < 1e-12 * scale


def test_power_balance() -> None:
    """d/dt (T + V) = qd · F for any force F."""
    rng = np.random.default_rng(3)
    for state in random_states(100):
        q, qd = split(state)
        force = rng.normal(size=5)
        bias = dynamics.coriolis_matrix(q, qd, RIG) @ qd + dynamics.gravity_vector(q, RIG)
        qdd = np.linalg.solve(dynamics.mass_matrix(q, RIG), force - bias)

        def energy(time: float, q=q, qd=qd, qdd=qdd) -> float:
            position, velocity = q + time * qd + 0.5 * time**2 * qdd, qd + time * qdd
            return dynamics.kinetic_energy(position, velocity, RIG) + dynamics.potential_energy(position, RIG)

        power = (energy(STEP) - energy(-STEP)) / (2 * STEP)
        assert power == pytest.approx(qd @ force, abs=1e-6 * max(1.0, abs(qd @ force)))


def test_mass_free_accelerations_and_tension_follow_from_the_manipulator_form() -> None:
    """The unactuated rows give the cardan accelerations, (2.11); the rope row gives the tension."""
    rng = np.random.default_rng(4)
    for state in random_states(1000):
        q, qd = split(state)
        u = rng.normal(size=3)
        mass = dynamics.mass_matrix(q, RIG)
        bias = dynamics.coriolis_matrix(q, qd, RIG) @ qd + dynamics.gravity_vector(q, RIG)
        expected = np.linalg.solve(mass[3:, 3:], -mass[3:, :3] @ u - bias[3:])
        actual = dynamics.angular_accelerations(
            q[2], qd[2], q[3], qd[3], q[4], qd[4], u[0], u[1], RIG.gravity
        )
        assert np.array(actual) == pytest.approx(expected, rel=1e-10, abs=1e-10)
        winch_force = (mass @ np.array([*u, *expected]) + bias)[2]
        tension = dynamics.rope_tension(q, qd, u, RIG)
        assert tension == pytest.approx(RIG.winch_mass * u[2] - winch_force, rel=1e-10, abs=1e-10)

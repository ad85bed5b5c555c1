"""The flat map and the linearising control law agree with accurate integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cranectl.model import dynamics, flatness
from cranectl.reference import Trajectory
from cranectl.scenario import ReferenceSettings
from tests.conftest import random_states, split

G = 9.81
C4_REFERENCES = {
    "clockwise turn": {
        "start": [1.65, 0.77, -0.7],
        "segments": [{"kind": "arc", "centre": [1.0, 0.77], "angle": -6.2831853, "duration": 8.0}],
    },
    "line, hold, arc, line": {
        "start": [0.2, 0.3, -0.4],
        "segments": [
            {"kind": "line", "to": [1.6, 0.8, -1.1], "duration": 5.0},
            {"kind": "hold", "duration": 1.0},
            {"kind": "arc", "centre": [1.2, 0.8], "angle": 3.5, "duration": 5.0},
            {"kind": "line", "to": [0.5, 0.5, -0.6], "duration": 5.0},
        ],
    },
}


def state_derivative(state: np.ndarray, u: np.ndarray) -> np.ndarray:
    alpha_ddot, beta_ddot = dynamics.angular_accelerations(*state[4:10], u[0], u[1], G)
    rate = np.empty(10)
    rate[0::2] = state[1::2]
    rate[1::2] = [*u, alpha_ddot, beta_ddot]
    return rate


@pytest.mark.parametrize("name", C4_REFERENCES)
def test_feed_forward_reproduces_every_c4_reference(name: str) -> None:
    """The open loop is integrated to 1e-12, so that any difference is an error of the map."""
    trajectory = Trajectory.of(ReferenceSettings.model_validate(C4_REFERENCES[name]))

    def feed_forward(time: float) -> tuple[np.ndarray, np.ndarray]:
        states, inputs = flatness.states_and_inputs(trajectory.sample(np.array([time])), G)
        return states[0], inputs[0]

    end = trajectory.joints[-1]
    state = feed_forward(0.0)[0]
    for start, stop in zip(trajectory.joints[:-1], trajectory.joints[1:], strict=True):
        solution = solve_ivp(
            lambda time, x: state_derivative(x, feed_forward(min(time, end))[1]), (start, stop), state,
            method="DOP853", rtol=1e-12, atol=1e-12,
        )  # fmt: skip
        state = solution.y[:, -1]
    expected = trajectory.sample(np.array([end]))[0, :3]
    q, _ = split(state)
    assert np.linalg.norm(dynamics.load_position(q) - expected) < 1e-6


def test_round_trip_state_to_flat_output_and_back() -> None:
    rng = np.random.default_rng(5)
    for state in random_states(2000):
        flat, back, inputs = np.zeros(15), np.zeros(10), np.zeros(3)
        zeta, zeta_dot, v = rng.normal(), rng.normal(), 5.0 * rng.normal(size=3)
        flatness.flat_output(state, zeta, zeta_dot, G, flat)
        flat[12:] = v
        flatness.state_and_input(flat, G, back, inputs)
        assert back == pytest.approx(state, abs=1e-9)
        accelerations = flatness.linearising_input(state, zeta, zeta_dot, *v, G)
        assert inputs == pytest.approx(np.array(accelerations), abs=1e-9)


def test_flat_output_is_the_load_position_and_velocity() -> None:
    for state in random_states(100):
        flat = np.zeros(15)
        flatness.flat_output(state, 0.3, -0.2, G, flat)
        q, qd = split(state)
        assert flat[:3] == pytest.approx(dynamics.load_position(q), abs=1e-12)
        assert flat[3:6] == pytest.approx(dynamics.load_velocity(q, qd), abs=1e-12)


def test_under_the_law_the_fourth_derivative_equals_v() -> None:
    """Closed loop with constant v: the load must follow the quartic polynomial exactly."""
    rng = np.random.default_rng(7)
    duration = 0.1
    for state in 0.5 * random_states(20) + 0.5 * np.array([1, 0, 0.77, 0, 0.8, 0, 0, 0, 0, 0]):
        zeta, zeta_dot, v = 0.5 * rng.normal(), rng.normal(), 10.0 * rng.normal(size=3)
        flat = np.zeros(15)
        flatness.flat_output(state, zeta, zeta_dot, G, flat)

        def closed_loop(_: float, x: np.ndarray, v: np.ndarray = v) -> np.ndarray:
            u = flatness.linearising_input(x[:10], x[10], x[11], *v, G)
            return np.concatenate([state_derivative(x[:10], np.array(u)), [x[11], v[2]]])

        end = solve_ivp(
            closed_loop, (0, duration), [*state, zeta, zeta_dot], method="DOP853", rtol=1e-13, atol=1e-13
        ).y[:, -1]
        z, z_dot, z_ddot, z_d3 = flat[:12].reshape(4, 3)
        polynomial = (
            z + z_dot * duration + z_ddot * duration**2 / 2 + z_d3 * duration**3 / 6 + v * duration**4 / 24
        )
        assert dynamics.load_position(split(end[:10])[0]) == pytest.approx(polynomial, abs=1e-10)

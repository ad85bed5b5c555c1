"""What laws are made of, apart from the loops that run them."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from cranectl.controllers.lqr_integral import GAIN, STATES, feedback, matrices
from cranectl.controllers.pid import VIBRATION, impulses
from cranectl.controllers.registry import controller_design
from cranectl.model.dynamics import angular_accelerations
from cranectl.scenario import default_scenario
from cranectl.signals import ALPHA, BETA, BRIDGE, TROLLEY
from cranectl.simulate import linearised_law

LENGTH = 0.725  # [m], the middle of the rig's range
PERIOD = 1.7  # [s]


def vibration(shaper: str, frequency: float) -> float:
    """What impulses leave of a swing, to that of one impulse (Singer and Seering 1990, (7), undamped)."""
    amplitudes, times = impulses(shaper, PERIOD)
    return float(abs(sum(a * np.exp(1j * frequency * t) for a, t in zip(amplitudes, times, strict=True))))


@pytest.mark.parametrize("shaper", ["zv", "zvd", "ei"])
def test_shapers_are_what_their_papers_say(shaper: str) -> None:
    omega = 2.0 * np.pi / PERIOD
    amplitudes, times = impulses(shaper, PERIOD)
    assert sum(amplitudes) == pytest.approx(1.0, abs=1e-15)
    assert times == pytest.approx([0.0, 0.5 * PERIOD, PERIOD][: len(times)])
    left = {"zv": 0.0, "zvd": 0.0, "ei": VIBRATION}[shaper]
    assert vibration(shaper, omega) == pytest.approx(left, abs=1e-15)
    slope = (vibration(shaper, omega * 1.0001) - left) / 0.0001
    assert abs(slope) == pytest.approx(0.5 * np.pi if shaper == "zv" else 0.0, abs=1e-3), "robust but for ZV"
    if shaper == "ei":
        beside = np.arccos(-(1.0 - VIBRATION) / (1.0 + VIBRATION)) / np.pi  # where its zeros are
        assert 0.8 < beside < 0.9
        assert vibration(shaper, omega * beside) == pytest.approx(0.0, abs=1e-15)
        assert vibration(shaper, omega * (2.0 - beside)) == pytest.approx(0.0, abs=1e-15)


def test_the_model_is_the_plant_linearised() -> None:
    """By central differences of the equations of motion about rest."""

    def rates(x: np.ndarray, u: float) -> np.ndarray:
        _, beta_ddot = angular_accelerations(LENGTH, 0.0, 0.0, 0.0, x[2], x[3], u, 0.0, 9.81)
        return np.array([x[1], u, x[3], beta_ddot, x[0] + LENGTH * np.sin(x[2])])

    def outputs(x: np.ndarray) -> np.ndarray:
        error, rate = x[0] + LENGTH * np.sin(x[2]), x[1] + LENGTH * np.cos(x[2]) * x[3]
        return np.array([error, rate, x[4]])

    small, rest = 1e-5, np.zeros(STATES)
    a, b, c = matrices(LENGTH, 9.81)
    for k, step in enumerate(small * np.eye(STATES)):
        assert a[:, k] == pytest.approx((rates(step, 0.0) - rates(-step, 0.0)) / (2.0 * small), abs=1e-8)
        assert c[:, k] == pytest.approx((outputs(step) - outputs(-step)) / (2.0 * small), abs=1e-8)
    assert b[:, 0] == pytest.approx((rates(rest, small) - rates(rest, -small)) / (2.0 * small), abs=1e-8)


def test_the_gain_is_optimal() -> None:
    """The cost x'Px of the simulated linear loop grows with any change of the gain."""
    scenario = default_scenario()
    law = linearised_law(scenario, controller_design("lqr-integral", scenario))[1]
    values = controller_design("lqr-integral", scenario).parameters
    _, _, c = matrices(law.rope_length, 9.81)
    weights = np.diag([values[f"{name}_weight"] for name in ("error", "rate", "integral")])

    def cost(gain: np.ndarray) -> float:
        closed = law.a - law.b @ gain[np.newaxis]
        stage = c.T @ weights @ c + values["input_weight"] * np.outer(gain, gain)
        return float(np.trace(solve_continuous_lyapunov(closed.T, -stage)))

    best = cost(law.gain)
    for k in range(5):
        for factor in (0.98, 1.02):
            changed = law.gain.copy()
            changed[k] *= factor
            assert cost(changed) > best


@pytest.mark.parametrize(("joint", "angle"), [(BRIDGE, BETA), (TROLLEY, ALPHA)])
def test_feedback_is_gain_times_deviation_between_two_lengths(joint: int, angle: int) -> None:
    rng = np.random.default_rng(4)
    gains, measured, desired = rng.normal(size=(3, STATES)), rng.normal(size=12), rng.normal(size=10)
    parameters = np.concatenate([np.zeros(GAIN), gains.ravel()])
    deviation = np.append((measured[:10] - desired)[[joint, joint + 1, angle, angle + 1]], 0.3)
    for row, share in ((0, 0.0), (0, 0.25), (1, 1.0)):
        gain = (1.0 - share) * gains[row] + share * gains[row + 1]
        given = feedback(parameters, measured, desired, 0.3, joint, angle, row, share)
        assert given == pytest.approx(gain @ deviation, rel=1e-12)

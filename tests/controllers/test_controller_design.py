"""Parts of controllers, without the loops that run them."""

import numpy as np
import pytest
from scipy.linalg import expm

from cranectl.controllers.controller import Nominal
from cranectl.controllers.flat import MEMORY, begin, control_step, make_tracker
from cranectl.controllers.flat_velocity import lead_times, linear_gain, set_points
from cranectl.controllers.lqr_integral import PARAMETERS, STATES, feedback, matrices
from cranectl.controllers.pid import VIBRATION, impulses
from cranectl.design import design_controller
from cranectl.model.dynamics import angular_accelerations
from cranectl.plants.plant import Drive
from cranectl.scenario.load import default_scenario
from cranectl.signals import ALPHA, BETA, BRIDGE, COLUMN, ROPE, TROLLEY
from cranectl.status import RunStatus
from tests.conftest import random_states

LENGTH = 0.725  # [m], the middle of the rig's range
PERIOD = 1.7  # [s]


def vibration(shaper: str, frequency: float) -> float:
    """Return the residual swing of impulses over that of one impulse (Singer and Seering 1990, (7))."""
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
    """The model equals central differences of the equations of motion about rest."""

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


@pytest.mark.parametrize(("joint", "angle"), [(BRIDGE, BETA), (TROLLEY, ALPHA)])
def test_feedback_is_gain_times_deviation_between_two_lengths(joint: int, angle: int) -> None:
    rng = np.random.default_rng(4)
    gains, measured, desired = rng.normal(size=(3, STATES)), rng.normal(size=12), rng.normal(size=10)
    parameters = PARAMETERS.array(gain=gains)
    deviation = np.append((measured[:10] - desired)[[joint, joint + 1, angle, angle + 1]], 0.3)
    for row, share in ((0, 0.0), (0, 0.25), (1, 1.0)):
        gain = (1.0 - share) * gains[row] + share * gains[row + 1]
        computed = feedback(parameters, measured, desired, 0.3, joint, angle, row, share)
        assert computed == pytest.approx(gain @ deviation, rel=1e-12)


FLAT = make_tracker(design_controller("pole-placement"), period=0.001, gravity=9.81)
LEAD = np.array([0.02, 0.03, 0.05])


def begun(reference: np.ndarray) -> np.ndarray:
    """Return the memory of the tracker at the start of `reference`."""
    memory = np.zeros(MEMORY.robustifier)
    begin(reference, memory)
    return memory


def accelerations(measured: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return (w - x') / T of the drives, with the set-points of the flat tracker."""
    command, row = np.zeros(3), np.zeros(COLUMN.width)
    set_points(FLAT, LEAD, measured, reference, begun(reference), row, command)
    return (command - measured[1:6:2]) / LEAD


def test_set_points_of_measured_velocity_bring_about_what_the_tracker_asks() -> None:
    reference = np.append([1.0, 0.8, -0.7], 0.3 * np.random.default_rng(6).normal(size=12))
    for state in random_states(20):
        row = np.zeros(COLUMN.width)
        control_step(FLAT, state, reference, begun(reference), row)
        computed = accelerations(np.append(state, [0.0, 0.0]), reference)
        assert computed == pytest.approx(row[COLUMN.input : COLUMN.input + 3], rel=1e-10, abs=1e-10)


def test_a_tracker_that_asks_for_a_slack_rope_says_so() -> None:
    reference, extension, row = np.zeros(15), np.array([-10.0, 0.0, 1.0, 0.0]), np.zeros(COLUMN.width)
    measured = np.append(random_states(1)[0], [0.0, 0.0])
    assert set_points(FLAT, LEAD, measured, reference, extension, row, np.zeros(3)) == RunStatus.SLACK_ROPE


@pytest.mark.parametrize(("joint", "angle"), [(BRIDGE, BETA), (TROLLEY, ALPHA)])
def test_the_linear_gain_of_the_flat_law_is_its_derivative_at_rest(joint: int, angle: int) -> None:
    rest, reference, small = np.zeros(12), np.zeros(15), 1e-5
    rest[ROPE], reference[2] = LENGTH, -LENGTH
    gain = linear_gain(FLAT.gain, LENGTH, 9.81)
    for k, index in enumerate((joint, joint + 1, angle, angle + 1)):
        step = small * np.eye(12)[index]
        change = accelerations(rest + step, reference) - accelerations(rest - step, reference)
        assert gain[k] == pytest.approx(-change[joint // 2] / (2.0 * small), rel=1e-7)


@pytest.mark.parametrize("drive", ["ideal", "velocity"])
def test_leads_make_the_velocity_of_a_drive_rise_by_what_is_asked(drive: Drive) -> None:
    """Velocity drives hold the set-point over a long period; for others it is divided by the lag."""
    rig, period, velocity, acceleration = default_scenario().rig, 0.01, 0.4, 0.7
    nominal = Nominal(rig, drive, period, np.zeros((1, 15)), np.zeros(10), {})
    for lag, lead in zip(rig.time_constants, lead_times(nominal), strict=True):
        set_point = velocity + lead * acceleration
        held = expm(period * np.array([[-1.0, 1.0], [0.0, 0.0]]) / lag) @ [velocity, set_point]
        rise = held[0] - velocity if drive == "velocity" else (set_point - velocity) / lag * period
        assert rise == pytest.approx(period * acceleration, rel=1e-12)

"""The observer against its own theory: poles, gains, error bounds, and motions that it follows."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cranectl.controllers.observer import (
    EXPECTED,
    Observer,
    correct,
    initial_estimate,
    make_observer,
    predict,
)
from cranectl.plants.analytic import AnalyticPlant
from cranectl.scenario.rig import RigParameters

PERIOD, GRAVITY, BANDWIDTH = 1e-3, 9.81, 60.0


@pytest.fixture
def observer() -> Observer:
    return make_observer(BANDWIDTH, period=PERIOD, gravity=GRAVITY)


def follow(observer: Observer, positions: np.ndarray, accelerations: np.ndarray) -> np.ndarray:
    """Return the estimates (N, 15) after each measurement of the five joints (N, 5)."""
    memory = initial_estimate(np.column_stack([positions[0], np.zeros(5)]).ravel())
    estimates = np.empty((len(positions), EXPECTED.size))
    for k, row in enumerate(positions):
        for joint in range(5):
            correct(observer, joint, row[joint], memory)
        estimates[k] = memory
        predict(observer, accelerations[k], memory)
    return estimates


def bridge(positions: np.ndarray) -> np.ndarray:
    """Return positions of all joints of a crane if only the bridge moves; alpha and beta are 0."""
    rows = np.tile([0.0, 0.0, 0.7, 0.0, 0.0], (len(positions), 1))
    rows[:, 0] = positions
    return rows


def error_dynamics(observer: Observer) -> np.ndarray:
    """Return the matrix of one step of the error (position, velocity, disturbance) of a joint."""
    model = np.array([[1.0, PERIOD, 0.5 * PERIOD**2], [0.0, 1.0, PERIOD], [0.0, 0.0, 1.0]])
    gain = np.array([observer.position_gain, observer.velocity_gain, observer.disturbance_gain])
    # The disturbance gain is on d itself; the model adds T d to the velocity in each step.
    return (np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])) @ model


def test_all_poles_are_where_they_are_said_to_be(observer: Observer) -> None:
    polynomial = np.poly(error_dynamics(observer))
    assert_allclose(polynomial, np.poly([np.exp(-BANDWIDTH * PERIOD)] * 3), atol=1e-9)


def test_a_measurement_corrects_its_own_joint_by_the_gains(observer: Observer) -> None:
    memory = np.arange(1.0, 16.0)
    before = memory.copy()
    correct(observer, 2, 3.7, memory)
    gains = [observer.position_gain, observer.velocity_gain, observer.disturbance_gain]
    places = [EXPECTED.position + 2, EXPECTED.velocity + 2, EXPECTED.disturbance + 2]
    assert_allclose((memory - before)[places], 0.7 * np.array(gains), rtol=1e-12)
    assert np.count_nonzero(memory - before) == 3


def test_a_step_of_the_disturbance_stays_within_its_bounds(observer: Observer) -> None:
    """The error also comes near the bounds, else they would prove nothing."""
    time, step = PERIOD * np.arange(600), 2.0
    positions = bridge(0.5 * step * time**2)
    estimates = follow(observer, positions, np.zeros((len(time), 3)))
    velocity = np.abs(estimates[:, EXPECTED.velocity] - step * time).max()
    position = np.abs(estimates[:, EXPECTED.position] - positions[:, 0]).max()
    assert 0.9 < velocity / (0.84 * step / BANDWIDTH) <= 1.0
    assert 0.8 < position / (0.27 * step / BANDWIDTH**2) <= 1.0
    late = time > 12.0 / BANDWIDTH
    assert np.abs(estimates[late, EXPECTED.velocity] - step * time[late]).max() < 0.05 * step / BANDWIDTH


def test_what_moves_the_trolley_is_not_taken_for_a_disturbance_of_the_angles(observer: Observer) -> None:
    """All drives have commanded and unknown accelerations, both angles swing, and the rope moves."""
    commanded, unknown = np.array([4.0, -3.0, 0.5]), np.array([2.0, 2.5, 1.0])
    plant = AnalyticPlant(RigParameters(), drive="ideal", step=PERIOD, substeps=1)
    state = np.array([0.3, 0.0, 1.2, 0.0, 0.6, 0.2, 0.25, 1.5, -0.2, -1.0])
    plant.reset(state)
    memory, load = initial_estimate(state), np.zeros(7)
    for _ in range(350):
        plant.measure(state)
        for joint in range(5):
            correct(observer, joint, state[2 * joint], memory)
        left = memory.copy()
        predict(observer, commanded, memory)
        plant.advance(commanded + unknown, np.zeros(2), np.zeros(6), load)
    assert_allclose(left[EXPECTED.disturbance : EXPECTED.disturbance + 3], unknown, atol=1e-5)
    assert_allclose(left[EXPECTED.disturbance + 3 :], 0.0, atol=1e-3)
    assert_allclose(left[EXPECTED.velocity : EXPECTED.disturbance], state[1::2], atol=3e-5)

"""Test `mppi`: random numbers, average against the closed form, repeated runs, and observed disturbances."""

import numpy as np
import pytest

from tests.benchmark.runs import simulate
from validation.benchmark.mppi import KNOTS, MEMORY, PARAMETERS, STEPS, cost, normal, plan, uniform

CONTROLLER = "mppi.py:MPPI"


def test_random_numbers_are_those_of_park_and_miller() -> None:
    """Park and Miller give this check of an implementation: from seed 1, number 10 000 is 1043618065."""
    memory = np.array([1.0])
    for _ in range(10_000):
        uniform(memory)
    assert memory[MEMORY.seed] == 1043618065.0
    samples = np.array([normal(memory) for _ in range(40_000)])
    moments = [np.mean(samples**k) for k in (1, 2, 3, 4)]
    np.testing.assert_allclose(moments, [0.0, 1.0, 0.0, 3.0], atol=0.1)


def test_average_agrees_with_closed_form_for_quadratic_cost() -> None:
    """Normal weights and normal paths give the precision 1/s² + H/T, with H the cost's second derivative."""
    noise, gravity, temperature = 0.1, 9.81, 0.02
    parameters = PARAMETERS.array(
        period=0.02, gravity=gravity, noise=noise, temperature=temperature, rate=0.3, effort=0.1
    )
    lengths = np.column_stack([np.linspace(1.2, 0.6, STEPS), np.full(STEPS, -0.6)])
    start, push = np.array([0.1, -0.2, 0.05, 0.3]), 0.5
    planned = np.linspace(-1.0, 1.0, KNOTS)

    def s(knots: np.ndarray) -> float:
        return cost(parameters, lengths, start, push, knots)

    one, zero = np.eye(KNOTS), s(np.zeros(KNOTS))
    slope = np.array([0.5 * (s(row) - s(-row)) for row in one])
    curve = np.array([[s(a + b) - s(a) - s(b) + zero for a in one] for b in one])
    precision = (noise * gravity) ** -2 * one
    expected = np.linalg.solve(precision + curve / temperature, precision @ planned - slope / temperature)
    average, memory = planned.copy(), np.array([1.0])
    plan(parameters, lengths, start, push, average, memory, 100_000)
    assert np.abs(expected - planned).max() > 0.4, "the average differs from the previous plan"
    np.testing.assert_allclose(average, expected, atol=0.03)


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_observed_disturbance_leaves_small_error(plant: str) -> None:
    errors = []
    for setting in ("effects.sensing.angle_noise=0.0", "duration=25.0"):  # with an observer, and without
        run = simulate(CONTROLLER, setting, plant=plant, drive="velocity")
        errors.append(np.abs(run.block("error")[run.time > 23.0, :2]).max())
    assert errors[0] < 0.005
    assert errors[1] > 0.05


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_load_returns_and_runs_repeat(plant: str) -> None:
    overrides = ["disturbances=[]", "duration=6.0", "initial.load_offset=[0.1, -0.05, 0.02]"]
    first, second = (simulate(CONTROLLER, *overrides, plant=plant, drive="velocity") for _ in range(2))
    late = np.linalg.norm(first.block("error")[first.time > 5.0, :3], axis=1)
    assert late.max() < 0.003
    np.testing.assert_array_equal(first.table, second.table)

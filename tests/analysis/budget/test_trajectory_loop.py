"""The linearised loop against small real deviations, and the tools that carry signals through it."""

import functools

import numpy as np
import pytest

from cranectl.analysis.budget.bounded_signals import (
    Estimator,
    joined_matrices,
    linear_estimator,
    load_variance,
    loop_matrices,
    observed_error,
    worst_friction,
    worst_load_error,
)
from cranectl.analysis.budget.propagation import FrictionPort, no_errors, propagate
from cranectl.analysis.budget.trajectory_loop import TrajectoryLoop, linearise_run, nominal_run
from cranectl.controllers.observer import make_observer
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.simulate.signal_path import Encoders

HOISTING = [
    "duration=3.0", "disturbances.0.magnitude=2.0", "disturbances.0.start=0.5", "disturbances.0.end=0.8",
]  # fmt: skip


@functools.cache
def nominal(controller: str) -> tuple[Run, TrajectoryLoop]:
    run = simulate_run(
        load_scenario("fast-diagonal", overrides=HOISTING), plant="analytic", controller=controller
    )
    return run, linearise_run(run)


@pytest.mark.parametrize("controller", ["lqr", "pole-placement+loop-shaping", "lqr+hinf"])
@pytest.mark.parametrize("offset", ["alpha_offset=1e-6", "beta_offset=1e-6", "load_offset=[1e-6,2e-6,-1e-6]"])
def test_a_small_start_error_develops_as_predicted(controller: str, offset: str) -> None:
    run, loop = nominal(controller)
    moved = simulate_run(
        load_scenario("fast-diagonal", overrides=[*HOISTING, f"initial.{offset}"]),
        plant="analytic",
        controller=controller,
    )
    x = np.zeros(loop.size)
    x[:10] = moved.block("state")[0] - run.block("state")[0]
    for matrix in loop_matrices(loop, np.arange(len(run.time_ns) - 1)):
        x = matrix @ x
    found = moved.block("state")[-1] - run.block("state")[-1]
    assert np.abs(found).max() > 1e-9
    assert np.abs(x[:10] - found).max() < 1e-3 * np.abs(found).max()
    memory = moved.block("controller")[-1] - run.block("controller")[-1]
    assert np.abs(x[13:] - memory).max() < 1e-3 * np.abs(memory).max()


def test_a_delay_is_a_delay() -> None:
    """A command error of one sample reaches the plant so many samples later."""
    _, loop = nominal("lqr")
    ports = no_errors(loop)
    ports.command[100, 1] = 1.0
    late = propagate(loop._replace(delay=7), ports)
    assert np.flatnonzero(late.drive[:, 1])[0] == 107
    assert late.drive[107, 1] == 1.0


def estimator(run: Run) -> Estimator:
    return linear_estimator(make_observer(60.0, period=1e-3, gravity=run.scenario.rig.gravity))


def test_linear_estimator_is_the_observer() -> None:
    """Of the load at rest, where the equations of motion hardly couple the joints."""
    run = simulate_run(
        load_scenario("fixed-position", overrides=["duration=0.3", "disturbances=[]"]),
        plant="analytic",
        controller="lqr",
    )
    noise = 1e-6 * np.random.default_rng(3).standard_normal((len(run.time_ns), 5))
    observer = make_observer(60.0, period=1e-3, gravity=9.81)
    error = observed_error(
        observer, Encoders(np.zeros(5), noise), run.block("state"), run.block("input")[:-1, :3]
    )
    linear, state = estimator(run), np.zeros(3)
    for k in range(len(noise)):
        output = linear.output_by_state @ state + linear.output_by_noise * noise[k, 0]
        assert np.abs(output - error[k, :2]).max() < 1e-12
        state = linear.next_by_state @ state + linear.next_by_noise * noise[k, 0]
    largest = np.abs(error).max(axis=0)
    assert largest[6:] == pytest.approx(largest[[0, 1, 0, 1]], rel=0.6)


def test_variance_is_that_of_many_seeds() -> None:
    run, loop = nominal("lqr")
    deviations = np.array([1e-5, 2e-5, 1e-5, 1e-4, 1e-4])
    predicted = load_variance(loop, estimator(run), deviations)
    linear, total = estimator(run), np.zeros_like(predicted)
    for seed in range(30):
        noise = deviations * np.random.default_rng(seed).standard_normal((len(predicted), 5))
        ports, state = no_errors(loop), np.zeros((3, 5))
        for k, row in enumerate(noise):
            output = linear.output_by_state @ state + np.outer(linear.output_by_noise, row)
            ports.measured[k, 0::2], ports.measured[k, 1::2] = output
            state = linear.next_by_state @ state + np.outer(linear.next_by_noise, row)
        total += np.square(propagate(loop, ports).load) / 30
    later = slice(500, None)
    assert total[later].mean(axis=0) == pytest.approx(predicted[later].mean(axis=0), rel=0.3)


def test_worst_case_is_the_sum_of_all_impulse_responses() -> None:
    run = simulate_run(
        load_scenario("off-reference", overrides=["duration=0.06", "reference.segments=[]"]),
        plant="analytic",
        controller="lqr",
    )
    loop, linear = linearise_run(run), estimator(run)
    amplitudes = np.array([1.0, 0.5, 2.0, 1.0, 3.0])
    expected = np.zeros(3)
    matrices, noise = joined_matrices(loop, linear, np.arange(60))
    for start in range(60):
        for joint in range(5):
            state = noise[start, :, joint]
            for matrix in matrices[start + 1 :]:
                state = matrix @ state
            expected += amplitudes[joint] * np.abs(loop.load[60] @ state[:10])
    assert worst_load_error(loop, np.tile(amplitudes, (60, 1)), 24, estimator=linear).max(
        axis=0
    ) == pytest.approx(expected)


def test_worst_friction_is_the_sum_of_all_impulse_responses() -> None:
    scenario = load_scenario("off-reference", overrides=["duration=0.05", "reference.segments=[]"])
    loop = nominal_run(scenario, "lqr").with_servos("rope")._replace(delay=3)
    samples = loop.samples - 1
    limits = np.array([1e-3, 2e-3, 1e-3, 0.1, 0.2])
    friction = FrictionPort(np.zeros((samples + 1, 5)), np.zeros((samples, 5)), np.tile(limits, (samples, 1)))
    expected = np.zeros(3)
    for start in range(samples):
        for port in range(5):
            ports = no_errors(loop)
            if port < 3:
                ports.drive[start, port] = limits[port]
            else:
                ports.disturbance[start, port - 3] = limits[port]
            expected += np.abs(propagate(loop, ports).load[-1] - loop.load_offset[-1])
    found = worst_friction(loop, friction, propagate(loop, no_errors(loop)))
    assert found == pytest.approx(np.linalg.norm(expected), rel=1e-9)


@pytest.mark.parametrize("delay", [0, 2])
def test_the_loop_matrix_is_the_propagation(delay: int) -> None:
    """An error of the measurement acts through the tracker's part of the matrix alone."""
    where = nominal_run(
        load_scenario("off-reference", overrides=["duration=0.05", "reference.segments=[]"]), "lqr+hinf"
    )
    loop, rng = where.with_servos("body")._replace(delay=delay), np.random.default_rng(2)
    ports, p = no_errors(loop), len(loop.moving)
    ports.local[:] = 1e-6 * rng.standard_normal(ports.local.shape)
    ports.measured[:] = 1e-6 * rng.standard_normal(ports.measured.shape)
    found = propagate(loop, ports).state
    x = np.zeros(loop.size + 3 * delay)
    for k, matrix in enumerate(loop_matrices(loop, np.arange(loop.samples - 1))):
        tracker = matrix[:, :10].copy()
        tracker[:p] -= loop.by_state[k // loop.stride][:, :10]
        x = matrix @ x + tracker @ ports.measured[k]
        x[: loop.size] += ports.local[k]
        assert np.abs(x[: loop.size] - found[k + 1]).max() < 1e-14

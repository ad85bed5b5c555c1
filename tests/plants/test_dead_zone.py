"""Velocity drives that stand still for set-points below a speed: all plants, to 1e-7 m and rad."""

import functools

import numpy as np
import pytest

from cranectl.compare.runs import compare_runs
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from tests.conftest import PLANTS

ZONE = (0.02, 0.03, 0.01)


@functools.cache
def run_with(zone: tuple[float, ...], plant: str, controller: str, *more: str) -> Run:
    overrides = [f"effects.installation.dead_zone={list(zone)}", "duration=6", *more]
    scenario = load_scenario("fast-diagonal", overrides=overrides)
    return simulate_run(scenario, plant=plant, drive="velocity", controller=controller)


def assert_agrees(plant: str, controller: str) -> None:
    first, second = run_with(ZONE, plant, controller), run_with(ZONE, "mujoco", controller)
    assert (first.status, first.end_ns) == (second.status, second.end_ns)
    comparison = compare_runs(first, second)
    assert comparison.max_load_error_m < 1e-7
    assert comparison.max_angle_error_rad < 1e-7
    without = run_with((0.0,) * 3, plant, controller)
    assert np.abs(first.load_position - without.load_position).max() > 1e-3


@pytest.mark.parametrize("controller", ["lqr", "pid"])
@pytest.mark.parametrize("plant", [name for name in PLANTS if name != "mujoco"])
def test_plants_agree(plant: str, controller: str) -> None:
    assert_agrees(plant, controller)


def test_the_servo_gets_nothing_or_the_whole_set_point_times_its_gain() -> None:
    run = run_with(ZONE, "elastic", "lqr", "effects.installation.drive_gain=[1.1, 0.9, 1.0]")
    set_points, command = run.block("input")[:, 3:6], run.block("command")[:, :3]
    below = np.abs(set_points) < ZONE
    assert 0.05 < below.mean() < 0.95
    assert command == pytest.approx(np.where(below, 0.0, set_points * [1.1, 0.9, 1.0]), abs=1e-15)
    assert not command[below].any()


@pytest.mark.parametrize("plant", PLANTS)
def test_below_the_dead_zone_nothing_moves(plant: str) -> None:
    """The integral of the set-points goes on, else no drive would ever leave its dead zone."""
    run = run_with((1e6,) * 3, plant, "lqr", "disturbances=[]")
    state = run.block("state")
    assert state == pytest.approx(np.tile(state[0], (len(state), 1)), abs=1e-9)
    assert np.abs(run.block("input")[:, 3:6]).max() > 0.5

"""Velocity drives that stand still for set-points below a speed: all plants, to 1e-7 m and rad."""

import numpy as np
import pytest

from cranectl.simulate import Run
from tests.conftest import PLANTS, closed_loop
from tests.plants.cranes import assert_runs_agree

ZONE = (0.02, 0.03, 0.01)


def run_with(zone: tuple[float, ...], plant: str, controller: str, *more: str) -> Run:
    dead_zone = f"effects.installation.dead_zone={list(zone)}"
    return closed_loop("fast-diagonal", controller, plant, "velocity", dead_zone, "duration=6", *more)


@pytest.mark.parametrize("controller", ["lqr", "pid"])
@pytest.mark.parametrize("plant", [name for name in PLANTS if name != "mujoco"])
def test_plants_agree(plant: str, controller: str) -> None:
    with_zone, without = (run_with(zone, plant, controller) for zone in (ZONE, (0.0,) * 3))
    assert_runs_agree(with_zone, run_with(ZONE, "mujoco", controller))
    assert np.abs(with_zone.load_position - without.load_position).max() > 1e-3


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

"""Test `nmpc` in C: it keeps its limits, brings the load back, and works on a harbour crane."""

import numpy as np
import pytest

from cranectl import open_controller
from cranectl.campaign.benchmark.declared import information, variables_of
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from tests.benchmark.nmpc import FOLDER, build_library

WITH_OFFSET = [
    "disturbances=[]",
    "duration=8.0",
    "reference.start=[1.0, 0.77, -0.7]",
    "reference.segments=[]",
]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(build_library(tmp_path_factory.mktemp("nmpc")))


def simulate(library: str, *overrides: str, plant: str, drive: str = "velocity") -> Run:
    controller = open_controller(library)
    numbers = [override.replace("nmpc.", "controller.nmpc.") for override in overrides]
    scenario = load_scenario("fixed-position", overrides=numbers)
    return simulate_run(scenario, plant=plant, drive=drive, controller=controller)


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_limits_hold_while_load_returns(library: str, plant: str) -> None:
    """For 0.5 m the limits act: 0.05 g and 0.1 sqrt(g l)."""
    limits = ["nmpc.acceleration=0.05", "nmpc.speed=0.1", "nmpc.effort=1"]
    run = simulate(
        library, *WITH_OFFSET, *limits, "initial.load_offset=[0.5, -0.4, 0.0]", plant=plant, drive="ideal"
    )
    acceleration, speed = np.abs(run.block("input")[:, :2]).max(), np.abs(run.block("state")[:, [1, 3]]).max()
    assert acceleration == pytest.approx(0.05 * 9.81, rel=1e-9)
    # The quadratic programs stop after SPLITS iterations, so speeds keep their limits to 2 % only.
    largest = 0.1 * np.sqrt(9.81 * 0.7)
    assert 0.98 * largest < speed < 1.02 * largest
    assert np.linalg.norm(run.block("error")[run.time > 7.0, :3], axis=1).max() < 1e-3


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_observed_disturbance_leaves_small_error(library: str, plant: str) -> None:
    with_observer = simulate(library, "effects.sensing.angle_noise=0.0", plant=plant)
    without_observer = simulate(library, plant=plant)
    errors = [
        np.abs(run.block("error")[run.time > 23.0, :2]).max() for run in (with_observer, without_observer)
    ]
    assert errors[0] < 0.004
    assert errors[1] > 0.02


def test_harbour_crane_reaches_its_target(library: str) -> None:
    """Its numbers are relative to g and l, and its horizon is proportional to the control period."""
    names = ("limits", "rope", "body", "friction", "sensing", "delay", "wind")
    effects = [f"effects.{name}={{}}" for name in names]
    harbour = load_scenario(FOLDER.parent / "scenarios" / "harbour.toml", overrides=effects)
    run = simulate_run(harbour, plant="mujoco", drive="velocity", controller=open_controller(library))
    assert np.linalg.norm(run.block("error")[-1, :3]) < harbour.metrics.settling_tolerance


def test_controller_declares_that_it_reads_only_gravity(library: str) -> None:
    """It gets no other number of the rig: see `test_a_library_gets_what_it_declares_to_read`."""
    facts = information(open_controller(library))
    assert (facts["rig"], facts["preview"]) == (["gravity"], 1000)


def test_defaults_are_between_bounds_of_tuning(library: str) -> None:
    variables = variables_of(open_controller(library))
    keys = [variable.key.removeprefix("controller.nmpc.") for variable in variables]
    assert keys == ["rate", "effort", "acceleration", "speed"]
    assert all(variable.low < variable.start < variable.high for variable in variables)

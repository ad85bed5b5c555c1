"""Test `nmpc` in C: it keeps its limits, brings the load back, and works on a harbour crane."""

import numpy as np
import pytest

from cranectl import open_controller
from cranectl.tools.benchmark.declared import information, variables_of
from tests.benchmark.nmpc import FOLDER, build_library
from tests.benchmark.runs import at_rest, simulate


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(build_library(tmp_path_factory.mktemp("nmpc")))


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_limits_hold_while_load_returns(library: str, plant: str) -> None:
    """For 0.5 m the limits act: 0.05 g and 0.1 sqrt(g l)."""
    names = {"acceleration": 0.05, "speed": 0.1, "effort": 1.0}
    limits = [f"controller.nmpc.{name}={value}" for name, value in names.items()]
    settings = [*at_rest(0.7, 0.0, 8.0), *limits, "initial.load_offset=[0.5, -0.4, 0.0]"]
    run = simulate(library, *settings, plant=plant)
    acceleration, speed = np.abs(run.block("input")[:, :2]).max(), np.abs(run.block("state")[:, [1, 3]]).max()
    assert acceleration == pytest.approx(0.05 * 9.81, rel=1e-9)
    # The quadratic programs stop after SPLITS iterations, so speeds keep their limits to 2 % only.
    largest = 0.1 * np.sqrt(9.81 * 0.7)
    assert 0.98 * largest < speed < 1.02 * largest
    assert np.linalg.norm(run.block("error")[run.time > 7.0, :3], axis=1).max() < 1e-3


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_observed_disturbance_leaves_small_error(library: str, plant: str) -> None:
    errors = []
    for settings in (["effects.sensing.angle_noise=0.0"], []):  # with an observer, and without
        run = simulate(library, *settings, plant=plant, drive="velocity")
        errors.append(np.abs(run.block("error")[run.time > 23.0, :2]).max())
    assert errors[0] < 0.004
    assert errors[1] > 0.02


def test_harbour_crane_reaches_its_target(library: str) -> None:
    """Its numbers are relative to g and l, and its horizon is proportional to the control period."""
    names = ("limits", "rope", "body", "friction", "sensing", "delay", "wind")
    effects = [f"effects.{name}={{}}" for name in names]
    harbour = str(FOLDER.parent / "scenarios" / "harbour.toml")
    run = simulate(library, *effects, scenario=harbour, plant="mujoco", drive="velocity")
    assert np.linalg.norm(run.block("error")[-1, :3]) < run.scenario.metrics.settling_tolerance


def test_controller_declares_what_it_reads_and_what_tuning_may_change(library: str) -> None:
    """It gets no other number of the rig: see `test_a_library_gets_what_it_declares_to_read`."""
    controller = open_controller(library)
    facts, variables = information(controller), variables_of(controller)
    assert (facts["rig"], facts["preview"]) == (["gravity"], 1000)
    keys = [variable.key.removeprefix("controller.nmpc.") for variable in variables]
    assert keys == ["rate", "effort", "acceleration", "speed"]
    assert all(variable.low < variable.start < variable.high for variable in variables)

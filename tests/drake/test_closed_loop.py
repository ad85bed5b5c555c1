"""Drake and MuJoCo agree in closed loop to 1e-7 m and rad, with all drives and with a frame.

All cases take minutes. DRAKE_CASES=12 selects 12 of them, evenly spread, and five random cranes.
"""

import itertools
import os

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cranectl.compare.agreement import agreement_limits
from cranectl.compare.runs import compare_runs
from cranectl.planning import load_scenario
from cranectl.plants.drake.plant import DrakePlant
from cranectl.plants.plant import DRIVES
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from tests.conftest import ALL_SCENARIOS, controllers_of
from tests.plants.test_random_cranes import RIGID, RIGID_STEPS, assert_random_case_agrees
from validation.proofs import random_cranes
from validation.proofs.minimum_times import CASES as PLANNED
from validation.proofs.minimum_times import scenario as planned

CASES = [
    (scenario, controller, drive)
    for scenario in ALL_SCENARIOS
    for controller in controllers_of(scenario)
    for drive in (*DRIVES, "velocity, frame")
]
CASE_COUNT = int(os.environ.get("DRAKE_CASES", len(CASES)))
SELECTED = [CASES[round(k)] for k in np.linspace(0, len(CASES) - 1, CASE_COUNT)]
LIMITS = agreement_limits("ideal")


@pytest.mark.parametrize(("scenario", "controller", "drive"), SELECTED)
def test_drake_and_mujoco_agree_in_closed_loop(scenario: str, controller: str, drive: str) -> None:
    kind, _, frame = drive.partition(", ")
    loaded = load_scenario(scenario, overrides=["effects.frame={}"] if frame else [])
    _assert_agree(loaded, controller, kind)


@pytest.mark.parametrize("case", PLANNED)
def test_drake_and_mujoco_agree_in_minimum_time_motions(case: str) -> None:
    _assert_agree(planned(case), "lqr", "velocity")


@pytest.mark.parametrize("k", range(25 if len(CASES) == CASE_COUNT else 5))
def test_drake_and_mujoco_agree_for_random_cranes(k: int) -> None:
    assert_random_case_agrees(k, ("drake", "mujoco"), ("wind", "frame", "installation"))


@pytest.mark.parametrize("first", range(0, RIGID if len(CASES) == CASE_COUNT else 10, 5))
def test_rigid_cranes_of_any_size_agree_with_default_steps(first: int) -> None:
    """As `tests/plants/test_random_cranes.py` for the plants of every installation."""
    generator = random_cranes.random_rigs(random_cranes.commit(), ("drake", "mujoco"), steps=RIGID_STEPS)
    for case in itertools.islice(generator, first, first + 5):
        (pair,) = case.run().pairs
        assert pair.agreement.passed or random_cranes.is_amplified(case), (case.scenario.name, pair)


def _assert_agree(scenario: Scenario, controller: str, drive: str) -> None:
    drake, mujoco = (
        simulate_run(scenario, plant=plant, controller=controller, drive=drive)
        for plant in ("drake", "mujoco")
    )
    assert (drake.status, drake.end_ns) == (mujoco.status, mujoco.end_ns)
    comparison = compare_runs(drake, mujoco)
    assert comparison.max_load_error_m < LIMITS.load_m
    assert comparison.max_angle_error_rad < LIMITS.angle_rad
    tensions = drake.signal("load.rope_tension"), mujoco.signal("load.rope_tension")
    assert np.abs(tensions[0] - tensions[1]).max() < 1e-6 * scenario.rig.weight


def integrate_to_tolerance(plant: DrakePlant, duration: float) -> None:
    """Integrate a plant with SciPy's adaptive steps, in place of its own fixed steps."""
    rates = lambda _, state: plant.rates(state)  # noqa: E731
    solution = solve_ivp(rates, (0.0, duration), plant.state, "DOP853", rtol=1e-12, atol=1e-13)
    assert solution.success
    plant.state = solution.y[:, -1]


@pytest.mark.parametrize("frame", [[], ["effects.frame={}"]], ids=["rigid", "frame"])
@pytest.mark.parametrize("drive", DRIVES)
def test_adaptive_steps_give_the_same_run(
    drive: str, frame: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The agreement with MuJoCo does not come from equal steps."""
    scenario = load_scenario("near-slack", overrides=frame)

    def run() -> Run:
        return simulate_run(scenario, plant="drake", controller="lqr+hinf", drive=drive)

    fixed = run()
    monkeypatch.setattr(DrakePlant, "integrate", integrate_to_tolerance)
    comparison = compare_runs(fixed, run())
    assert 0.0 < comparison.max_load_error_m < 1e-8
    assert 0.0 < comparison.max_angle_error_rad < 1e-8

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
from tests.conftest import ALL_CONTROLLERS, ALL_SCENARIOS
from validation.proofs.minimum_times import CASES as PLANNED
from validation.proofs.minimum_times import scenario as planned

CASES = list(itertools.product(ALL_SCENARIOS, ALL_CONTROLLERS, (*DRIVES, "velocity, frame")))
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


@pytest.mark.parametrize("seed", range(25 if len(CASES) == CASE_COUNT else 5))
def test_drake_and_mujoco_agree_for_random_cranes(seed: int) -> None:
    """Masses, lags, tilt, frame and friction are random; the load starts off its path and is disturbed."""
    rng = np.random.default_rng(seed)
    controller, drive = str(rng.choice(ALL_CONTROLLERS)), str(rng.choice([*DRIVES]))
    scale = np.exp(rng.uniform(-0.7, 0.7, 4))
    pulses = [
        f"{{joint='{joint}', start={start}, end={start + 1}, magnitude={rng.uniform(-1.0, 1.0)}}}"
        for start, joint in ((1, "alpha"), (4, "beta"))
    ]
    overrides = [
        f"rig.bridge_mass={6.0 * scale[0]}",
        f"rig.trolley_mass={2.5 * scale[1]}",
        f"rig.winch_mass={0.4 * scale[2]}",
        f"rig.load_mass={scale[3]}",
        f"rig.bridge_time_constant={rng.uniform(0.01, 0.05)}",
        f"initial.load_offset={rng.uniform(-0.03, 0.03, 3).tolist()}",
        f"initial.alpha_offset={rng.uniform(-0.1, 0.1)}",
        f"effects.installation.tilt={rng.uniform(-0.01, 0.01, 2).tolist()}",
        f"disturbances=[{', '.join(pulses)}]",
        "duration=8",
    ]
    if rng.random() < 0.5:
        overrides.append(f"effects.frame.frequency={rng.uniform(5.0, 15.0, 2).tolist()}")
    if rng.random() < 0.5:
        axes = [0.0] * 3 if drive == "ideal" else rng.uniform(0.0, 5.0, 3).tolist()
        coulomb = "coulomb=[0,0,0], pivot_coulomb=0.0"
        overrides.append(
            f"effects.friction={{{coulomb}, viscous={axes}, pivot_viscous={rng.uniform(0.0, 0.02)}}}"
        )
    scenario = load_scenario("fixed-position", overrides=overrides)
    _assert_agree(scenario, controller, drive)


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

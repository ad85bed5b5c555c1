"""Independent plants agree: the main claim of the project.

Levels 0, 1 and 2 of docs/explanation/model.md.
"""

import itertools
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
import pytest

from cranectl.cases import Case
from cranectl.compare.agreement import judge
from cranectl.compare.runs import compare_runs
from cranectl.model import dynamics
from cranectl.planning import load_scenario
from cranectl.plants.mujoco.model import JOINTS, model_spec, state_addresses
from cranectl.plants.plant import DRIVES, Drive
from cranectl.status import RunStatus
from tests.conftest import ALL_SCENARIOS, PAIR, PLANTS, closed_loop, controllers_of, random_states, split
from tests.plants.cranes import RIG, make, simulate

STEP = 1e-3


# Level 0: the same matrices and accelerations, state by state.


def test_level_0_mass_matrix_bias_and_acceleration() -> None:
    model = model_spec(RIG, drive="velocity", step=STEP).compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    data = mujoco.MjData(model)
    joints = state_addresses(model)
    rng = np.random.default_rng(10)
    for state in random_states(1000, seed=10):
        q, qd = split(state)
        data.qpos[joints], data.qvel[joints] = q, qd
        force = rng.normal(size=5)
        data.qfrc_applied[joints] = force
        mujoco.mj_forward(model, data)
        full = np.zeros((5, 5))
        mujoco.mj_fullM(model, data, full)
        mass = dynamics.mass_matrix(q, RIG)
        bias = dynamics.coriolis_matrix(q, qd, RIG) @ qd + dynamics.gravity_vector(q, RIG)
        acceleration = np.linalg.solve(mass, force - bias)
        assert _relative(full[np.ix_(joints, joints)], mass) < 1e-10
        assert _relative(data.qfrc_bias[joints], bias) < 1e-10
        assert _relative(data.qacc[joints], acceleration) < 1e-10


def test_level_0_cardan_accelerations_and_tension_with_ideal_drives() -> None:
    """The ideal drives realise the commanded accelerations; the rest follows the mass-free equations."""
    plant = make("mujoco")
    joints = plant.rig.joints
    rng = np.random.default_rng(11)
    for state in random_states(1000, seed=11):
        q, qd = split(state)
        u = rng.normal(size=3)
        plant.data.qpos[joints], plant.data.qvel[joints] = q, qd
        plant.data.ctrl[plant.rig.drives] = u
        mujoco.mj_forward(plant.model, plant.data)
        cardan = dynamics.angular_accelerations(*state[4:10], u[0], u[1], RIG.gravity)
        assert _relative(plant.data.qacc[joints], np.array([*u, *cardan])) < 1e-10
        tension = plant.data.sensor("rope_force").data
        assert tension[2] == pytest.approx(dynamics.rope_tension(q, qd, u, RIG), rel=1e-10, abs=1e-10)
        assert tension[:2] == pytest.approx([0.0, 0.0], abs=1e-9), "a rope transmits no shear"


# Level 1: open loop, the same accelerations into both, 20 s.


@pytest.mark.parametrize("seed", range(3))
def test_level_1_open_loop(seed: int) -> None:
    rng = np.random.default_rng(20 + seed)
    amplitude, omega, phase = rng.uniform(0.02, 0.3, 3), rng.uniform(0.5, 4.0, 3), rng.uniform(0, 6, 3)
    amplitude[2] *= 0.2
    start = np.array([1.0, 0.0, 0.7, 0.0, 0.8, 0.0, *rng.uniform(-0.4, 0.4, 4)])
    commands = amplitude * np.cos(omega * STEP * np.arange(20_000)[:, np.newaxis] + phase)
    a, b = (simulate(make(name, start=start), len(commands), commands.__getitem__)[1] for name in PAIR)
    assert np.linalg.norm(a[:, :3] - b[:, :3], axis=1).max() < 1e-6


# Level 2: closed loop, every scenario, controller and drive, the whole run. No other test runs all of them.


LONG = ("fixed-position", "near-the-limits", "settled-trajectory")
MORE = ("pole-placement+hinf", "pole-placement+loop-shaping", "lqr", "lqr+loop-shaping")


def cases() -> Iterator[Any]:
    """Yield shipped scenarios with controllers: long runs, and MORE of the flat family, are slow."""
    for name in ALL_SCENARIOS:
        first = tuple(controller for controller in controllers_of(name) if controller not in MORE)
        yield pytest.param(name, (*first, "pid"), marks=[pytest.mark.slow] * (name in LONG))
        if {*MORE} <= {*controllers_of(name)}:
            yield pytest.param(name, MORE, marks=pytest.mark.slow)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(("name", "controllers"), [*cases()])
def test_level_2_all_plants_in_closed_loop(name: str, controllers: tuple[str, ...], drive: Drive) -> None:
    """The runs are those of `cranectl validate --drive all --pairwise`, with tighter limits."""
    scenario = load_scenario(name)
    for controller in controllers:
        case = Case.of(scenario, controller=controller, drive=drive, keep="none", pairwise=True)
        result = case.run()
        assert [run.plant for run in result.runs] == list(PLANTS)
        assert result.passed or controller == "pid", (
            controller
        )  # which loses large cranes, on all plants alike
        ((status, end),) = {(run.status, run.end_s) for run in result.runs}
        assert status != RunStatus.COMPLETED or end == scenario.duration
        for pair in result.pairs:
            agreement = pair.agreement
            assert (agreement.limit_m, agreement.limit_rad) == (1e-7, 1e-7)
            assert agreement.max_load_error_m < 1e-8, controller
            assert agreement.max_angle_error_rad < 1e-8, controller
            assert pair.max_tension_error_n < 1e-5 * scenario.rig.weight, controller
        pairs = {(pair.agreement.plant, pair.agreement.reference) for pair in result.pairs}
        assert pairs == {*itertools.combinations(PLANTS, 2)}


ANY_RIG = {
    "ideal": [
        ["rig.load_mass=0.001"],
        ["rig.load_mass=10000", "rig.rated_load=10000"],
        ["control.period=0.002"],
        ["rig.trolley_motor_mass=20"],
        ["rig.load_mass=0.001", "rig.bridge_mass=1e5"],
        ["rig.load_mass=0.001", "rig.trolley_mass=1e6", "rig.bridge_mass=1e6"],
        ["rig.load_mass=0.001", "rig.bridge_mass=1e5", "effects.installation.tilt=[0.05,-0.1]"],
    ],
    "velocity": [
        ["rig.load_mass=4.0"],
        ["rig.bridge_mass=0.5", "rig.trolley_mass=0.2", "rig.winch_mass=0.1", "rig.load_mass=5.0"],
        ["rig.bridge_time_constant=0.2", "rig.trolley_time_constant=0.005", "rig.winch_time_constant=0.1"],
        ["effects.wind={}", "effects.installation={tilt=[0.01,-0.02]}"],
        ["rig.trolley_motor_mass=20", "effects.installation={tilt=[0.01,-0.02]}"],
        ["effects.friction={coulomb=[0,0,0],viscous=[0,0,0],pivot_coulomb=0,pivot_viscous=1e-3}"],
        ["control.lag_compensation=false"],
    ],
}


@pytest.mark.parametrize(
    ("drive", "overrides"), [(drive, rig) for drive, rigs in ANY_RIG.items() for rig in rigs], ids=str
)
def test_level_2_holds_for_any_rig_and_sampling(drive: Drive, overrides: list[str]) -> None:
    """Neither very light nor very heavy loads, nor other masses, lags, air or slopes make a difference."""
    a, b = (closed_loop("fast-diagonal", "lqr", plant, drive, "duration=5.0", *overrides) for plant in PAIR)
    assert judge(a, b).passed


HARD = {"fixed-position": 2, "settled-trajectory": 2, "fast-diagonal": 1, "near-slack": 1}


@pytest.mark.parametrize("scenario", HARD)
def test_level_2_holds_as_well_under_hard_pushes(scenario: str) -> None:
    """The disturbances are 3 rad/s²; if they were constant over a step, plants would differ by 4e-7 m."""
    overrides = [f"disturbances.{k}.magnitude={3.0 * (-1) ** k}" for k in range(HARD[scenario])]
    analytic, engine = (closed_loop(scenario, "lqr+hinf", plant, "ideal", *overrides) for plant in PAIR)
    assert np.abs(engine.block("disturbance")).max() == 3.0
    assert analytic.end_ns == engine.end_ns
    assert compare_runs(analytic, engine).max_load_error_m < 1e-10


def _relative(actual: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(actual - expected).max() / max(1.0, np.abs(expected).max()))


def test_the_comparison_helper_can_fail() -> None:
    assert _relative(np.array([-9.81]), np.array([9.81])) > 1.0
    assert len(JOINTS) == 5

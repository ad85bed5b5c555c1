"""What each plant owes to mechanics and to its integrator."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cranectl.model import dynamics
from cranectl.plants.analytic import AnalyticPlant, drive_accelerations
from cranectl.plants.mujoco.effects import ACTUATORS
from cranectl.plants.mujoco.model import (
    DRIVEN_JOINTS,
    compiled_model,
    model_spec,
    rate_addresses,
    state_addresses,
)
from cranectl.plants.plant import DRIVES, Drive, Plant
from cranectl.scenario.rig import RigParameters
from tests.conftest import PLANTS, STILL, split
from tests.plants.cranes import HANGING, RIG, make, simulate, state_of


def swing(plant: Plant, start: np.ndarray, command: np.ndarray, periods: int) -> np.ndarray:
    plant.reset(start)
    simulate(plant, periods, command)
    return state_of(plant)


@pytest.mark.parametrize(
    ("name", "order", "steps"),
    [("analytic", 8, (0.1, 0.05)), ("elastic", 5, (0.04, 0.02)), ("mujoco", 4, (0.02, 0.01))],
)
def test_integrator_converges_with_its_order(name: str, order: int, steps: tuple[float, float]) -> None:
    start = np.array([1.0, 0.1, 0.7, -0.1, 0.8, 0.02, 0.5, 0.4, -0.4, 0.3])
    command = np.array([0.2, -0.1, 0.03])
    duration = 2.0

    def derivative(_: float, x: np.ndarray) -> np.ndarray:
        rate = np.empty(10)
        rate[0::2] = x[1::2]
        rate[1::2] = [*command, *dynamics.angular_accelerations(*x[4:10], *command[:2], RIG.gravity)]
        return rate

    exact = solve_ivp(derivative, (0, duration), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    ends = [swing(make(name, step=h), start, command, round(duration / h)) for h in steps]
    coarse, fine = (np.abs(end - exact)[6:].max() for end in ends)
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.6)
    assert fine < 1e-6


@pytest.mark.parametrize("name", PLANTS)
def test_substeps_divide_the_period(name: str) -> None:
    start = np.array([1.0, 0.1, 0.7, -0.1, 0.8, 0.0, 0.4, 0.3, -0.3, 0.2])
    command = np.array([0.2, -0.1, 0.03])
    whole = swing(make(name, step=1e-3, substeps=4), start, command, 50)
    parts = swing(make(name, step=1e-3, substeps=1), start, command, 200)
    assert np.array_equal(whole, parts)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", PLANTS)
def test_a_crane_at_rest_stays_at_rest(name: str, drive: str) -> None:
    command = np.array([0.0, 0.0, -RIG.weight if drive == "force" else 0.0])
    assert swing(make(name, drive=drive), HANGING, command, 1000) == pytest.approx(HANGING, abs=1e-9)


def test_drives_of_the_analytic_plant_are_exactly_what_they_say() -> None:
    """Ideal: the command. Velocity: the forces of servos, of which the winch's holds the nominal weight."""
    rig = RigParameters(bridge_time_constant=0.01, trolley_time_constant=0.02, winch_time_constant=0.04)
    state, command = 0.1 * np.arange(1.0, 11.0), np.array([0.7, -0.4, 0.9])

    def accelerations(drive: Drive, command: np.ndarray) -> tuple[float, ...]:
        known = AnalyticPlant(rig, drive=drive, step=1e-3, substeps=1).rig
        return drive_accelerations(known.drives, known, state, command, np.array([0.3, -0.2]), STILL)

    assert accelerations("ideal", command) == tuple(command)
    force = rig.driven_masses / rig.time_constants * (command - state[1:6:2]) - [0.0, 0.0, rig.weight]
    assert accelerations("velocity", command) == pytest.approx(accelerations("force", force), rel=1e-12)


def test_ideal_drives_accelerate_what_they_carry_besides_their_own_inertia() -> None:
    rig = RIG.model_copy(update={"bridge_mass": 4000.0, "trolley_mass": 300.0, "load_mass": 20.0})
    model = compiled_model(rig, "ideal", 1e-3)
    armature = [model.joint(name).armature[0] for name in DRIVEN_JOINTS]
    gear = [model.actuator(name).gear[0] for name in ACTUATORS]
    assert armature == pytest.approx([4320e12] * 3, rel=1e-15)
    assert np.subtract(gear, armature) == pytest.approx([4300.0, 300.0, 0.0], abs=0.5)


@pytest.mark.parametrize("name", PLANTS)
def test_velocity_drives_lag_by_their_time_constants(name: str) -> None:
    """Small set-point steps: after one time constant each drive has 1 - 1/e of its velocity."""
    rig = RigParameters(bridge_time_constant=0.01, trolley_time_constant=0.02, winch_time_constant=0.04)
    for axis, tau in enumerate(rig.time_constants):
        command = np.zeros(3)
        command[axis] = 1e-3
        state = swing(make(name, drive="velocity", rig=rig), HANGING, command, round(tau / 1e-3))
        assert state[2 * axis + 1] == pytest.approx(1e-3 * (1 - np.exp(-1)), rel=0.02)


@pytest.mark.parametrize("name", PLANTS)
def test_load_is_reported_for_the_start_of_the_period_under_the_new_command(name: str) -> None:
    start = np.array([1.0, 0.3, 0.7, -0.2, 0.8, 0.1, 0.4, 0.5, -0.3, 0.6])
    command = np.array([0.5, -0.4, 0.3])
    plant, load = make(name), np.zeros(7)
    plant.reset(start)
    plant.advance(command, np.zeros(2), STILL, load)
    q, qd = split(start)
    assert load[:3] == pytest.approx(dynamics.load_position(q), abs=1e-12)
    assert load[3:6] == pytest.approx(dynamics.load_velocity(q, qd), abs=1e-12)
    assert load[6] == pytest.approx(dynamics.rope_tension(q, qd, command, RIG), rel=1e-9)


def test_sensors_measure_what_the_rig_measures() -> None:
    model = model_spec(RIG, drive="velocity", step=1e-3).compile()
    data = mujoco.MjData(model)
    state = np.array([1.0, 0.3, 0.7, -0.2, 0.8, 0.1, 0.4, 0.5, -0.3, 0.6])
    data.qpos[state_addresses(model)], data.qvel[rate_addresses(model)] = state[0::2], state[1::2]
    mujoco.mj_forward(model, data)
    names = [
        "bridge_position", "bridge_velocity", "trolley_position", "trolley_velocity", "rope_length",
        "rope_length_rate", "alpha", "alpha_rate", "beta", "beta_rate",
    ]  # fmt: skip
    assert [data.sensor(name).data[0] for name in names] == pytest.approx(state)
    length = data.tendon("rope").length[0]
    assert length == pytest.approx(0.8), "the drawn rope has the length of the rope"

"""The linearised plant against the loop it stands for; operating points against the plant that holds them."""

import numpy as np
import pytest

from cranectl.analysis.certificate.linear_plant import bare_plant, linear_plant
from cranectl.analysis.certificate.loop import (
    closed_loop_matrix,
    design_inner_loop,
    inner_loop_of,
    robustifier_of,
)
from cranectl.analysis.certificate.operating_points import OperatingPoint, grid_of, held_state
from cranectl.design import design_controller
from cranectl.errors import InputError
from cranectl.plants.interface import DRIVES, Drive
from cranectl.scenario import Scenario, default_scenario
from cranectl.signals import BASE_WIDTH, INPUT_COLUMN
from cranectl.simulate import plan_scenario, tracker_of
from cranectl.simulate.loops import python_loop
from cranectl.simulate.runner import sampling_of
from cranectl.simulate.stages import make_stages
from cranectl.tracker import RUNNING, ZETA, control_step, initial_memory
from tests.conftest import STILL

G, PERIOD = 9.81, 1e-3
POINTS = [
    OperatingPoint(0.7),
    OperatingPoint(0.2, (1.0, 1.0)),
    OperatingPoint(1.3, (-2.0, 0.5)),
    OperatingPoint(0.7, (1.0, -1.0), 0.3),
]


def nonlinear_loop(
    scenario: Scenario, point: OperatingPoint, drive: Drive, offset: np.ndarray, steps: int
) -> np.ndarray:
    """Joints (steps, 10) of MuJoCo under the tracker whose reference is `point`, started `offset` away."""
    delay = round(scenario.effects.delay.seconds / PERIOD) if scenario.effects.delay else 0
    design = design_controller("lqr+loop-shaping", scenario.design)
    tracker, held, plant = tracker_of(scenario, design), held_state(point, G), bare_plant(scenario, drive)
    row = np.zeros(BASE_WIDTH + 3 * design.robustifier.sampled_order)
    reference = np.zeros(15)
    memory = initial_memory(tracker, held.joints, reference)
    memory[ZETA] = held.zeta
    # The set-points that hold: what leaves the drives' velocities alone.
    memory[2:5] = holding_setpoints(scenario, point, drive)
    control_step(tracker, held.joints, reference, memory.copy(), row)
    first = INPUT_COLUMN if drive == "ideal" else INPUT_COLUMN + 3
    reference[:12] = row[17:29]  # the flat output there
    reference[12:] = held.virtual_input
    line = [np.zeros(3) if drive == "ideal" else memory[2:5].copy()] * delay
    state, states = held.joints + offset, []
    plant.reset(state)
    for _ in range(steps):
        plant.measure(state)
        states.append(state.copy())
        assert control_step(tracker, state, reference, memory, row) == RUNNING
        line.append(row[first : first + 3].copy())
        plant.advance(line.pop(0), np.array(point.tilt), STILL, np.zeros(7))
    return np.array(states)


def holding_setpoints(scenario: Scenario, point: OperatingPoint, drive: Drive) -> np.ndarray:
    """Where velocity drives settle against the pull of the rope: sag is force over gain."""
    if drive == "ideal":
        return np.zeros(3)
    held, plant = held_state(point, G), bare_plant(scenario, drive)
    setpoint = held.joints[1:6:2].copy()
    after = np.zeros(10)
    for _ in range(200):
        plant.reset(held.joints)
        plant.advance(setpoint, np.array(point.tilt), STILL, np.zeros(7))
        plant.measure(after)
        setpoint -= 10.0 * (after - held.joints)[1:6:2]
    return setpoint


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("point", POINTS, ids=str)
def test_one_step_leaves_a_held_state(point: OperatingPoint, drive: Drive) -> None:
    """Besides the running rope; and the tracker's law asks for no acceleration there."""
    scenario, held, after = default_scenario(), held_state(point, G), np.zeros(10)
    plant = bare_plant(scenario, drive)
    plant.reset(held.joints)
    plant.advance(holding_setpoints(scenario, point, drive), np.array(point.tilt), STILL, np.zeros(7))
    plant.measure(after)
    moved = after - held.joints
    assert moved[4] == pytest.approx(PERIOD * point.hoisting_speed, abs=1e-10)
    still = np.delete(moved, [4])
    # A rope that runs changes its length, and with it what the disturbance holds against, within the step.
    drift = abs(point.hoisting_speed) * PERIOD**2 * G
    assert np.abs(still).max() < 1e-10 + drift


def test_a_wrong_tilt_does_not_hold() -> None:
    point, after = OperatingPoint(0.7, (1.0, 1.0)), np.zeros(10)
    joints = held_state(point, G).joints.copy()
    joints[6] *= 1.01
    plant = bare_plant(default_scenario(), "ideal")
    plant.reset(joints)
    plant.advance(np.zeros(3), np.array(point.tilt), STILL, np.zeros(7))
    plant.measure(after)
    assert np.abs(after - joints).max() > 1e-6


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("delay", [0, 1, 7])
def test_linear_loop_moves_as_the_real_one(drive: Drive, delay: int) -> None:
    """A hundred samples of MuJoCo under the compiled tracker, tilted, delayed, from a small random offset."""
    scenario = default_scenario(overrides=[f"effects.delay.seconds={delay * PERIOD}"])
    point = OperatingPoint(0.6, (1.0, -0.5))
    design = design_controller("lqr+loop-shaping", scenario.design)
    inner = inner_loop_of(linear_plant(scenario, point, drive), design.gain)
    matrix = closed_loop_matrix(inner, robustifier_of(design, PERIOD))
    offset = 1e-4 * np.random.default_rng(1).normal(size=10)
    moved = nonlinear_loop(scenario, point, drive, offset, 100)
    x = np.zeros(len(matrix))
    x[:10] = offset
    for joints in moved - held_state(point, G).joints:
        assert x[:10] == pytest.approx(joints, abs=3e-3 * np.abs(offset).max())
        x = matrix @ x
    assert np.abs(moved[-1] - moved[0]).max() > 3e-2 * np.abs(offset).max(), "nothing moved"


def test_hanging_still_with_ideal_drives_it_is_the_design_model() -> None:
    """What is left, the input held instead of v, is of the order of a period."""
    design = design_controller("lqr")
    inner = inner_loop_of(linear_plant(default_scenario(), OperatingPoint(0.7), "ideal"), design.gain)
    z = np.exp(1j * PERIOD * np.array([0.01, 0.1, 1.0, 3.0, 10.0]))
    expected = design_inner_loop(design.gain, PERIOD).response(z)
    found = inner.response(z)
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.abs(found - expected).max() < 0.01 * scale.max()
    assert (np.abs(found - expected) < 0.02 * scale).all()
    shorter = inner_loop_of(linear_plant(default_scenario(), OperatingPoint(0.2), "velocity"), design.gain)
    assert (np.abs(shorter.response(z) - expected) > 0.02 * scale).any()


@pytest.mark.parametrize("delay", [1, 20])
def test_delay_beside_the_matrices_is_delay_as_states(delay: int) -> None:
    scenario = default_scenario(overrides=[f"effects.delay.seconds={delay * PERIOD}"])
    plant = linear_plant(scenario, OperatingPoint(0.5, (0.5, 0.0)), "velocity")
    inner = inner_loop_of(plant, design_controller("lqr").gain)
    assert plant.delay == delay
    assert len(inner.delayed.a) == 15 + 3 * delay
    z = np.exp(1j * np.array([1e-4, 1e-3, 1e-2, 0.1, 1.0, 3.0]))
    expected = inner.delayed.response(z)
    assert np.abs(inner.response(z) - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("delay", [0, 4])
def test_linear_loop_with_observer_moves_as_a_run(delay: int) -> None:
    """Against the very loop of a run, encoders of any fineness and no noise, over 200 samples."""
    scenario = default_scenario(
        overrides=[
            f"effects.delay.seconds={delay * PERIOD}",
            "effects.sensing.observer_bandwidth=40.0",
            "effects.sensing.position_resolution=[0,0,0]",
            "effects.sensing.angle_resolution=0.0",
            "effects.sensing.angle_noise=0.0",
        ]
    )
    point, design = OperatingPoint(0.6), design_controller("lqr+loop-shaping", scenario.design)
    inner = inner_loop_of(linear_plant(scenario, point, "velocity"), design.gain)
    matrix = closed_loop_matrix(inner, robustifier_of(design, PERIOD))
    held = held_state(point, G).joints
    offset = np.zeros(10)
    offset[0::2] = 1e-6 * np.random.default_rng(2).normal(size=5)
    plan = plan_scenario(scenario)
    plan.reference[:] = 0.0
    plan.reference[:, 2] = -point.rope_length
    tracker, plant = tracker_of(scenario, design), bare_plant(scenario, "velocity")
    sampling = sampling_of(scenario, tracker, plan, "velocity")._replace(stop_outside=False)
    stages = make_stages(scenario, held, drive="velocity", samples=200)
    record = np.zeros((200, BASE_WIDTH + 3 * design.robustifier.sampled_order))
    plant.reset(held + offset)
    memory = initial_memory(tracker, held, plan.reference[0])
    python_loop(plant)(sampling, stages, record, memory, 0, 200)
    x = np.zeros(len(matrix))
    x[:10] = offset
    for joints in record[:, :10] - held:
        assert x[:10] == pytest.approx(joints, abs=3e-3 * np.abs(offset).max())
        x = matrix @ x
    assert np.abs(record[-1, :10] - record[0, :10]).max() > 0.1 * np.abs(offset).max(), "nothing moved"


@pytest.mark.parametrize("tilt", [(20.0, 0.0), (14.02, 0.0), (0.0, -20.0), (3.0, 14.02)])
def test_more_than_gravity_holds_is_refused(tilt: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="disturbance of"):
        held_state(OperatingPoint(0.7, tilt), G)


def test_grid_is_every_combination_within_the_rig() -> None:
    scenario = default_scenario()
    points = grid_of(
        scenario, rope_lengths=(0.2, 1.0), tilts=((0.0, 0.0), (1.0, 1.0)), hoisting_speeds=(0.1,)
    )
    assert len(set(points)) == 4
    with pytest.raises(InputError, match=r"rope of 1\.5 m"):
        grid_of(scenario, rope_lengths=(0.2, 1.5), tilts=((0.0, 0.0),), hoisting_speeds=(0.0,))

"""The linearised plant against the loop it stands for; operating points against the plant that holds them."""

from dataclasses import replace

import numpy as np
import pytest

from cranectl.controllers import Tracker
from cranectl.controllers.flat import MEMORY, RUNNING, control_step
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.design import design_controller
from cranectl.plants.mujoco.linearisation import change_since, count_coordinates, set_state
from cranectl.plants.plant import Drive
from cranectl.scenario import Scenario
from cranectl.scenario.effects import EFFECTS, NO_EFFECTS, EffectNumbers
from cranectl.scenario.load import default_scenario
from cranectl.signals import COLUMN, ROPE, ROPE_RATE
from cranectl.simulate import Loop, Plan, PreparedController
from cranectl.simulate.actuation import Actuation, actuate
from cranectl.support.errors import InputError
from cranectl.tools.robustness.certificate.certify import make_nominal_loops
from cranectl.tools.robustness.certificate.linear_plant import (
    LINEAR,
    NOT_LINEAR,
    LinearPlant,
    present,
    run_plant,
)
from cranectl.tools.robustness.certificate.loop import AxisDesign, InnerLoop
from cranectl.tools.robustness.certificate.operating_points import (
    EquilibriumState,
    OperatingPoint,
    tilt_angles,
)
from tests.conftest import STILL

ALL_EFFECTS = EffectNumbers().only(*EFFECTS)

G, PERIOD = 9.81, 1e-3
POINTS = [OperatingPoint(0.7), OperatingPoint(0.2, (1.0, 1.0)), OperatingPoint(1.3, (-2.0, 0.5))]


EFFECTS = {
    "none": (),
    "rope": ("effects.rope={}",),
    "body": ("effects.body={}",),
    "frame": ("effects.frame={}",),
    "friction": ("effects.friction.viscous=[40.0,20.0,20.0]", "effects.friction.pivot_viscous=0.05"),
    "wind": ("effects.wind={mean=[8.0,-6.0,0.0],drag_area=0.1}",),
}
TOGETHER = tuple(override for overrides in EFFECTS.values() for override in overrides)
CASES = [("velocity", name) for name in EFFECTS] + [("ideal", name) for name in EFFECTS if name != "friction"]


def air_of(scenario: Scenario) -> np.ndarray:
    return np.array([*scenario.effects.wind.mean, 0.0, 0.0, 0.0]) if scenario.effects.wind else STILL


def nonlinear_loop(
    scenario: Scenario, point: OperatingPoint, drive: Drive, offset: np.ndarray, steps: int
) -> np.ndarray:
    """Joints (steps, 10), less those held, of MuJoCo under the tracker that holds `point`, from `offset`.

    All that the effects let move besides starts where it rests.
    """
    design = design_controller("lqr+loop-shaping", scenario.design)
    tracker, plant, air = Tracker.of(scenario, design), run_plant(scenario, drive), air_of(scenario)
    equilibrium = OperatingPoint.find_equilibrium(plant, point, air, G)
    base, command, held = equilibrium.base, equilibrium.command, EquilibriumState.at(equilibrium.joints, G)
    row = np.zeros(COLUMN.width + 3 * design.robustifier.sampled_order)
    reference = np.zeros(15)
    memory = np.zeros(MEMORY.robustifier + 3 * design.robustifier.sampled_order)
    memory[MEMORY.zeta] = held.zeta
    actuation, integral = Actuation.of(scenario), command.copy()
    control_step(tracker, held.joints, reference, memory.copy(), row)
    first = COLUMN.input if drive == "ideal" else COLUMN.input + 3
    reference[:12] = row[COLUMN.flat_output : COLUMN.flat_output + 12]
    reference[12:] = held.virtual_input
    line, state, states = [command.copy()] * scenario.delay_samples, np.zeros(10), []
    set_state(plant, base, np.append(offset, np.zeros(count_coordinates(plant) - 10)))
    for _ in range(steps):
        plant.measure(state)
        states.append(state - held.joints)
        assert control_step(tracker, state, reference, memory, row) == RUNNING
        actuate(actuation, integral, row[COLUMN.input : COLUMN.input + 6])
        line.append(row[first : first + 3].copy())
        plant.advance(line.pop(0), np.array(point.tilt), air, np.zeros(7))
    return np.array(states)


def linear_loop(
    scenario: Scenario, point: OperatingPoint, drive: Drive, offset: np.ndarray, steps: int
) -> np.ndarray:
    """The same of the linear loop."""
    design = design_controller("lqr+loop-shaping", scenario.design)
    inner = InnerLoop.of(LinearPlant.of(scenario, point, drive), design.gain)
    matrix = inner.closed_loop(AxisDesign.of_flat(design, PERIOD).robustifier).a
    x, states = np.append(offset, np.zeros(len(matrix) - 10)), []
    for _ in range(steps):
        states.append(x[:10])
        x = matrix @ x
    return np.array(states)


def misfit(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference, of each joint's own largest value but at least of the largest offset."""
    own = np.maximum(np.abs(expected).max(axis=0), np.abs(expected[0]).max())
    return float((np.abs(found - expected) / own).max())


OFFSET = 1e-6 * np.random.default_rng(1).normal(size=10)


@pytest.mark.parametrize(("drive", "name"), CASES)
def test_linear_loop_moves_as_the_real_one(drive: Drive, name: str) -> None:
    """Two hundred samples of MuJoCo, tilted, delayed, from an offset; and otherwise without the effect."""
    point, delay = OperatingPoint(0.6, (1.0, -0.5)), "effects.delay.seconds=0.004"
    scenario = default_scenario(overrides=[delay, *EFFECTS[name]])
    displaced = nonlinear_loop(scenario, point, drive, OFFSET, 200)
    assert misfit(linear_loop(scenario, point, drive, OFFSET, 200), displaced) < 2e-3
    assert np.abs(displaced[-1] - displaced[0]).max() > 3e-2 * np.abs(OFFSET).max(), "nothing moved"
    if name != "none" and drive == "velocity":
        plain = linear_loop(default_scenario(overrides=[delay]), point, drive, OFFSET, 200)
        assert misfit(plain, displaced) > 1e-2


@pytest.mark.parametrize(
    ("point", "steps"), [(OperatingPoint(0.25), 200), (OperatingPoint(0.6, (1.0, -0.5), -0.2), 60)], ids=str
)
def test_linear_loop_moves_as_the_real_one_with_all_effects_together(
    point: OperatingPoint, steps: int
) -> None:
    """By the difference of two runs, with offset and without: with a running rope the point moves on."""
    scenario = default_scenario(overrides=TOGETHER)
    still, displaced = (
        nonlinear_loop(scenario, point, "velocity", offset, steps) for offset in (np.zeros(10), OFFSET)
    )
    assert misfit(linear_loop(scenario, point, "velocity", OFFSET, steps), displaced - still) < 5e-3


@pytest.mark.parametrize("point", POINTS, ids=str)
@pytest.mark.parametrize("name", [*EFFECTS, "together"])
def test_one_step_leaves_an_equilibrium(name: str, point: OperatingPoint) -> None:
    """All that the engine has, the effects' own coordinates too; and not with another command."""
    overrides = TOGETHER if name == "together" else EFFECTS[name]
    scenario = default_scenario(overrides=overrides)
    plant, air = run_plant(scenario, "velocity"), air_of(scenario)
    equilibrium = OperatingPoint.find_equilibrium(plant, point, air, G)
    base, command = equilibrium.base, equilibrium.command
    set_state(plant, base, np.zeros(count_coordinates(plant)))
    plant.advance(command, np.array(point.tilt), air, np.zeros(7))
    assert np.abs(change_since(plant, base)).max() < 1e-7
    set_state(plant, base, np.zeros(count_coordinates(plant)))
    plant.advance(command + np.array([0.0, 0.0, 1e-3]), np.array(point.tilt), air, np.zeros(7))
    assert np.abs(change_since(plant, base)).max() > 1e-6


def test_a_turn_of_the_load_about_its_rope_is_no_state_of_the_loop() -> None:
    """Nothing depends on it, also where a running rope turns the load a little within the period."""
    scenario = default_scenario(overrides=["effects.body={}"])
    still, running = (
        LinearPlant.of(scenario, OperatingPoint(0.7, (0.5, 0.5), speed), "velocity") for speed in (0.0, -0.3)
    )
    assert running.system.a.shape == still.system.a.shape


def test_the_winch_is_told_to_haul_up_a_heavy_rope() -> None:
    """Its drive holds the load but not the rope's weight: a set-point of weight over gain upwards."""
    scenario = default_scenario(overrides=["effects.rope.mass=0.1"])
    command = OperatingPoint.find_equilibrium(
        run_plant(scenario, "velocity"), OperatingPoint(0.7), STILL, G
    ).command
    expected = -0.1 * 0.7 * G / scenario.rig.velocity_gains[2]
    assert command == pytest.approx([0.0, 0.0, expected], abs=1e-9)


def test_effects_are_taken_in_or_named() -> None:
    moving = ALL_EFFECTS.linear_part
    assert moving.names == ("friction", "rope", "body", "wind", "frame")
    assert moving.friction is not None
    assert moving.friction.coulomb == (0.0, 0.0, 0.0)
    assert moving.friction.viscous == ALL_EFFECTS.friction.viscous  # type: ignore[union-attr]
    assert present(ALL_EFFECTS, NOT_LINEAR) == [
        "limits",
        "sensing.position_resolution", "sensing.angle_resolution", "sensing.angle_noise",
        "friction.coulomb", "friction.pivot_coulomb",
        "wind.gust", "installation",
    ]  # fmt: skip
    assert present(ALL_EFFECTS, LINEAR) == [
        "delay", "rope", "body", "frame", "sensing.observer_bandwidth",
        "friction.viscous", "friction.pivot_viscous", "wind.mean",
    ]  # fmt: skip
    assert present(moving, NOT_LINEAR) == []
    assert present(NO_EFFECTS, NOT_LINEAR) == present(NO_EFFECTS, LINEAR) == []
    touched = {name.split(".")[0] for name in present(ALL_EFFECTS, NOT_LINEAR) + present(ALL_EFFECTS, LINEAR)}
    assert touched == set(ALL_EFFECTS.names)


def test_a_point_without_equilibrium_is_refused() -> None:
    scenario = default_scenario(overrides=["effects.wind={mean=[60.0,0.0,0.0],drag_area=5.0}"])
    with pytest.raises(InputError, match="there is no equilibrium"):
        OperatingPoint.find_equilibrium(
            run_plant(scenario, "velocity"), OperatingPoint(0.7), air_of(scenario), G
        )


def test_hanging_still_with_ideal_drives_it_is_the_design_model() -> None:
    """What is left, the input held instead of v, is of the order of a period."""
    design = design_controller("lqr")
    inner = InnerLoop.of(LinearPlant.of(default_scenario(), OperatingPoint(0.7), "ideal"), design.gain)
    z = np.exp(1j * PERIOD * np.array([0.01, 0.1, 1.0, 3.0, 10.0]))
    expected = AxisDesign.of_flat(design, PERIOD).inner_loop().response(z)
    found = inner.response(z)
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.abs(found - expected).max() < 0.01 * scale.max()
    assert (np.abs(found - expected) < 0.02 * scale).all()
    shorter = InnerLoop.of(LinearPlant.of(default_scenario(), OperatingPoint(0.2), "velocity"), design.gain)
    assert (np.abs(shorter.response(z) - expected) > 0.02 * scale).any()


@pytest.mark.parametrize("delay", [1, 20])
def test_delay_beside_the_matrices_is_delay_as_states(delay: int) -> None:
    scenario = default_scenario(overrides=[f"effects.delay.seconds={delay * PERIOD}"])
    plant = LinearPlant.of(scenario, OperatingPoint(0.5, (0.5, 0.0)), "velocity")
    inner = InnerLoop.of(plant, design_controller("lqr").gain)
    assert plant.delay == delay
    assert len(inner.arriving.a) == 15 + 3 * delay
    z = np.exp(1j * np.array([1e-4, 1e-3, 1e-2, 0.1, 1.0, 3.0]))
    expected = inner.arriving.response(z)[:, 3:, 3:]
    assert np.abs(inner.response(z) - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize("controller", ["lqr+loop-shaping", "lqr-integral"])
@pytest.mark.parametrize("delay", [0, 4])
def test_linear_loop_with_observer_moves_as_a_run(delay: int, controller: str) -> None:
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
    point, design = OperatingPoint(0.6), ALL_CONTROLLERS.design(controller, scenario)
    loop = make_nominal_loops(scenario, design, [point])[point.rope_length]
    inner = loop.inner_loop(scenario, point, "velocity")
    matrix = inner.closed_loop(loop.opening.axis.robustifier).a
    seen = np.arange(10) if loop.opening.name == "v-bar" else np.delete(np.arange(10), [ROPE, ROPE_RATE])
    held, offset = np.zeros(10), np.zeros(10)
    held[ROPE] = point.rope_length
    places = seen[seen % 2 == 0]
    offset[places] = 1e-6 * np.random.default_rng(2).normal(size=len(places))
    plan = replace(Plan.of(scenario), initial_state=held)
    plan.reference[:] = 0.0
    plan.reference[:, 2] = -point.rope_length
    law, plant = PreparedController.of(scenario, design, "velocity", plan), run_plant(scenario, "velocity")
    loop = Loop(plan, plant, law, compiled=False)
    loop.inputs = loop.inputs._replace(stop_outside=False)
    plant.reset(held + offset)
    _, record, _, _ = loop.advance(200)
    assert len(record) == 200
    x = np.zeros(len(matrix))
    x[: len(seen)] = offset[seen]
    for joints in record[:, seen] - held[seen]:
        assert x[: len(seen)] == pytest.approx(joints, abs=3e-3 * np.abs(offset).max())
        x = matrix @ x
    assert np.abs(record[-1, :10] - record[0, :10]).max() > 0.1 * np.abs(offset).max(), "nothing moved"


@pytest.mark.parametrize("tilt", [(20.0, 0.0), (14.02, 0.0), (0.0, -20.0), (3.0, 14.02)])
def test_more_than_gravity_holds_is_refused(tilt: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="disturbance of"):
        tilt_angles(OperatingPoint(0.7, tilt), G)

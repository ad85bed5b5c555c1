"""All physical effects together, what is refused, and that both ways of stepping give the same bits."""

import itertools

import mujoco
import numpy as np
import pytest

from cranectl.plants.capabilities import check_effects
from cranectl.plants.mujoco.model import JOINTS, drive_addresses, fastest_rate, model_spec
from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.plant import DRIVES, MAX_RATE_STEP
from cranectl.scenario.effects import (
    NO_EFFECTS,
    NO_LIMIT,
    Body,
    Delay,
    DriveLimits,
    EffectSettings,
    Frame,
    Friction,
    Rope,
    Sensing,
    Wind,
)
from cranectl.scenario.rig import RigParameters
from cranectl.signals import BASE_WIDTH
from cranectl.support.errors import InputError
from tests.conftest import PLANTS
from tests.plants.effects import HANGING, RIG, SWINGING, make, simulate

PHYSICAL = {"friction": Friction(), "limits": DriveLimits(), "rope": Rope(), "body": Body(), "frame": Frame()}
ALL = EffectSettings(**PHYSICAL)
STRUCTURES = [
    EffectSettings(**{name: PHYSICAL[name] for name in names})
    for count in (1, 2, 3)
    for names in itertools.combinations(("rope", "body", "frame"), count)
]


def names_of(effects: EffectSettings) -> str:
    return "+".join(effects.names)


def bearing(effects: EffectSettings, drive: str, command: tuple[float, float, float]) -> np.ndarray:
    """Return `command`, for force drives plus the weight of load and rope, which servos hold themselves."""
    if drive != "force":
        return np.array(command)
    rope = effects.rope.mass * HANGING[4] if effects.rope else 0.0
    return np.array(command) - (0.0, 0.0, (RIG.load_mass + rope) * RIG.gravity)


@pytest.mark.parametrize("effects", [*STRUCTURES, ALL], ids=names_of)
@pytest.mark.parametrize("drive", DRIVES)
def test_any_combination_hangs_still_and_swings_on(effects: EffectSettings, drive: str) -> None:
    still = bearing(effects, drive, (0.0, 0.0, 0.0))
    states, loads = simulate(make(effects, drive=drive, substeps=10), 20, still)
    # The winch's servo holds the load, and sinks by its gain under the weight of the rope.
    sinking = Rope().mass * HANGING[4] * RIG.gravity / RIG.velocity_gains[2]
    assert states == pytest.approx(np.tile(HANGING, (20, 1)), abs=1.01 * sinking)
    assert loads[:, :3] == pytest.approx(np.tile([1.0, 0.7, -0.8], (20, 1)), abs=5e-4)
    command = (0.2, -0.1, 0.05)
    plain, _ = simulate(
        make(NO_EFFECTS, drive=drive, start=SWINGING), 50, bearing(NO_EFFECTS, drive, command)
    )
    states, loads = simulate(make(effects, drive=drive, start=SWINGING), 50, bearing(effects, drive, command))
    assert np.isfinite(states).all()
    assert loads[:, 6].min() > 0.0
    assert np.abs(states - plain)[:, ::2].max() < 0.01
    assert np.abs(states - plain).max() > 1e-6, "the effects must do something"


@pytest.mark.parametrize("drive", DRIVES)
def test_compiled_steps_and_steps_through_the_binding_are_the_same(drive: str) -> None:
    from cranectl.plants.mujoco.plant import advance

    loads, states = np.zeros((2, 200, 7)), np.zeros((2, 10))
    plants = [make(ALL.model_copy(update={"wind": Wind()}), drive=drive, start=SWINGING) for _ in range(2)]
    command, disturbance, wind = (
        np.array([0.2, -0.1, 0.3]),
        np.array([0.3, -0.2]),
        np.array([1.0, 0.5, 0, 0.3, 2, 1]),
    )
    for k in range(200):
        plants[0].advance(command, disturbance, wind, loads[0, k])
        advance(plants[1].rig, command, disturbance, wind, loads[1, k])
    for plant, state in zip(plants, states, strict=True):
        plant.measure(state)
        assert plant.warnings() == 0
    assert np.array_equal(loads[0], loads[1])
    assert np.array_equal(states[0], states[1])


@pytest.mark.parametrize("load_mass", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize(
    "effects",
    [
        EffectSettings(rope=Rope(mass=1e-30)),
        EffectSettings(rope=Rope(mass=100.0, stiffness=1e2)),
        EffectSettings(rope=Rope(stiffness=1e9, damping_ratio=10.0)),
        EffectSettings(body=Body(hook_offset=0.0)),
        EffectSettings(body=Body(inertia=1e6)),
        EffectSettings(body=Body(inertia=1e-9, swing_damping=1e6)),
        EffectSettings(frame=Frame(mass=1e6, frequency=(1e-6, 1e-6))),
        EffectSettings(friction=Friction(coulomb=(1e6, 1e6, 1e6), pivot_coulomb=1e6)),
        EffectSettings(limits=DriveLimits(force=(1e-6, 1e-6, 1e-6))),
    ],
    ids=str,
)
def test_extreme_settings_run_or_are_refused(effects: EffectSettings, load_mass: float) -> None:
    for drive in DRIVES:
        message = ""
        try:
            plant = make(effects, drive=drive, rig=RigParameters(load_mass=load_mass), start=SWINGING)
            states, loads = simulate(plant, 20)
        except InputError as error:
            message = error.found
        assert "too fast for steps" in message or (np.isfinite(states).all() and np.isfinite(loads).all())


def test_a_reset_undoes_everything() -> None:
    plant = make(ALL, drive="velocity", start=SWINGING)
    first = simulate(plant, 100, (0.3, -0.2, 0.2), (1.0, 0.5), np.ones(6))
    plant.reset(SWINGING)
    second = simulate(plant, 100, (0.3, -0.2, 0.2), (1.0, 0.5), np.ones(6))
    assert np.array_equal(first[0], second[0])
    assert np.array_equal(first[1], second[1])


@pytest.mark.parametrize("drive", DRIVES)
def test_what_is_on_is_in_the_description_and_only_that(drive: str) -> None:
    plain, full = (make(effects, drive=drive).description for effects in (NO_EFFECTS, ALL))
    for element in ("frame_x", "frame_y", "swing", "hook_distance", "rope_elasticity", "rope_mass"):
        assert f'name="{element}"' in full
        assert f'name="{element}"' not in plain
    assert "frictionloss" in full
    assert "frictionloss" not in plain
    assert full.count("forcerange") == plain.count("forcerange") + (1 if drive == "ideal" else 4)
    model = mujoco.MjModel.from_xml_string(full)
    assert model.nv == make(ALL, drive=drive).model.nv


def test_the_driven_joints_and_drives_keep_their_names_under_all_effects() -> None:
    model = model_spec(RIG, drive="velocity", step=1e-3, effects=ALL).compile()
    assert [model.joint(name).name for name in JOINTS] == list(JOINTS)
    assert model.actuator_gainprm[drive_addresses(model), 0] == pytest.approx(RIG.velocity_gains)
    assert model.joint("rope_length").armature[0] == RIG.winch_mass
    total = sum(model.body(name).mass[0] for name in ("bridge", "trolley", "hook", "load", "winch"))
    assert total == pytest.approx(RIG.bridge_mass + RIG.trolley_mass + RIG.load_mass, rel=1e-8)


def test_a_closed_loop_runs_through_with_all_effects() -> None:
    from cranectl.planning import load_scenario
    from cranectl.simulate import simulate_run

    tables = [f"effects.{name}={{}}" for name in (*PHYSICAL, "wind")]
    scenario = load_scenario("fixed-position", overrides=["duration=3", "disturbances=[]", *tables])
    runs = [
        simulate_run(scenario, plant="mujoco", drive="velocity", controller="lqr", compiled=compiled)
        for compiled in (True, False)
    ]
    assert all(run.status.label == "completed" for run in runs)
    assert np.array_equal(runs[0].table[:, :BASE_WIDTH], runs[1].table[:, :BASE_WIDTH])
    assert np.abs(runs[0].load_position[-1] - runs[0].reference[-1, :3]).max() < 0.02


# What is refused


@pytest.mark.parametrize("name", ["rope", "body", "frame", "friction", "limits"])
def test_the_analytic_plant_refuses_what_it_cannot_show(name: str) -> None:
    effects = EffectSettings(**{name: PHYSICAL[name]})
    with pytest.raises(InputError, match=f"effects.{name}") as caught:
        check_effects(effects, plant="analytic", drive="velocity")
    assert caught.value.allowed
    assert "mujoco" in caught.value.remedy
    check_effects(effects, plant="mujoco", drive="velocity")


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    "effects",
    [
        EffectSettings(friction=Friction(viscous=(0.0, 0.0, 0.0))),
        EffectSettings(friction=Friction(coulomb=(0.0, 0.0, 0.0))),
    ],
)
def test_ideal_drives_refuse_forces(effects: EffectSettings, plant: str) -> None:
    with pytest.raises(InputError, match="analytic plant" if plant == "analytic" else "with ideal drives"):
        check_effects(effects, plant=plant, drive="ideal")


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("force", [(NO_LIMIT,) * 3, (60.0, 40.0, 30.0)])
def test_ideal_drives_refuse_limits(force: tuple[float, float, float], plant: str) -> None:
    """They take accelerations, so a limit of velocity has no effect."""
    with pytest.raises(InputError, match="with ideal drives") as caught:
        check_effects(EffectSettings(limits=DriveLimits(force=force)), plant=plant, drive="ideal")
    assert "--drive velocity" in caught.value.remedy


@pytest.mark.parametrize(("plant", "drive"), list(itertools.product(PLANTS, DRIVES)))
def test_effects_that_suit_every_plant_are_accepted(plant: str, drive: str) -> None:
    zero = (0.0, 0.0, 0.0)
    friction = Friction(coulomb=zero, viscous=zero)
    limits = DriveLimits(force=(NO_LIMIT,) * 3) if drive == "velocity" else None
    effects = EffectSettings(friction=friction, limits=limits, wind=Wind(), sensing=Sensing(), delay=Delay())
    check_effects(effects, plant=plant, drive=drive)
    check_effects(NO_EFFECTS, plant=plant, drive=drive)
    if plant != "analytic":
        check_effects(EffectSettings(rope=Rope(), body=Body(), frame=Frame()), plant=plant, drive=drive)


# Steps that are short enough


def test_the_fastest_rate_is_that_of_the_rope() -> None:
    """Two masses on a spring: sqrt(K (1/m + 1/m_w)); on ideal drives the load alone."""
    for drive, mobility in (("ideal", 1.0), ("velocity", 1.0 + 1.0 / RIG.winch_mass)):
        rope = Rope(stiffness=1e6, damping_ratio=0.0, mass=0.0)
        plant = make(EffectSettings(rope=rope), drive=drive, step=1e-4)
        expected = np.sqrt(1e6 / HANGING[4] * mobility / RIG.load_mass)
        assert fastest_rate(plant.model, plant.data) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    "effects",
    [
        EffectSettings(rope=Rope(stiffness=1e8)),
        EffectSettings(frame=Frame(frequency=(1000.0, 10.0))),
        EffectSettings(body=Body(inertia=1e-8)),
        EffectSettings(friction=Friction(viscous=(1e5, 0.0, 0.0))),
    ],
    ids=names_of,
)
def test_too_fast_a_motion_is_refused_and_the_step_named_is_short_enough(effects: EffectSettings) -> None:
    with pytest.raises(InputError, match="too fast for steps") as caught:
        make(effects, drive="velocity")
    step = float(caught.value.remedy.split("physics_step to ")[1].split()[0])
    states, _ = simulate(make(effects, drive="velocity", step=step, start=SWINGING), 200)
    assert np.isfinite(states).all()
    assert step > 1e-7


def test_beyond_its_limit_the_integrator_really_is_unstable() -> None:
    """Without the check, a frame with a rate 1.5 times the limit is unstable."""
    frequency = 1.5 * MAX_RATE_STEP / 1e-3 / (2 * np.pi)
    frame = Frame(frequency=(frequency, frequency), damping_ratio=0.0)
    plant = MujocoPlant(
        RigParameters(load_mass=1e-3), drive="ideal", step=1e-3, substeps=1,
        effects=EffectSettings(frame=frame),
    )  # fmt: skip
    plant._restart(HANGING)
    index = plant.model.joint("frame_x").qposadr[0]
    plant.data.qpos[index] = 1e-6
    simulate(plant, 60)
    assert not abs(plant.data.qpos[index]) < 1e-3


def test_a_rope_shorter_than_the_way_from_hook_to_load_is_refused() -> None:
    plant = make(EffectSettings(body=Body(hook_offset=0.1)))
    plant.check_length(0.11)
    with pytest.raises(InputError, match="hook_offset"):
        plant.check_length(0.1)

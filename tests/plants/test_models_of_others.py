"""Models with what public models of cranes have: a run is that of bare MuJoCo under the same commands."""

import json
import shlex
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cranectl import open_run
from cranectl.cli.main import main
from cranectl.compare.agreement import judge
from cranectl.planning import load_scenario
from cranectl.plants.mujoco.disturbed_step import step_in_stages
from cranectl.plants.mujoco.own_check import find_differences
from cranectl.plants.mujoco.own_model import open_model
from cranectl.plants.mujoco.own_plant import OwnPlant
from cranectl.plants.mujoco.own_ranges import axis_ranges
from cranectl.plants.registry import PLANTS
from cranectl.scenario import Scenario
from cranectl.scenario.effects import NO_EFFECTS
from cranectl.scenario.load import RigFile
from cranectl.scenario.rig import ModelNames, RigParameters
from cranectl.simulate import Run, simulate_run
from tests.conftest import STILL
from tests.plants.own_models import (
    MODELS,
    UNDISTURBED,
    at_rest,
    beside_bare_mujoco,
    changed,
    crane_with,
    points_of,
)

pytestmark = pytest.mark.usefixtures("in_empty_directory", "no_model_afterwards")

JOINTS = ("bridge_position", "trolley_position", "rope_length", "alpha", "beta")
MOVED = ["duration=3", "control.physics_step=0.001", UNDISTURBED]
# Drives in place of those of the shipped model, by what public models do with them.
FILTERED = (
    '<general name="{name}" joint="{joint}" dyntype="filterexact" dynprm="0.05" gainprm="{gain}" '
    'biastype="affine" biasprm="{weight} 0 -{gain}"/>'
)
MOVING = (
    '<general name="{name}" joint="{joint}" dyntype="integrator" gainprm="{stiff}" actrange="-9 9" '
    'biastype="affine" biasprm="0 -{stiff} -{gain}"/>'
)
BACKWARDS = (
    '<general name="{name}" joint="{joint}" gear="-2" gainprm="{gain}" biastype="affine" '
    'biasprm="{lifted} 0 -{gain}"/>'
)


def with_drives(folder: Path, text: str) -> Path:
    """Write the shipped model with other drives, and return its file."""
    drives = []
    for name, joint, gain, weight in zip(
        ("bridge", "trolley", "winch"), JOINTS, (425.0, 125.0, 70.0), (0.0, 0.0, -9.81), strict=False
    ):
        numbers = {"gain": gain, "stiff": 10.0 * gain, "weight": weight, "lifted": -0.5 * weight}
        drives.append(text.format(name=f"{name}_drive", joint=joint, **numbers))
    file = crane_with(folder)
    before, _, rest = file.read_text().partition("<actuator>")
    _, end, after = rest.partition("</actuator>")
    file.write_text(f"{before}<actuator>{''.join(drives)}{end}{after}")
    return file


def run_of(file: Path) -> Run:
    """Return a run of three seconds of a model, on the rig that `info` prints for it."""
    name = PLANTS.find(str(file)).name
    scenario = scenario_of(file, "initial.load_offset=[0.02, -0.01, 0.0]")
    return simulate_run(scenario, plant=name, drive="velocity", controller="lqr")


def scenario_of(file: Path, *settings: str) -> Scenario:
    """Return a scenario of three seconds on the rig that `info` prints for a model."""
    numbers = [f"rig.{key}={value!r}" for key, value in open_model(file, ModelNames()).built_in.items()]
    return load_scenario("fixed-position", overrides=[*MOVED, *numbers, *settings])


def at_set_points(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Begin with set-points at the positions, and beyond by what the winch needs to hold 9.81 N."""
    mujoco.mj_fwdPosition(model, data)
    data.act[:] = data.actuator_length - np.array([0.0, 0.0, 9.81 / 700.0])


CASES = {
    "a filter of 50 ms": (FILTERED, at_rest, 1.0, "filter of 0.05 s before bridge_drive", 0.07),
    "an integrated velocity": (MOVING, at_set_points, 1.0, "position servos", 0.1),
    "backwards, with a gear": (BACKWARDS, at_rest, -2.0, "", 0.005),
}


@pytest.mark.parametrize("case", CASES)
def test_a_run_is_that_of_bare_mujoco(case: str, tmp_path: Path) -> None:
    """Also its lag is told: of a filter and a servo behind it, the sum."""
    drives, begin, scale, difference, lag = CASES[case]
    file = with_drives(tmp_path, drives)
    scenario = scenario_of(file, "reference.start=[0.0, 0.0, -0.7]")
    states, points = beside_bare_mujoco(file, scenario, "velocity", begin=begin, scale=scale)
    assert np.abs(points_of(states) - points).max() < 1e-9
    assert np.ptp(states[:, 0:6:2], axis=0).min() > 0.01, "it hardly moved"
    run = run_of(file)
    assert run.scenario.rig.bridge_time_constant == pytest.approx(lag, rel=1e-9)
    differs = PLANTS[run.plant].differs
    assert difference in differs
    assert bool(difference) is bool(differs)


def test_a_drive_that_runs_backwards_is_the_shipped_crane(tmp_path: Path) -> None:
    """With half the lag by its gear; nothing else of the crane knows of the sign."""
    own = run_of(with_drives(tmp_path, BACKWARDS))
    ours = simulate_run(own.scenario, plant="mujoco", drive="velocity", controller="lqr")
    assert np.abs(own.table[:, :10] - ours.table[:, :10]).max() < 1e-9
    assert judge(own, ours).passed


STOPPED = MOVING.replace('actrange="-9 9"', 'actrange="-9 0.69"')  # where the winch's set-point ends
PLAIN = FILTERED.replace("filterexact", "filter")  # which the engine advances by its scheme


@pytest.mark.parametrize("drives", [FILTERED, PLAIN, MOVING, STOPPED])
def test_stages_advance_activations_as_the_engine_does(drives: str, tmp_path: Path) -> None:
    """Wind and disturbances are stepped in stages of our own."""
    file, courses = with_drives(tmp_path, drives), []
    rig = RigParameters(**open_model(file, ModelNames()).built_in)
    for in_stages in (False, True):
        plant = OwnPlant(
            rig, file=str(file), name="mine", names=ModelNames(), drive="velocity", step=1e-3,
            effects=NO_EFFECTS, substeps=1,
        )  # fmt: skip
        plant.reset(plant.rest)
        for k in range(100):
            plant.set_command(np.array([0.5, -0.4, 0.3]) * np.sin(0.03 * k))
            if in_stages:
                step_in_stages(plant.rig, np.zeros(2), STILL)
            else:
                mujoco.mj_step(plant.model, plant.data)
        courses.append(np.concatenate([plant.data.qpos, plant.data.qvel, plant.data.act]))
    assert np.abs(courses[0] - courses[1]).max() < 1e-13
    assert np.abs(courses[0][-3:]).min() > 1e-3
    assert (courses[0][-1] == 0.69) == (drives == STOPPED)


def test_one_body_may_slide_along_x_and_y(tmp_path: Path) -> None:
    """It is our crane with a bridge of no mass of its own."""
    slides = '<joint name="y" type="slide" axis="0 1 0"/>'
    file = changed(
        MODELS / "tendon.xml",
        tmp_path,
        (slides, ""),
        (
            '<joint name="x" type="slide" axis="1 0 0"/>',
            f'<joint name="x" type="slide" axis="1 0 0"/>{slides}',
        ),
        ('mass="6"', 'mass="1e-3"'),
    )
    own = run_of(file)
    assert own.scenario.rig.bridge_mass == pytest.approx(1e-6)
    ours = simulate_run(own.scenario, plant="mujoco", drive="velocity", controller="lqr")
    assert np.abs(own.table[:, :10] - ours.table[:, :10]).max() < 2e-7
    assert judge(own, ours).passed


def test_the_lower_rail_may_run_along_y(tmp_path: Path) -> None:
    """It is our crane whose trolley has a motor as hard to move as that rail."""
    along_x, along_y = (f'type="slide" axis="{axis}"' for axis in ("1 0 0", "0 1 0"))
    names = [('name="x"', 'name="lower"'), ('name="y"', 'name="x"'), ('name="lower"', 'name="y"')]
    axes = [(along_x, "lower"), (along_y, along_x), ("lower", along_y)]
    file = changed(MODELS / "tendon.xml", tmp_path, *axes, *names)
    own = run_of(file)
    rig = own.scenario.rig
    assert (rig.bridge_mass, rig.trolley_mass + rig.bridge_mass) == pytest.approx((1e-6, 2.5))
    assert rig.trolley_motor_mass + rig.trolley_mass == pytest.approx(8.5)
    assert rig.time_constants == pytest.approx([2.5 / 425, 8.5 / 125, 1 / 50])
    ours = simulate_run(own.scenario, plant="mujoco", drive="velocity", controller="lqr")
    assert np.abs(own.table[:, :10] - ours.table[:, :10]).max() < 2e-7
    assert judge(own, ours).passed


NAMELESS = [('site name="pivot"', 'site name="top"'), ('site="pivot"', 'site="top"')]
UNNAMED = [
    *NAMELESS,
    ('body name="load"', 'body name="weight"'),
    ('<site name="load"/>', '<site name="end"/>'),
    ('site="load"', 'site="end"'),
]


@pytest.mark.parametrize("drives", [("a", "b", "c"), ("move x", "move_y", "it's a hoist")])
def test_names_that_are_missing_are_guessed_all_at_once(
    drives: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    named = [
        (f'"{part}_drive"', f'"{name}"')
        for part, name in zip(("bridge", "trolley", "winch"), drives, strict=True)
    ]
    changed(MODELS / "tendon.xml", tmp_path, *UNNAMED, *named)
    assert main(["info", "mine.xml"]) == 2
    error = capsys.readouterr().err
    assert error.count("no site named") == 2
    assert error.count("no actuator named") == 3
    given = shlex.split(error.splitlines()[-1].partition("add ")[2])
    assert main(["info", "mine.xml", *given]) == 0
    shown = capsys.readouterr().out
    assert all(json.dumps(name) in shown for name in (*drives, "top", "end")), "in the table of the rig"


@pytest.mark.parametrize(("pivot", "load"), [("trolley", "load"), ("beam", "ball")])
def test_bodies_and_shapes_stand_for_sites(pivot: str, load: str, tmp_path: Path) -> None:
    """Where they are those of a site, they show the same crane."""
    file = changed(
        MODELS / "tendon.xml",
        tmp_path,
        ('<site name="pivot"/>', '<site name="top"/><geom name="beam" size="0.1" mass="0"/>'),
        ('site="pivot"', 'site="top"'),
        ('<site name="load"/>', '<site name="end"/><geom name="ball" size="0.05" mass="0"/>'),
        ('site="load"', 'site="end"'),
    )
    own = open_model(file, ModelNames(pivot=pivot, load=load))
    assert own.rest[4] == pytest.approx(0.7)
    assert own.load_mass == pytest.approx(1.0)


def test_of_a_body_that_is_the_load_the_centre_of_mass_counts(tmp_path: Path) -> None:
    file = crane_with(
        tmp_path,
        ('<inertial pos="0 0 0" mass="1"', '<inertial pos="0 0 -0.1" mass="1"'),
        ('<site name="load" pos="0 0 0"/>', '<site name="end" pos="0 0 0"/>'),
        ('site="load"', 'site="end"'),
        ('objname="load"', 'objname="end"'),
    )
    own = open_model(file, ModelNames())
    assert own.rest[4] == pytest.approx(0.8)
    assert find_differences(own) == ()


def test_a_keyframe_has_the_pose_that_the_file_has_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A hoist at 0 in the file is a rope without length."""
    keys = '<keyframe><key name="hangs" qpos="0.1 0.2 0.1 0.2 -0.5 1 0 0 0"/></keyframe></mujoco>'
    changed(
        MODELS / "tendon.xml",
        tmp_path,
        ("</mujoco>", keys),
        ('name="load" pos="0 0 -0.7"', 'name="load"'),
        (
            '<joint name="x" type="slide" axis="1 0 0"/>',
            '<joint name="x" type="slide" axis="-1 0 0" range="-3 1"/>',
        ),
        ('joint="x" kv="425"', 'joint="x" kv="425" gear="-1"'),
    )
    assert main(["info", "mine.xml"]) == 2
    error = capsys.readouterr().err
    assert "in the pose of the file, a rope of 0 m" in error
    assert "add --set rig.plant.names.keyframe=hangs" in error
    assert main(["info", "mine.xml", "--set", "rig.plant.names.keyframe=hangs"]) == 0
    shown = capsys.readouterr().out
    assert 'keyframe = "hangs"' in shown
    assert "bridge_range = [-1.0, 3.0]" in shown, "the joint runs along -x"


def test_other_names_are_refused_with_what_there_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys = '<keyframe><key name="hangs" qpos="0.1 0.2 0.1 0.2 -0.5 1 0 0 0"/></keyframe></mujoco>'
    changed(MODELS / "tendon.xml", tmp_path, ("</mujoco>", keys), name="keyed")
    unnamed = changed(MODELS / "tendon.xml", tmp_path, ('name="winch_drive"', "")).read_text()
    before, _, after = unnamed.partition("<velocity")
    Path("two.xml").write_text(before + after.partition("/>")[2])
    for line, remedy in (
        ("keyed.xml --set rig.plant.names.keyframe=up", "add --set rig.plant.names.keyframe=hangs"),
        ("mine.xml --set rig.plant.names.keyframe=up", "leave out rig.plant.names.keyframe"),
        ("mine.xml", "add --set rig.plant.names.winch_drive=NAME, or add it to the file"),
    ):
        assert main(["info", *line.split()]) == 2
        assert capsys.readouterr().err.splitlines()[-1].endswith(remedy)


CART = """
<mujoco>
  <worldbody>
    <body name="cart" pos="0.2 0 1">
      <joint name="slider" type="slide" axis="{axis}" range="-1 1"/>
      <inertial pos="0 0 0" mass="0.6" diaginertia="1e-3 1e-3 1e-3"/>
      <body name="pole">
        <joint name="hinge" type="hinge" axis="{hinge}"/>
        {winch}
        <inertial pos="0 0 -0.4" mass="0.2" diaginertia="{inertia} {inertia} 1e-12"/>
        <geom name="bob" pos="0 0 -0.4" size="0.02" mass="0"/>
      </body>
    </body>
  </worldbody>
  <actuator>{drives}</actuator>
</mujoco>
"""
LIFT = '<joint name="lift" type="slide" axis="0 0 -1" armature="0.05"/>'
SERVO = '<velocity name="push" joint="slider" kv="{}"/>'
HOIST = '<general name="hoist" joint="lift" gainprm="10" biastype="affine" biasprm="-1.962 0 -10"/>'
POSITIONED = '<position name="push" joint="slider" kp="85"/>'
MOTOR = '<motor name="push" joint="slider"/>'
START = ([0.2, 0.0, -0.4], [0.2, 0.0, -0.4])
PLANAR = {
    "a cart with a motor": ({}, "force", 1e-12),
    "a cart along y": ({"axis": "0 1 0", "hinge": "1 0 0"}, "force", 1e-12),
    "a cart with a servo": ({"drives": SERVO.format(30)}, "velocity", 1e-12),
    "a cart with a hoist": ({"winch": LIFT, "drives": SERVO.format(30) + HOIST}, "velocity", 1e-12),
    "a long load": ({"inertia": "0.004"}, "force", 0.004),
}


@pytest.mark.parametrize("case", PLANAR)
def test_a_cart_with_a_pendulum_runs_after_its_names_are_pasted(
    case: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """With one line of `info`, and with the rig that it prints. Bare MuJoCo moves in the same way."""
    changes, drive, inertia = PLANAR[case]
    parts = {"axis": "1 0 0", "hinge": "0 1 0", "winch": "", "inertia": "1e-12", "drives": MOTOR} | changes
    Path("cart.xml").write_text(CART.format(**parts))
    assert main(["info", "cart.xml"]) == 2
    given = shlex.split(capsys.readouterr().err.splitlines()[-1].partition("add ")[2])
    assert main(["info", "cart.xml", "--as-is", *given]) == 0
    _, _, lines = capsys.readouterr().out.partition("  model = ")
    Path("rig.toml").write_text(f"model = {lines}".replace("\n  ", "\n"))
    assert main(["new", "model", "cart.xml"]) == 0, "it guesses the same at once"
    *_, look, run_it = (line.partition("cranectl ")[2] for line in capsys.readouterr().out.splitlines())
    assert main([*shlex.split(look), "--as-is"]) == 0
    assert main(shlex.split(run_it)) == 0
    assert RigFile.load("cart-rig.toml") == RigFile.load("rig.toml")
    along = int(parts["axis"] == "0 1 0")
    overrides = ["duration=2", "disturbances=[]", f"reference.start={START[along]}"]
    scenario = load_scenario("fixed-position", rig="rig.toml", overrides=overrides)
    # A pendulum with an inertia J swings as a point of the mass m + J / l² on the same rope.
    assert scenario.rig.load_mass == pytest.approx(0.2 + inertia / 0.4**2, rel=1e-5)
    run = open_run(scenario, plant="cart.xml", drive=drive)
    model = mujoco.MjModel.from_xml_path("cart.xml")
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, 1e-3
    data, ours = mujoco.MjData(model), open_run(scenario, plant="mujoco", drive=drive)
    for k in range(1500):
        command = np.zeros(3)
        command[along] = 0.8 * np.sin(0.004 * k)
        run.step(command)
        ours.step(command)
        data.ctrl[0] = command[along]
        mujoco.mj_step(model, data)
        angle = -data.qpos[1] if along == 0 else data.qpos[1]
        shown = run.state[2 * along], run.state[8 - 2 * along]
        assert shown == pytest.approx((0.2 * (1 - along) + data.qpos[0], angle), abs=1e-9)
    assert abs(angle) > 0.01
    beside = np.abs(run.state - ours.state).max()
    assert beside < 1e-7 if case != "a long load" else beside > 1e-4


def test_a_rig_begins_at_the_keyframe_in_which_the_load_hangs() -> None:
    changed(
        MODELS / "tendon.xml",
        Path(),
        ("</mujoco>", '<keyframe><key name="hangs" qpos="0 0 0 0 -0.5 1 0 0 0"/></keyframe></mujoco>'),
        ('name="load" pos="0 0 -0.7"', 'name="load"'),
    )
    assert main(["new", "model", "mine.xml"]) == 0
    rig = RigFile.load("mine-rig.toml")
    assert rig.plant.names.keyframe == "hangs"
    assert rig.rope_range == pytest.approx((0.25, 0.75)), "half a rope to each side"


def test_a_model_that_is_no_crane_gets_no_rig(capsys: pytest.CaptureFixture[str]) -> None:
    Path("box.xml").write_text(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    )
    assert main(["new", "model", "box.xml"]) == 2
    assert "nothing shows what is its pivot or its load" in capsys.readouterr().err
    Path("cart.xml").write_text(CART.format(axis="1 0 0", hinge="0 1 0", winch="", inertia="1", drives=""))
    assert main(["new", "model", "cart.xml"]) == 2
    assert "nothing shows what is its drive along x or y" in capsys.readouterr().err
    parts = {"axis": "1 0 0", "hinge": "0 1 0", "inertia": "1e-12"}
    for winch, drives, why in (
        (LIFT, MOTOR, "the joint lift lengthens the rope, and no actuator moves it"),
        ("", POSITIONED, "the position servo push has no kv, and nothing else damps its axis"),
    ):
        Path("cart.xml").write_text(CART.format(winch=winch, drives=drives, **parts))
        assert main(["new", "model", "cart.xml"]) == 2
        assert why in capsys.readouterr().err
    assert not [*Path().glob("*-rig.toml")]


def test_what_damps_a_joint_is_part_of_its_position_servo(capsys: pytest.CaptureFixture[str]) -> None:
    """The commonest form of MJCF: kp in the servo, and damping in the joint; a gear of 2 makes a quarter."""
    text = CART.format(axis="1 0 0", hinge="0 1 0", inertia="1e-12", winch="", drives=POSITIONED)
    text = text.replace('name="slider"', 'name="slider" damping="12"')
    for gear, lag in ((1, 12.0 / 85.0), (2, 3.0 / 85.0)):
        Path("cart.xml").write_text(text.replace('kp="85"', f'kp="85" gear="{gear}"'))
        own = open_model(
            Path("cart.xml"),
            ModelNames(pivot="cart", load="bob", bridge_drive="push", trolley_drive="", winch_drive=""),
        )
        assert own.built_in["bridge_time_constant"] == pytest.approx(lag, rel=1e-12)
    assert main(["new", "model", "cart.xml"]) == 0
    assert main(["info", "cart.xml", "--rig", "cart-rig.toml", "--as-is"]) == 0
    assert "damping of slider" in capsys.readouterr().out


@pytest.mark.parametrize(("limits", "expected"), [("0.3 1.2", (0.3, 1.2)), ("0 2", (1e-3, 2.0))])
def test_the_rope_is_as_long_as_the_tendon_of_its_winch_may_be(
    limits: str, expected: tuple[float, float]
) -> None:
    """From the pivot to the load the tendon is the rope; what nothing limits is told apart."""
    file = changed(
        MODELS / "tendon.xml",
        Path(),
        ('<spatial name="rope"', f'<spatial name="rope" limited="true" range="{limits}"'),
    )
    found, assumed = axis_ranges(open_model(file, ModelNames()))
    assert found == {"rope_range": pytest.approx(expected)}
    assert assumed == {
        "bridge_range": pytest.approx((-2.1, 2.1)), "trolley_range": pytest.approx((-2.1, 2.1)),
    }  # fmt: skip

"""The check of a model file names each difference from the rigid crane with its size and meaning."""

import shutil
from math import inf
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.plants.mujoco.own_check import ModelDifference, find_differences
from cranectl.plants.mujoco.own_model import open_model
from cranectl.plants.mujoco.own_motion import MOTION_SAMPLES, CauseSize, TrialMotion, cause_sizes
from cranectl.scenario.rig import ModelNames
from cranectl.support import Array
from cranectl.support.resources import Shipped
from tests.plants.own_models import MODELS, NAMES, changed, servos

WIRE = (
    '<spatial name="wire" stiffness="9" springlength="0.1"><site site="pivot"/><site site="load"/></spatial>'
)
SLING = (
    '<body name="sling" pos="0 0 -0.3"><joint type="ball"/>'
    '<geom size="0.02" mass="0.1" pos="0 0 -0.1"/></body>'
)
LOAD = '<body name="load" pos="0 0 -0.8">'
CHAIN = (
    '<body name="chain"><joint type="hinge" axis="1 0 0"/><joint type="hinge" axis="0 1 0"/>'
    f'<inertial pos="0 0 -0.4" mass="0.2" diaginertia="0.01 0.01 1e-9"/></body>{LOAD}'
)
FLOOR = '<geom name="floor" type="plane" size="5 5 1" pos="0 0 1.06"/><body name="trolley" pos="0 0 2">'
BRAKE = '<actuator><velocity name="brake" joint="x" kv="50"/>'
WELD = '<equality><weld body1="load"/></equality><actuator>'
HELD = "a winch that does not hold the weight"
ARMATURE = "armature of rope, which MuJoCo 4.0.0 gets wrong where both ends move"


# By model: text that is changed, new text, what must differ, by how much to a half [m/s²], and why.
MUTANTS = {
    "crane": [
        ('biasprm="-9.81 0 -70"', 'biasprm="0 0 -70"', "rope at rest", 7.01, HELD),
        ('joint name="beta"', 'joint name="beta" stiffness="0.5"', "swing", 0.2, "stiffness of beta"),
        (
            'name="bridge_position" type',
            'name="bridge_position" frictionloss="1" type',
            "bridge",
            0.12,
            "frictionloss of bridge_position",
        ),
        (
            'name="trolley_position" type',
            'name="trolley_position" damping="2" type',
            "trolley",
            0.5,
            "damping of trolley_position",
        ),
        (
            'diaginertia="1e-15 1e-15 1e-15"',
            'diaginertia="1e-3 1e-3 1e-3"',
            "swing",
            0.016,
            "inertia of load",
        ),
        (
            'kv="425"',
            'kv="425" ctrlrange="-1 1"',
            "limits of drives",
            0.0,
            "of control or force of bridge_drive",
        ),
        ("</spatial>", f"</spatial>{WIRE}", "rope", 1.0, "stiffness of wire"),
    ],
    "tendon": [
        ('name="rope"', 'name="rope" armature="0.4"', "rope", 0.11, ARMATURE),
        (
            '<site name="load"/>',
            '<site name="load" pos="1e-3 0 0"/>',
            "swing",
            0.0047,
            "centre of mass of load 1 mm from",
        ),
        (
            '<site name="load"/>',
            '<site name="load" pos="0.025 0 0"/>',
            "rope at rest",
            6.1,
            "centre of mass of load 25",
        ),
        ('name="rope"', 'name="rope" damping="2"', "rope", 1.6, "damping of rope"),
        ('name="rope"', 'name="rope" frictionloss="1"', "rope", 1.0, "frictionloss of rope"),
        ('kv="125"', 'kv="125" forcerange="-9 9"', "limits of drives", 0.0, "have none"),
        ('joint name="y"', 'joint name="y" actuatorfrcrange="-9 9"', "limits of drives", 0.0, "of trolley"),
        ('name="load" pos', 'name="load" gravcomp="0.5" pos', "swing", 2.0, "gravcomp of load"),
        ("<option", '<option viscosity="0.5"', "swing", 0.75, "viscosity of the air"),
        ("<option", '<option density="1.2" wind="1 0 0"', "bridge at rest", 0.24, "density of the air"),
        (
            '<velocity name="bridge_drive" joint="x" kv="425"/>',
            '<general name="bridge_drive" joint="x" gainprm="425" biastype="affine" biasprm="5 0 -425"/>',
            "bridge at rest",
            0.59,
            "5 N of bridge_drive without a command",
        ),
        ("<freejoint/>", f"<freejoint/>{SLING}", "swing", 0.32, "mass of sling"),
        (
            "</tendon>",
            '</tendon><equality><joint name="belt" joint1="x" joint2="y"/></equality>',
            "trolley",
            750.0,
            "constraint belt",
        ),
    ],
    "one-body": [
        ("<actuator>", BRAKE, "bridge", 5.3, "actuator brake, which nobody commands"),
        (
            'type="hinge" axis="0 1 0" pos="0 0 0.8"',
            'type="hinge" axis="0 1 0" pos="0 0 0.9"',
            "swing",
            0.6,
            "joint beta, which turns 100 mm beside the pivot",
        ),
        ('name="beta"', 'name="beta" armature="0.1"', "swing", 0.6, "armature of beta"),
        (LOAD, CHAIN, "bridge", 0.05, "mass of chain"),
        ("<actuator>", WELD, "rope at rest", 400.0, "constraint 0 (weld)"),
        (
            'body name="load"',
            'body name="load" gravcomp="0.3"',
            "rope at rest",
            2.2,
            "gravcomp of load, a winch that does not hold the weight",
        ),
        ('name="alpha"', 'name="alpha" range="-5 5"', "end stop of alpha", 0.0, "[-0.0873, 0.0873] rad"),
        (
            '<body name="trolley" pos="0 0 2">',
            FLOOR,
            "contact of floor and crate",
            0.0,
            "while the load hangs",
        ),
    ],
    "double-pendulum": [
        ('mass="1e-9"', 'mass="0.2"', "swing", 0.57, "mass of rope, mass of hook"),
        ('name="swing"', 'name="swing" stiffness="0.3"', "swing", 0.64, "stiffness of swing"),
        (
            'mass="0.02"',
            'mass="0.4"',
            "swing",
            2.1,
            "mass of hook, a winch that does not hold the weight, joint sling, which turns 650 mm beside",
        ),
    ],
    "hall": [
        ('name="sway_along"', 'name="sway_along" damping="90"', "swing", 0.0025, "damping of sway_along"),
        ('<inertial pos="0 0 0"', '<inertial pos="0 0 -0.9"', "swing", 2.6, "centre of mass of hook 900 mm"),
        ('="-24525 0 -9000"', '="-20000 0 -9000"', "rope at rest", 1.7, HELD),
        ('name="hoist"', 'name="hoist" damping="200"', "rope", 0.07, "damping of hoist"),
    ],
}


def differences_of(name: str, folder: Path, *changes: tuple[str, str]) -> tuple[ModelDifference, ...]:
    """Return what the check finds in a model with `changes` of its text."""
    shutil.copytree(MODELS / "parts", folder / "parts")
    model = Shipped.MODEL_FILE if name == "crane" else MODELS / f"{name}.xml"
    return find_differences(open_model(changed(model, folder, *changes), NAMES.get(name, ModelNames())))


@pytest.mark.parametrize(
    ("name", "mutant"), [(name, mutant) for name, mutants in MUTANTS.items() for mutant in mutants]
)
def test_each_difference_is_named_with_its_size(
    name: str, mutant: tuple[str, str, str, float, str], tmp_path: Path
) -> None:
    old, new, what, size, cause = mutant
    differences = differences_of(name, tmp_path, (old, new))
    (difference,) = [difference for difference in differences if difference.what == what]
    assert difference.size == pytest.approx(size, rel=0.5)
    assert cause in difference.meaning


WITH_SIZES = {
    "stiffness of beta": "crane",
    "frictionloss of bridge_position": "crane",
    "damping of trolley_position": "crane",
    "viscosity of the air": "tendon",
    "damping of rope": "tendon",
}


def path_of_bare_mujoco(file: Path, motion: TrialMotion) -> Array:
    """Return the path of the load that the engine alone computes for velocity drives."""
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, motion.step
    data, path = mujoco.MjData(model), []
    for k in range(MOTION_SAMPLES):
        data.ctrl[:] = motion.command(k * motion.duration / MOTION_SAMPLES)
        mujoco.mj_step(model, data, motion.substeps)
        mujoco.mj_forward(model, data)
        path.append(data.site("load").xpos.copy())
    return np.array(path)


@pytest.mark.parametrize("cause", WITH_SIZES)
def test_causes_are_as_large_as_in_bare_mujoco(cause: str, tmp_path: Path) -> None:
    """Two files, with and without the cause, move apart by the size that is told of it."""
    name = WITH_SIZES[cause]
    (change,) = [(old, new) for old, new, _, _, why in MUTANTS[name] if why == cause]
    model = Shipped.MODEL_FILE if name == "crane" else MODELS / f"{name}.xml"
    file = changed(model, tmp_path, change)
    own = open_model(file, ModelNames())
    together, largest, rest = cause_sizes(own)
    motion = TrialMotion(own)
    expected = np.linalg.norm(path_of_bare_mujoco(file, motion) - path_of_bare_mujoco(model, motion), axis=1)
    assert largest.cause == cause
    assert largest.size == pytest.approx(expected.max(), rel=1e-6)
    assert together.size == pytest.approx(expected.max(), rel=1e-5)
    assert rest.cause == "all else"
    assert rest.size < 1e-9, "nothing of it is left"


def test_what_cannot_be_left_out_remains(tmp_path: Path) -> None:
    """A second pendulum and a constraint are told as what all else does."""
    belt = MUTANTS["tendon"][-1]
    together, rest = cause_sizes(open_model(changed(MODELS / "tendon.xml", tmp_path, belt[:2]), ModelNames()))
    assert rest.cause == "all else: constraint belt (joint)"
    assert rest.size == together.size > 1e-3


@pytest.mark.parametrize("drive", ["velocity", "force"])
def test_a_motion_moves_each_drive(drive: str, tmp_path: Path) -> None:
    """By its share of the rope, on the rigid crane; with forces also under the pull of the load."""
    file = changed(Shipped.MODEL_FILE, tmp_path, *(servos("motor") if drive == "force" else ()))
    path = TrialMotion(open_model(file, ModelNames())).run()
    moved = path[-1] - path[0]
    assert moved == pytest.approx(0.7 * np.array([0.2, 0.15, 0.1]), rel=0.5 if drive == "force" else 0.1)


DRIVE = '<velocity name="bridge_drive"'
SAME = {
    "the shipped crane": ("crane", ()),
    "an actuator that nobody commands": ("crane", [(DRIVE, f'<motor name="idle" joint="beta"/>{DRIVE}')]),
    "a tendon": ("tendon", ()),
    "end stops at the place of the file": ("hall", ()),
    "a trolley without weight": ("tendon", [('name="trolley"', 'name="trolley" gravcomp="0.5"')]),
    "armature of a drive": ("tendon", [('name="x"', 'name="x" armature="3"')]),
    "inertias that do not turn": (
        "tendon",
        [('mass="6" diaginertia="1 1 1"', 'mass="6" diaginertia="9 9 9"')],
    ),
}


@pytest.mark.parametrize("what", SAME)
def test_what_leaves_the_crane_the_same_is_no_difference(what: str, tmp_path: Path) -> None:
    name, changes = SAME[what]
    assert differences_of(name, tmp_path, *changes) == ()


def test_a_cause_without_which_nothing_hangs_has_no_millimetres(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without its inertia a load on a damped ball joint spins ever faster."""
    sizes = [CauseSize("all together", 0.01), CauseSize("inertia of load", inf), CauseSize("springs", 9.0)]
    monkeypatch.setattr("cranectl.plants.cause_sizes", lambda _: sizes)
    assert main(["info", str(MODELS / "double-pendulum.xml"), "--as-is"]) == 0
    lines = [line.split("  ", 1) for line in capsys.readouterr().out.splitlines()]
    told = {text.strip(): size for size, *rest in lines for text in rest}
    assert told["all together"] == "10.0 mm"
    assert told["inertia of load"] == told["springs"] == "not separable"

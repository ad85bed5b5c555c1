"""The check of a model file names each difference from the rigid crane with its size and meaning."""

import shutil
from pathlib import Path

import pytest

from cranectl.plants.mujoco.own_check import ModelDifference, find_differences
from cranectl.plants.mujoco.own_model import open_model
from cranectl.scenario.rig import ModelNames
from cranectl.support.resources import Shipped
from tests.plants.own_models import MODELS, NAMES, changed

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
HELD = "does the winch hold the weight?"
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
            "ctrlrange or forcerange of bridge_drive",
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
            "gravcomp of load, or does the winch",
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
        ('mass="0.02"', 'mass="0.4"', "swing", 2.1, "mass of hook, joint sling, which turns 650 mm beside"),
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

"""Models that are no such crane are refused, with the cause and with the element of the file to change."""

import shlex
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.support.resources import Shipped
from tests.plants.own_models import MODELS, changed

pytestmark = pytest.mark.usefixtures("in_empty_directory", "no_model_afterwards")

DRIVEN, BRIDGE = 'name="bridge_drive"', 'joint="bridge_position" kv="425"'
LOAD = '<site name="load" pos="0 0 0"/>'
SLIDE_X = 'joint name="bridge_position" type="slide" axis="1 0 0'
SLIDE = 'joint name="trolley_position" type="slide" axis="0 1 0'
GRAVITY = 'gravity="0 0 -9.81"'
OFF = (GRAVITY, f'{GRAVITY} actuatorgroupdisable="3"')
MUSCLE = f'muscle {DRIVEN} joint="bridge_position" lengthrange="0 1"'
RANGE = (' range="0.2 1.4"', "")  # in whose middle the hoist would be
UPWARDS = "let its z axis point upwards"
SI = "SI units: m, kg, s and N"
PLAIN = "write bridge_drive as <velocity>, <position> or <motor>"
HELD = "let ctrlrange of {} include {}, and its forcerange, or the actuatorfrcrange of its joint, {} N"
KINDS = "change the actuators in the file"
HANG = "let the load hang in the file, or exchange the names of pivot and load"
GUIDED = "change joint '{}' in the file: the pivot may only slide along x and y"
SITES = "name other points, move one of the two in the file"
BACK = "give {} a kp and kv of at least 0"
X, Y = '<joint name="x" type="slide" axis="1 0 0"/>', '<joint name="y" type="slide" axis="0 1 0"/>'
ALPHA, BETA = (
    f'<joint name="{k}" type="hinge" axis="{a}" pos="0 0 0.8"/>'
    for k, a in (("alpha", "1 0 0"), ("beta", "0 1 0"))
)


def option(text: str) -> tuple[str, str]:
    """Return the change that gives a model without options one."""
    return (
        "<worldbody>",
        f"<option>{text}</option><worldbody>" if "<" in text else f"<option {text}/><worldbody>",
    )


# By model, "crane" for the shipped one: changes of its text, what is found, and the remedy.
WRONG = {
    "crane": [
        ([('"pivot"', '"hanger"')], "no site named 'pivot'", "add --set rig.plant.names.pivot=hanger"),
        ([('name="winch_drive"', 'name="hoist"')], "no actuator named 'winch_drive'", "winch_drive=hoist"),
        ([(GRAVITY, 'gravity="0 0.1 -9.81"')], "gravity [0.0, 0.1, -9.81]", UPWARDS),
        ([(GRAVITY, 'gravity="0 0 0"')], "gravity [0.0, 0.0, 0.0]", UPWARDS),
        ([(GRAVITY, 'gravity="0 0 -9810"')], "gravity = 9810", SI),
        (
            [(BRIDGE, BRIDGE.replace("bridge", "trolley"))],
            "its motion per axis is bridge 0, trolley 1, rope 0, alpha 0, beta 0; it acts on joint 'tr",
            "let bridge_drive act on a joint or tendon of the file that moves the bridge alone",
        ),
        (
            [(f"velocity {DRIVEN} {BRIDGE}", f'motor {DRIVEN} joint="bridge_position"')],
            "of the kind force",
            KINDS,
        ),
        (
            [(BRIDGE, f'{BRIDGE} delay="0.02" nsample="20"')],
            "bridge_drive has a delay of 0.02 s, trolley_drive has a delay of 0 s",
            "give all drives the same delay",
        ),
        (
            [(BRIDGE, f'{BRIDGE} group="3"'), OFF],
            "actuatorgroupdisable switches its group 3 off",
            "take 3 out of actuatorgroupdisable",
        ),
        (
            [(BRIDGE, f'{BRIDGE} forcerange="5 6"')],
            "control of bridge_drive has 0 of the effect",
            HELD.format("bridge_drive", "0", "0"),
        ),
        (
            [(f"velocity {DRIVEN} {BRIDGE}", MUSCLE)],
            "bridge_drive has an activation of the type muscle",
            PLAIN,
        ),
        (
            [('body name="load"', 'body name="load" gravcomp="1"')],
            "the rope carries 0 kg to the load 'load': gravcomp lifts load",
            "remove gravcomp",
        ),
        ([("</mujoco>", "")], "no element found", "correct the file"),
        ([('type="slide" axis="1 0 0"', 'type="slider" axis="1 0 0"')], "slider", "correct the file"),
        ([(LOAD, LOAD.replace("0 0 0", "0 0 0.7"))], "in the pose of the file, a rope of 0 m", HANG),
        (
            [(f'{SLIDE}"', f'{SLIDE}.1"')],
            "joint 'trolley_position' slides the pivot along [0, 0.995, 0.0995]",
            GUIDED.format("trolley_position"),
        ),
        ([(LOAD, LOAD.replace("0 0 0", "0.02 0 0"))], "'load' hangs about 0.02 m beside the pivot", SITES),
        (
            [('joint name="beta"', 'joint name="beta" stiffness="1" springref="0.1"')],
            "beside the pivot",
            "what pulls the load aside",
        ),
    ],
    "one-body": [
        ([option('gravity="0 0 9.81"')], "gravity [0.0, 0.0, 9.81]", UPWARDS),
        (
            [option('<flag gravity="disable"/>')],
            "gravity switched off by a flag",
            'remove gravity="disable" from <flag>',
        ),
        (
            [option('<flag actuation="disable"/>')],
            "a flag switches all drives off",
            'remove actuation="disable"',
        ),
        ([('mass="1.5"', 'mass="1e-9"')], "the rope carries 1e-09 kg", "give the body of the load a mass"),
        ([("0 0 -0.8", "0 0 -800"), ("0 0 0.8", "0 0 800")], "a rope of 800 m", SI),
        (
            [(X, f'<joint name="z" type="slide" axis="0 0 -1"/>{X}'), ('joint="hoist"', 'joint="z"')],
            "it acts on joint 'z', and joint 'z' slides the pivot along [0, 0, -1]",
            GUIDED.format("z"),
        ),
        (
            [(X, X.replace("1 0 0", "1 1 0"))],
            "joint 'x' slides the pivot along [0.707, 0.707, 0]",
            GUIDED.format("x"),
        ),
        (
            [(Y, '<joint name="y" type="hinge" axis="1 0 0" pos="0 -2 -1"/>')],
            "joint 'y' turns the pivot",
            GUIDED.format("y"),
        ),
        (
            [
                ('"bridge_drive"', '"lower"'),
                ('"trolley_drive"', '"bridge_drive"'),
                ('"lower"', '"trolley_drive"'),
            ],
            "bridge_drive does not move the bridge alone and evenly",
            "bridge_drive=trolley_drive --set rig.plant.names.trolley_drive=bridge_drive",
        ),
        (
            [('"load"', '"t"'), ('"pivot"', '"load"'), ('"t"', '"pivot"')],
            "the load 'load' 0.8 m above the pivot",
            HANG,
        ),
        (
            [(BETA, "")],
            "no joint lets the load 'load' swing along x",
            "add a hinge about y at the pivot to the file",
        ),
        ([(ALPHA, ALPHA.replace("1 0 0", "0 0 1"))], "the load 'load' swing along y", "add a hinge about x"),
        (
            [('gainprm="40"', 'gainprm="0"')],
            "winch_drive has a gain of 0",
            "give winch_drive a kv, kp or gainprm",
        ),
        (
            [('kv="160"', 'kv="160" gear="0"')],
            "bridge_drive has a gear of 0",
            "give bridge_drive a gear other than 0",
        ),
        (
            [('kv="160"', 'kv="-160"')],
            "bridge_drive has the bias 0 0 160, which drives it away",
            BACK.format("bridge_drive"),
        ),
        (
            [("-14.715 0 -40", "-14.715 5 -40")],
            "winch_drive has the bias -14.715 5 -40",
            BACK.format("winch_drive"),
        ),
        (
            [
                (
                    '<velocity name="bridge_drive" joint="x" kv="160"',
                    '<damper name="bridge_drive" joint="x" kv="160" ctrlrange="0 1"',
                )
            ],
            "bridge_drive has a gain of the type affine",
            PLAIN,
        ),
        (
            [('gainprm="40"', 'gainprm="40" forcerange="-5 5"')],
            "control of winch_drive has 0 of the effect",
            HELD.format("winch_drive", "0", "-14.71"),  # 1.5 kg
        ),
    ],
    "two-falls": [
        ([('mass="2"', 'mass="1e-12"')], "the rope carries 1e-12 kg", "give the body of the load a mass"),
        (
            [
                ("</spatial>", '</spatial><fixed name="other"><joint joint="x" coef="1"/></fixed>'),
                ('tendon="rope"', 'tendon="other"'),
            ],
            "it acts on tendon 'other'",
            "let winch_drive act on a joint or tendon of the file",
        ),
    ],
    "delay": [
        (
            [('nsample="21"', 'nsample="5"')],
            "bridge_drive is 0.02 s late and keeps 0.005 s of controls",
            'write nsample="20" for bridge_drive',
        ),
        (
            [("<default>", '<option timestep="0"/><default>')],
            "bridge_drive is 0.02 s late and keeps 0 s of controls",
            'write <option timestep="0.001"/> into the file',
        ),
        (
            [('delay="0.02"', 'delay="-0.02"')],
            "bridge_drive has a delay of -0.02 s, trolley_drive has a delay of -0.02 s",
            "correct the delay of bridge_drive and trolley_drive and winch_drive in the file",
        ),
    ],
    "keyframe": [
        (
            [RANGE],
            "in the pose of the file, a rope of 0 m",
            "begin at a keyframe: add --set rig.plant.names.keyframe=hanging",
        ),
        ([RANGE, ("0.75", "-0.75")], "in the pose of the file, a rope of 0 m", HANG),
    ],
    "geared-motors": [
        (
            [('gear="-8"', 'gear="-8" ctrlrange="-1 1"')],
            "control of winch_drive has 0 of the effect",
            HELD.format("winch_drive", "-4.9", "-4.9"),  # 4 kg by a gear of 8
        ),
        (
            [('armature="3"', 'armature="3" actuatorfrcrange="-30 30"')],
            "control of winch_drive has 0 of the effect",
            HELD.format("winch_drive", "-4.9", "-4.9"),
        ),
    ],
}
ROWS = [(name, *row) for name, rows in WRONG.items() for row in rows]


@pytest.mark.parametrize(
    ("name", "changes", "found", "remedy"), ROWS, ids=[f"{row[0]}: {row[2]}" for row in ROWS]
)
def test_a_model_that_is_no_such_crane_is_refused(
    name: str, changes: list[tuple[str, str]], found: str, remedy: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Remedies that can be typed help."""
    changed(Shipped.MODEL_FILE if name == "crane" else MODELS / f"{name}.xml", Path(), *changes)
    assert main(["info", "mine.xml"]) == 2
    error = capsys.readouterr().err
    first, allowed, last = error.splitlines()[-3:]
    assert found in first
    assert allowed.startswith("allowed:")
    assert remedy in last
    if "add --set" in last:
        settings = shlex.split(last.rpartition("add ")[2])
        assert main(["info", "mine.xml", *settings]) == 0

"""Model files in MJCF with odd edits are run as a plant, or refused."""

import copy
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import strategies as st

from cranectl.support.resources import Shipped
from tests.fuzz.oracle import check_command, fuzzed
from tests.fuzz.strategies import damaged
from tests.plants.own_models import MODELS

SOURCES = {path.name: path.read_bytes() for path in (Shipped.MODEL_FILE, *sorted(MODELS.glob("*.xml")))}
PARTS = {path.name: path.read_bytes() for path in (MODELS / "parts").iterdir()}
VALUES = str.split("""0 -1 1 2 0.5 1e-9 1e9 1e300 nan inf -0 true false auto x y z slide hinge free ball
capsule mesh sphere hook load pivot bridge trolley position velocity motor general RK4 implicit Euler degree
radian""")
VALUES += [
    "",
    "0 0 0",
    "0 0 1",
    "1 0 0 0",
    "nan nan nan",
    "1e300 0 0",
    "-1 -1 -1",
    "9" * 400,
    "\u202e",
    "a b",
]
ADDED = [
    '<option gravity="0 0 -1.62"/>', '<option timestep="1e-9"/>', '<option timestep="10"/>', '<option/>',
    '<option density="1e9" viscosity="1e9"/>', '<option integrator="Euler" solver="PGS" iterations="0"/>',
    '<option wind="1e6 0 0"/>', '<option gravity="0 0 0"/>', '<option><flag gravity="disable"/></option>',
    '<option><flag energy="enable" clampctrl="disable" actuation="disable"/></option>',
    '<compiler angle="radian"/>', '<compiler autolimits="false"/>', '<compiler eulerseq="zyx"/>',
    '<compiler balanceinertia="true" boundmass="1" boundinertia="1"/>', '<compiler inertiafromgeom="true"/>',
    '<size memory="1K"/>', '<size nkey="3"/>', '<size nuserdata="3"/>', '<statistic extent="0"/>',
    '<custom><numeric name="a" data="1 2 3"/></custom>', '<keyframe><key qpos="1"/></keyframe>',
    '<contact><exclude body1="load" body2="bridge"/></contact>', '<sensor><clock name="c"/></sensor>',
    '<equality><weld body1="load" body2="world"/></equality>', '<include file="no.xml"/>',
    '<include file="crane.xml"/>', '<asset><mesh name="m" file="hook.obj"/></asset>',
    '<asset><texture name="t" type="2d" builtin="checker" width="8" height="8"/></asset>',
    '<asset><texture name="t" file="no.png"/></asset>', '<extension><plugin plugin="a.b"/></extension>',
    '<body name="more"><freejoint/><geom size="0.1"/></body>', '<joint name="j" type="hinge"/>',
    '<geom size="0.1" mass="1e6"/>', '<geom type="mesh" mesh="no"/>', '<site name="load"/>', '<site/>',
    '<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>', '<camera mode="track"/>', '<light/>',
    '<motor joint="j" gear="0"/>', '<velocity joint="j" kv="-1"/>', '<position joint="j" kp="1e9"/>',
    '<composite type="cable" count="5 1 1" size="1"/>', '<replicate count="3"><site name="s"/></replicate>',
    '<frame pos="0 0 1"><site name="f"/></frame>', '<default class="a"><geom density="0"/></default>',
]  # fmt: skip


@st.composite
def edited(draw: st.DrawFn) -> bytes:
    """Draw one of the models with one to three edits of elements and attributes, or with damaged bytes."""
    content = SOURCES[draw(st.sampled_from(sorted(SOURCES)))]
    if draw(st.integers(0, 7)) == 0:
        return draw(damaged(content))
    root = ElementTree.fromstring(content)
    for _ in range(draw(st.integers(1, 3))):
        parents = list(root.iter())
        element = parents[draw(st.integers(0, len(parents) - 1))]
        change = draw(
            st.sampled_from(["number", "number", "value", "remove", "attribute", "add", "repeat", "move"])
        )
        keys = sorted(element.attrib)
        if change == "add":
            element.insert(draw(st.integers(0, 2)), ElementTree.fromstring(draw(st.sampled_from(ADDED))))
        elif change in ("remove", "repeat", "move") and len(element):
            child = element[draw(st.integers(0, len(element) - 1))]
            if change == "repeat":
                element.append(copy.deepcopy(child))
            else:
                element.remove(child)
            if change == "move":
                parents[draw(st.integers(0, len(parents) - 1))].append(child)
        elif keys:
            key = draw(st.sampled_from(keys))
            if change == "attribute":
                del element.attrib[key]
            elif change == "number":
                words = element.attrib[key].split() or [""]
                words[draw(st.integers(0, len(words) - 1))] = draw(st.sampled_from(VALUES))
                element.attrib[key] = " ".join(words)
            else:
                element.attrib[key] = draw(st.sampled_from(VALUES))
    try:
        return ElementTree.tostring(root)
    except RecursionError:  # a child that was moved into itself
        return content


LINES = {
    "run": ["run", "s.toml", "--plants", "m.xml", "--out", "new.mcap"],
    "two": [
        "run",
        "s.toml",
        "--plants",
        "analytic,m.xml",
        "--drive",
        "velocity",
        "--every",
        "1",
        "--out",
        "new.mcap",
    ],
    "force": ["run", "s.toml", "--plants", "m.xml", "--drive", "force", "--out", "new.mcap"],
    "info": ["info", "m.xml"],
}


@pytest.mark.parametrize("name", sorted(SOURCES))
def test_whole_models_are_described_or_refused(template: Path, name: str) -> None:
    """The shipped model is run, so that the test below changes something that is accepted."""
    code, _ = check_command(template, ["info", "m.xml"], files={**PARTS, "m.xml": SOURCES[name]})
    assert code == 0 or name != Shipped.MODEL_FILE.name


@fuzzed(60, content=edited(), line=st.sampled_from(sorted(LINES)))
def test_edited_models_are_run_or_refused(template: Path, content: bytes, line: str) -> None:
    files = {**PARTS, "crane.xml": SOURCES[Shipped.MODEL_FILE.name], "m.xml": content}
    check_command(template, LINES[line], files=files)

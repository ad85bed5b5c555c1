"""Remedies that name a key or a value of a scenario or a rig work on the refused input."""

import re
import shlex

import pytest

from cranectl.campaign.settings import CampaignSettings
from cranectl.cli.main import main
from tests.cli.conftest import Command
from tests.remedies import Case, remedy_test, written

FILES = {
    "s.toml": "name = 's'\nduration = 1.0\nreference.start = [1.0, 0.77, -0.7]\ncontrol.period = 0.005\n",
    "loop.toml": "extends = 'loop.toml'\n",
    "own.toml": "",
    "number.toml": "extends = 5\n",
    "large.toml": "extends = 'harbour-crane'\n",
}
RUN = "run s.toml --plants analytic --drive velocity"
ELASTIC = "cranectl run s.toml --plants elastic --drive velocity"
NO_FORCE = "effects.limits.force=[1e9, 1e9, 1e9]"
SLOW = "effects.limits.velocity=[0.1, 0.1, 0.1]"
LEAVES = "move the path, give it more time, or change rig.{}_range"
SUITED = "; or take {}, made for this rig"


def line(to: list[float], duration: float, law: str = "degree-9") -> str:
    return f"reference.segments=[{{kind='line', to={to}, duration={duration}, time_law='{law}'}}]"


AWAY, NEARER, DOWN = [3.0, 0.77, -0.7], [1.3, 0.77, -0.7], [1.0, 0.77, -1.3]
ROPE = [ELASTIC, "effects.rope={}", "rig.load_mass=9.0", "rig.effects.rope.stiffness=100.0"]
HEAVY = [ELASTIC, "effects.limits={}", "rig.load_mass=9.0"]
LOW = ["reference.start=[1.0, 0.77, -1.39]"]  # an inclined rope to this height is too long
SHORTEN = "set control.period to {}, or shorten duration"
FINE = ["control.period=1e-6", "control.physics_step=1e-6", "disturbances=[]"]
CASES = {
    "scenario/settings.py": [
        Case("did you mean '{}'?", "rig.load_mas=1.2", "rig.load_mass=1.2"),
        Case("remove '{}'", "rig.ballast=1.2", ""),
        Case("add '{}'", "reference.segments=[{kind='hold'}]",
             "reference.segments=[{kind='hold', duration=1.0}]"),
        Case("for example --set rig.load_mass=2.5", "--set=rig.load_mass", "rig.load_mass=2.5"),
        Case("put texts in it in quotes, numbers without{}", "design.poles=[-3+1j, -3-1i, -2, -2.0x]",
             "design.poles=['-3+1j', '-3-1j', -2, -2.0]"),
        Case("write a list{}", "reference.start=1.0", "reference.start=[1.0, 0.77, -0.7]"),
        Case("correct the fields above", "rig.load_mass=-1.0", "rig.load_mass=1.2"),
    ],
    "scenario/design.py": [
        Case("add '{}' in place of another pole", "design.poles=[-3+1j, -2, -2, -2]",
             "design.poles=[-3+1j, '-3-1j', -2, -2]"),
    ],
    "scenario/load.py": [
        Case("write it in quotes, such as extends = 'harbour-crane'", "--rig=number.toml",
             ["--rig=large.toml", "reference.start=[5.0, 5.0, -9.0]"]),
        Case("remove 'extends' from one of the files", "--rig=loop.toml", "--rig=own.toml"),
    ],
    "scenario/rig.py": [
        Case("set rig.rated_load; numbers of the rig that are not given are scaled to it",
             "rig.load_mass=50.0", ["rig.load_mass=50.0", "rig.rated_load=50.0"]),
        Case("correct effects.limits.force, or give rig.rated_load, to which it is scaled", HEAVY,
             [*HEAVY, "effects.limits.force=[500.0, 500.0, 500.0]"], [*HEAVY, "rig.rated_load=9.0"]),
        Case("correct effects.rope.stiffness, or give rig.rated_load, to which it is scaled", ROPE,
             [*ROPE, "effects.rope.stiffness=1e5"], [*ROPE[:-1], "rig.rated_load=9.0"]),
    ],
    "scenario/similarity.py": [
        Case("correct rig.rope_range, or its unit: it is in metres",
             ["rig.rated_load=2.0", "rig.rope_range=[100.0, 1400.0]"],
             ["rig.rated_load=2.0", "rig.rope_range=[0.1, 1.4]"]),
    ],
    "simulate/plan.py": [
        Case("reduce the offsets in [initial]", "initial.load_offset=[5.0, 0, 0]",
             "initial.load_offset=[0.01, 0, 0]"),
        Case("give the segment more time", line(DOWN, 0.4), ["duration=4.0", line(DOWN, 4.0)]),
        Case("lower the path", line([1.0, 0.77, 0.1], 1.0), line([1.0, 0.77, -0.5], 1.0)),
        Case("give the segment more time, or correct effects.limits.velocity",
             [NO_FORCE, SLOW, line(NEARER, 1.0)], ["duration=8.0", NO_FORCE, SLOW, line(NEARER, 8.0)],
             [NO_FORCE, SLOW.replace("0.1", "2.0"), line(NEARER, 1.0)]),
        Case(LEAVES, [line(AWAY, 4.0), "duration=4.0"], line(NEARER, 1.0),
             [line(AWAY, 4.0), "duration=4.0", "rig.bridge_range=[-2.0, 9.0]"]),
        Case(f"{LEAVES}{SUITED}", "cranectl run near-the-limits --rig=harbour-crane --plants=analytic",
             "cranectl run ship-to-shore --rig=harbour-crane --plants=analytic"),
        Case(LEAVES, [*LOW, line([1.3, 0.77, -1.39], 1.0)],
             [*LOW, line([1.3, 0.77, -1.39], 9.0), "duration=9.0"]),
    ],
    "planning/checks.py": [
        Case(f"move the point, or widen planning.load_box or lessen planning.clearance{SUITED}",
             "cranectl plan fast-diagonal-shortest --rig=bridge-crane",
             "cranectl plan workshop-move --rig=bridge-crane"),
    ],
    "reference/trajectory.py": [
        Case('use time_law = "degree-9"{}', line(NEARER, 1.0, "degree-5"), line(NEARER, 1.0),
             [line(NEARER, 1.0, "degree-5"), "reference.continuity=2"]),
    ],
    "simulate/memory.py": [
        Case(f"{SHORTEN}, or name fewer plants",
             ["cranectl run fixed-position --plants analytic,elastic", *FINE, "duration=600"],
             ["cranectl run fixed-position --plants analytic,elastic", *FINE, "duration=0.01"]),
        Case(SHORTEN, ["cranectl run fixed-position --plants analytic", *FINE, "duration=600"],
             ["cranectl run fixed-position --plants analytic", *FINE, "duration=0.01"]),
    ],
    "plants/plant.py": [
        Case("choose a softer rope or frame, a heavier winch, or a body with more inertia",
             [ELASTIC, "effects.frame.frequency=[1e9, 12.0]"],
             [ELASTIC, "effects.frame.frequency=[9.0, 12.0]"]),
    ],
}  # fmt: skip


files = written(FILES)
test_a_remedy_works_on_the_refused_input = remedy_test(CASES, RUN)


@pytest.mark.parametrize(
    "wrong",
    [
        "reference.start=1",
        "reference.start=1,0.77,-0.7",
        "reference.start=[1 0.77 -0.7]",
        "reference.start=[1, 0.77]",
        "reference.start=[1, 0.77, -0.7, 0]",
        "reference.start=[1e9, 0.77, -0.7]",
        "reference.start=[1, 0.77, 'low']",
        "rig.bridge_range=[0]",
        "design.poles=-3",
        "initial.load_offset=0.001",
        "disturbances=5",
        "reference.segments=line",
        "effects.limits.velocity=1",
    ],
)
def test_the_remedy_of_a_list_can_be_typed(wrong: str, refusal: Command) -> None:
    """As a shell takes it: the option of the remedy, in place of the wrong one."""
    run = ["run", "s.toml", "--plants", "mujoco", "--drive", "velocity"]
    (option,) = re.findall("remedy: .*(--set .*)", refusal(*run, "--set", wrong))
    assert main([*run, *shlex.split(option)]) == 0, option


def test_the_remedy_of_a_list_of_a_campaign_can_be_typed(refusal: Command) -> None:
    error = refusal("campaign", "run", "two-plants", "--set", "plants=analytic")
    (option,) = re.findall("remedy: .*(--set .*)", error)
    words = shlex.split(option)[1]
    assert CampaignSettings.read("two-plants", overrides=[words]) == CampaignSettings.read("two-plants")

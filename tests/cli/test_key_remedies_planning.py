"""Remedies for planned motions work on the refused input."""

import pytest

from cranectl.planning import load_scenario
from cranectl.support.errors import InputError
from cranectl.tools.live.hand_limits import hand_limits
from tests.remedies import Case, remedy_test, written

RUN = "run s.toml --plants analytic"
SCENARIO = "name='s'\nduration=8.0\nreference.start=[1.0, 0.77, -0.7]\ncontrol.period=0.005\n"
SHORTEST, PLANNED = "duration='shortest'", "time_law='minimum-time'"
ANYWHERE = "planning.load_box=[[-9.0, 9.0], [-9.0, 9.0], [-9.0, -0.1]]"
POINT, FAR = [1.2, 0.77, -0.7], [1.4, 0.77, -0.7]


def segment(kind: str, to: list[float], *settings: str) -> str:
    return f"{{kind='{kind}', to={to}, {', '.join(settings or [SHORTEST])}}}"


def move(to: list[float], *settings: str) -> str:
    return f"reference.segments=[{segment('move', to, *settings)}]"


def line(to: list[float], *settings: str) -> str:
    return f"reference.segments=[{segment('line', to, *settings)}]"


def lines(to: list[float], blend: float, *settings: str) -> str:
    first = segment("line", [1.3, 0.77, -0.7], PLANNED if blend else SHORTEST, f"blend={blend}")
    return f"reference.segments=[{first}, {segment('line', to, *settings)}]"


def obstacle(top: float, x: float = 1.2) -> str:
    low, high = [x - 0.05, 0.6, -1.4], [x + 0.05, 0.9, top]
    return f"obstacles=[{{name='chair', low={low}, high={high}}}]"


def load_box(lowest: float) -> str:
    return f"planning.load_box=[[0.0, 2.0], [0.0, 1.54], [{lowest}, -0.1]]"


LOAD = "move the point, or widen planning.load_box or lessen planning.clearance"
LONG = "raise {}, or choose a shorter path"
STAY, HOLD = 'to stay in place use kind = "hold"', 'reference.segments=[{kind = "hold", duration=1.0}]'
BLEND = "leave blend out there, so that the load stops"
VERY_SLOW, FAST = "velocity=[0.0005, 1.0, 1.0]", "velocity=[0.5, 1.0, 1.0]"
VELOCITY = ["--drive", "velocity", "effects.limits.force=[1e9, 1e9, 1e9]"]
LOW, HEAVY = [1.2, 0.77, -1.2], "rig.load_mass=3.0"
CORNER_END = [1.3, 1.0, -0.7]
DETOUR = [SHORTEST, "via=[[1.2, 0.8, -0.7]]"]
CASES = {
    "planning/checks.py": [
        Case(LOAD, move([1.2, 0.77, -0.03]), move([1.2, 0.77, -0.3])),
        Case(LOAD, [move(LOW), load_box(-1.1)], [move(LOW), load_box(-1.3)]),
        Case(LOAD, move([0.03, 0.77, -0.7]), [move([0.03, 0.77, -0.7]), "planning.clearance=0.02"]),
        Case("move the point, or change rig.bridge_range", [move([2.5, 0.77, -0.7]), ANYWHERE], move(POINT),
             [move([2.5, 0.77, -0.7]), ANYWHERE, "rig.bridge_range=[0.0, 3.0]"]),
        Case("move the point, or change rig.trolley_range", [move([1.2, 2.5, -0.7]), ANYWHERE],
             [move([1.2, 2.5, -0.7]), ANYWHERE, "rig.trolley_range=[0.0, 3.0]"]),
        Case("move the point, or change rig.rope_range", [move([1.2, 0.77, -2.5]), ANYWHERE],
             [move([1.2, 0.77, -2.5]), ANYWHERE, "rig.rope_range=[0.1, 3.0]"]),
        Case("move the point or the obstacle", [move(POINT), obstacle(-0.6)], [move(FAR), obstacle(-0.9)],
             [move(POINT), obstacle(-0.6, 1.6)]),
        Case("correct rig.load_mass or {}.force, or raise planning.share", [move(POINT), HEAVY],
             [move(POINT), "rig.load_mass=1.0"], [move(POINT), HEAVY, "planning.share=0.99"],
             [move(POINT), HEAVY, "rig.effects.limits.force=[90.0, 90.0, 90.0]"]),
        Case("lower the obstacle, or pass around it by points in via", [move(FAR), obstacle(-0.1)],
             [move(FAR), obstacle(-0.4)],
             [move(FAR, SHORTEST, "via=[[1.2, 1.2, -0.7]]"), obstacle(-0.1)]),
        Case(LONG, [move(FAR), f"rig.effects.limits.{VERY_SLOW}"], [move(FAR), f"rig.effects.limits.{FAST}"],
             [move([1.001, 0.77, -0.7]), f"rig.effects.limits.{VERY_SLOW}"]),
        Case(LONG, [*VELOCITY, move(FAR), f"effects.limits.{VERY_SLOW}"],
             [*VELOCITY, move(FAR), f"effects.limits.{FAST}"]),
        Case(LONG, [line(FAR), "planning.jerk=[1e-9, 1.0, 1.0]"],
             [line(FAR), "planning.jerk=[9.0, 1.0, 1.0]"]),
        Case(LONG, [line(FAR), "planning.lean=1e-6"], [line(FAR), "planning.lean=0.1"]),
        Case("use kind = 'move', which finds a path, or another path", [line(FAR), obstacle(-0.4)],
             [move(FAR), obstacle(-0.4)]),
    ],
    "planning/plan.py": [
        Case(STAY, move([1.0, 0.77, -0.7]), HOLD),
        Case("move the point away, or leave it out", move(POINT, SHORTEST, "via=[[1.2, 0.77, -0.70000001]]"),
             move(POINT)),
        Case("leave constant_rope out, or make the heights equal", move(LOW, "constant_rope=true"), move(LOW),
             move(POINT, "constant_rope=true")),
        Case("leave plane out, or move the point", move(FAR, DETOUR[1], "plane=true"), move(FAR, *DETOUR),
             move(FAR, DETOUR[1].replace("8", "77"), "plane=true")),
    ],
    "scenario/along_path.py": [
        Case(STAY, line([1.0, 0.77, -0.7]), HOLD),
        Case(STAY, "reference.segments=[{kind='arc', centre=[1.0, 0.9], angle=0.0, duration=1.0}]", HOLD),
    ],
    "planning/blends.py": [
        Case(BLEND, line(POINT, PLANNED, "blend=0.01"), line(POINT, SHORTEST)),
        Case(BLEND, lines(CORNER_END, 0.01, SHORTEST), lines(CORNER_END, 0.0, SHORTEST)),
        Case("leave blend out there, so that the load stops, or move the corner",
             lines([1.1, 0.77, -0.7], 0.01, PLANNED), lines([1.1, 0.77, -0.7], 0.0, SHORTEST)),
    ],
    "scenario/scenario.py": [
        Case("{}{}{}", ["duration=0.1", line(POINT)], ["duration=2.0", line(POINT)], "duration=0.1"),
    ],
}  # fmt: skip


files = written({"s.toml": SCENARIO})
test_a_remedy_works_on_the_refused_input = remedy_test(CASES, RUN)


def test_the_remedy_for_driving_by_hand_works() -> None:
    """The limits of a live session are computed when a user begins to drive by hand."""
    with pytest.raises(InputError) as error:
        hand_limits(load_scenario("s.toml", overrides=["planning.clearance=0.8"]))
    assert error.value.remedy == "reduce planning.clearance, or correct planning.load_box"
    assert hand_limits(load_scenario("s.toml", overrides=["planning.clearance=0.1"]))

"""Remedies for rules across several keys of a scenario, campaign or benchmark work on the refused input."""

from tests.cli.test_key_remedies_campaign import CAMPAIGN, SCENARIO
from tests.remedies import Case, remedy_test, written
from tests.tools.benchmark.conftest import SHORT, SMALL

CONTROLLER_LIST, SETS = '["lqr-integral", "servo.py:SERVO"]', "[sets.wide]"
BENCHMARK = SMALL.replace(CONTROLLER_LIST, '["lqr-integral"]')
RULES = {
    "named": ('[tuning]\nscenarios = ["short"]', '[tuning]\nscenarios = ["long"]'),
    "spreads": ("spreads = [1.0, 3.0]", "spreads = [3.0, 1.0]"),
    "plant": ('second_plant = "analytic"', 'second_plant = "mujoco"'),
    "letters": (SETS, "[sets.Wide]"),
    "taken": (SETS, "[sets.spread-2]"),
    "seed": ("seed = 5", "seed = 3"),
    "validation": ("seed = 6", "seed = 5"),
}
FILES = {
    "s.toml": "name='s'\nduration=8.0\nreference.start=[1.0, 0.77, -0.7]\n",
    "points.csv": "time,x,y,z\n0,1.0,0.77,-0.7\n3,1.1,0.77,-0.7\n6,1.2,0.77,-0.7\n",
    "c.toml": f"{CAMPAIGN}runs=2\n".replace("s.toml", "scenario.toml"),
    "none.toml": CAMPAIGN.replace("s.toml", "scenario.toml"),
    "scenario.toml": SCENARIO,
    "short.toml": SHORT,
    "right.toml": BENCHMARK,
    **{f"{name}.toml": BENCHMARK.replace(*change) for name, change in RULES.items()},
}
HAND = {
    "duration": "8.0", "period": "0.001", "bandwidth": "8.0", "speed": "[0.3, 0.3, 0.2]",
    "low": "[0.1, 0.1, -1.2]", "high": "[1.8, 1.4, -0.2]",
    "wishes": "[[0.1, 0.2, 0.1, 0.0], [0.5, 0.0, 0.0, 0.0]]",
}  # fmt: skip
LINE = "to=[1.2, 0.77, -0.7]"
POINTS = "points=[[1.0, 0.77, -0.7], [1.2, 0.77, -0.7]]"
FLAT = [[1.0, 0.77, -0.7]] * 5 + [[1.05, 0.77, -0.7]] * 5
BREAKS = "breaks=[0.0, 0.5, 1.0, 1.5, 2.0, 2.5]"
PATH = [[1.0 + 0.02 * k, 0.77, -0.7] for k in range(8)]
PARTS = (
    f"parts=[{{kind='line', {LINE}, time_law='minimum-time', blend=0.1}}, "
    "{kind='line', to=[1.2, 1.0, -0.7], time_law='minimum-time'}]"
)
SHOW = "cranectl campaign show c.toml --no-estimate"
NONE = "cranectl campaign show none.toml --no-estimate"
DISTURBANCE = "disturbances=[{{force=[1.0, 0.0, 0.0], {}}}]"


def segment(kind: str, *settings: str) -> str:
    return f"reference.segments=[{{{', '.join([f'kind={kind!r}', *settings])}}}]"


def hand(**changes: str) -> str:
    return segment("driven", *(f"{key}={value}" for key, value in (HAND | changes).items()))


def spline(degree: int, coefficients: list[list[float]], *settings: str) -> str:
    return segment("spline", f"degree={degree}", f"coefficients={coefficients}", *settings)


def mass(distribution: str) -> str:
    return f"uncertain.rig.load_mass={{distribution={distribution}}}"


def benchmark(name: str) -> str:
    return f"cranectl benchmark run {name}.toml --set-of-cranes nominal --scenario short --out result"


CASES = {
    "scenario/recorded.py": [
        Case("lengthen period", hand(period="1e-6"), hand()),
        Case("lengthen duration, or add such a wish", hand(wishes="[[0.1, 0.2, 0.1, 0.0]]"),
             hand(wishes="[[0.1, 0.2, 0.1, 0.0], [0.2, 0.0, 0.0, 0.0]]")),
        Case("lengthen duration, or add such a wish", hand(duration="0.6"), hand()),
        Case("move its time to a sample", hand(wishes="[[0.1005, 0.2, 0.1, 0.0], [0.5, 0.0, 0.0, 0.0]]"),
             hand()),
        Case("leave one of the two out",
             hand(wishes="[[0.1, 0.2, 0.1, 0.0], [0.1, 0.1, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0]]"), hand()),
        Case("raise speed, or lower the wish", hand(speed="[0.1, 0.3, 0.2]"), hand()),
        Case("move low or high, or the goal", hand(goals="[[0.2, 1.9, 0.77, -0.7]]"),
             hand(goals="[[0.2, 1.1, 0.77, -0.7]]")),
        Case("name the column of speeds, or leave the unit out",
             segment("waypoints", "file='points.csv'", "units={time='s', length='m', speed='m/s'}"),
             segment("waypoints", "file='points.csv'", "units={time='s', length='m'}")),
    ],
    "scenario/rig.py": [
        Case("exchange its two values", "rig.rope_range=[1.4, 0.1]", "rig.rope_range=[0.1, 1.4]"),
        Case("give the length of the shortest rope, for example 0.1", "rig.rope_range=[0.0, 1.4]",
             "rig.rope_range=[0.1, 1.4]"),
    ],
    "reference/files.py": [
        Case("leave out {}",
             segment("waypoints", "file='points.csv'", "units={time='ms', length='m'}", "speed=0.1"),
             segment("waypoints", "file='points.csv'", "units={length='m'}", "speed=0.1")),
    ],
    "scenario/scenario.py": [
        Case("set control.period to {}", "control.period=0.0010000003", "control.period=0.001"),
        Case("set control.period to {}", "control.period=0.001000003", "control.period=0.001"),
        Case("set control.period to {}, since no physics step divides it",
             ["control.period=0.001000003", "duration=1.000003", "control.physics_step=0.0004"],
             ["control.period=0.0012", "duration=1.2", "control.physics_step=0.0004"]),
        Case("set control.physics_step to {}, {}", "control.physics_step=0.0003",
             "control.physics_step=0.00025"),
        Case("set control.physics_step to {}, {}", "rig.bridge_time_constant=5e-6",
             ["rig.bridge_time_constant=5e-6", "control.physics_step=5e-06"]),
        Case("raise duration, or lower {}", DISTURBANCE.format("start=9.0"), DISTURBANCE.format("start=2.0")),
        Case("set duration to {} or more", segment("hold", "duration=9"), "duration=9.0"),
        Case("set {} to {}, or change control.period", "duration=1.0003", "duration=1.0"),
    ],
    "scenario/disturbances.py": [
        Case("raise its end, or leave it out", DISTURBANCE.format("start=0.5, end=0.3"),
             DISTURBANCE.format("start=0.5")),
        Case("give joint and magnitude, or force, and leave the other out",
             DISTURBANCE.format("start=0.5, joint='alpha'"), DISTURBANCE.format("start=0.5")),
    ],
    "scenario/along_path.py": [
        Case("leave one of them out", segment("line", LINE, "duration=2.0", "time_law='minimum-time'"),
             segment("line", LINE, "duration=2.0")),
        Case("leave time_law out, or give the duration in seconds",
             segment("line", LINE, "duration='shortest'", "time_law='degree-5'"),
             [segment("line", LINE, "duration=2.0", "time_law='degree-5'"), "reference.continuity=2"]),
        Case("give it in seconds, or as 'shortest', or leave it to time_law = 'minimum-time'",
             segment("line", LINE), segment("line", LINE, "duration=2.0")),
        Case("leave blend out, or leave the time to the plan: time_law = 'minimum-time'",
             segment("line", LINE, "duration=2.0", "blend=0.1"), segment("line", LINE, "duration=2.0")),
        Case("give one for each corner", segment("path", PARTS, "duration=4.0", "taken=[0.05, 0.05]"),
             segment("path", PARTS, "duration=4.0", "taken=[0.05]")),
    ],
    "scenario/planning.py": [
        Case("give a number below 1 and one above it, for example [0.2, 2.0]", "planning.tension=[1.2, 2.0]",
             "planning.tension=[0.2, 2.0]"),
        Case("exchange the two values of {}", "planning.load_box=[[2.0, 0.0], [0.0, 1.54], [-1.4, 0.0]]",
             "planning.load_box=[[0.0, 2.0], [0.0, 1.54], [-1.4, 0.0]]"),
        Case("exchange the values of the axes along which low is not below high",
             "obstacles=[{name='box', low=[1.2, 1.0, -1.4], high=[1.0, 1.2, -1.2]}]",
             "obstacles=[{name='box', low=[1.0, 1.0, -1.4], high=[1.2, 1.2, -1.2]}]"),
    ],
    "scenario/segments.py": [
        Case("leave duration out, or the others", segment("move", LINE, "plane=true", "duration='shortest'"),
             segment("move", LINE, "duration='shortest'")),
        Case("give one of the two", segment("waypoints", POINTS, "speed=0.1", "file='points.csv'"),
             segment("waypoints", POINTS, "speed=0.1")),
        Case("leave them out", segment("waypoints", POINTS, "speed=0.1", "topic='mujoco/load'"),
             segment("waypoints", POINTS, "speed=0.1")),
        Case("give one of them", segment("waypoints", POINTS),
             segment("waypoints", POINTS, "times=[0.0, 3.0]")),
        Case("begin them at 0, and give each knot once", spline(5, FLAT, BREAKS.replace("0.5", "0.0")),
             spline(5, FLAT, BREAKS)),
        Case("give that many coefficients, or change breaks or degree", spline(5, FLAT[1:], BREAKS),
             spline(5, FLAT, BREAKS)),
        Case("give both or none", spline(5, FLAT, BREAKS, "lasts=2.0"), spline(5, FLAT, BREAKS)),
        Case("take degree 7 or 9",
             spline(5, PATH[:6], "breaks=[0.0, 1.0]", "time_law='degree-9'", "lasts=2.0"),
             spline(7, PATH, "breaks=[0.0, 1.0]", "time_law='degree-9'", "lasts=2.0")),
        Case("leave time_law out, or take kind = 'waypoints'",
             spline(7, FLAT, "breaks=[0.0, 1.0, 2.0, 2.5]", "time_law='degree-9'", "lasts=2.0"),
             spline(5, FLAT, BREAKS)),
    ],
    "campaign/settings.py": [
        Case("name it once", [SHOW, "controllers=['lqr', 'lqr']"], [SHOW, "controllers=['lqr']"]),
        Case("add 'runs'", NONE, [NONE, "runs=2"]),
    ],
    "campaign/distributions.py": [
        Case("exchange the two", [SHOW, mass("'uniform', low=1.2, high=0.8")],
             [SHOW, mass("'uniform', low=0.8, high=1.2")]),
        Case("state it once, with a larger weight in weights",
             [SHOW, mass("'choice', values=[0.8, 0.8, 1.2]")],
             [SHOW, mass("'choice', values=[0.8, 1.2], weights=[2.0, 1.0]")]),
        Case("state as many, or leave weights out",
             [SHOW, mass("'choice', values=[0.8, 1.2], weights=[2.0]")],
             [SHOW, mass("'choice', values=[0.8, 1.2]")]),
        Case("leave levels out", [SHOW, mass("'choice', values=[0.8, 1.2], levels=3")],
             [SHOW, mass("'choice', values=[0.8, 1.2]")]),
        Case("leave relative out", [SHOW, "effects.wind={}",
              "uncertain.effects.wind.seed={distribution='integers', relative=true}"], SHOW),
    ],
    "tools/benchmark/settings.py": [
        Case("name one of these, or add it to [scenarios]", benchmark("named"), benchmark("right")),
        Case("state them in increasing order, each once", benchmark("spreads"), benchmark("right")),
        Case("name another second_plant", benchmark("plant"), benchmark("right")),
        Case("rename them", benchmark("letters"), benchmark("right")),
        Case("rename them", benchmark("taken"), benchmark("right")),
        Case("change tuning.seed", benchmark("seed"), benchmark("right")),
        Case("change tuning.validation.seed", benchmark("validation"), benchmark("right")),
    ],
}  # fmt: skip
files = written(FILES)
test_a_remedy_works_on_the_refused_input = remedy_test(CASES, "plan s.toml")

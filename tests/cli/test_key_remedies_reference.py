"""Remedies for motions from points and files work on the refused input."""

import numpy as np

from tests.remedies import Case, remedy_test, written

RUN = "run s.toml --plants analytic"
POINTS = ["0,1.0,0.77,-0.7", "3,1.1,0.77,-0.7", "6,1.2,0.77,-0.7"]
TIMES = np.arange(0.0, 4.01, 0.05)
_tau = np.clip((TIMES - 0.5) / 3.0, 0.0, 1.0)
BRIDGE = 1.0 + 0.3 * _tau**4 * (35.0 - 84.0 * _tau + 70.0 * _tau**2 - 20.0 * _tau**3)
RECORDED = [f"{t:.3f},{x:.6f},0.77,-0.7" for t, x in zip(TIMES, BRIDGE, strict=True)]
MIDDLE = 40  # index of the sample at 2 s


def table(rows: list[str], names: str = "time,x,y,z") -> str:
    return "\n".join([names, *rows]) + "\n"


def with_row(rows: list[str], index: int, row: str) -> str:
    return table([*rows[:index], row, *rows[index + 1 :]])


def without(rows: list[str], first: int, last: int) -> str:
    return table(rows[:first] + rows[last:])


FILES = {
    "s.toml": "name='s'\nduration=8.0\nreference.start=[1.0, 0.77, -0.7]\ncontrol.period=0.005\n",
    "points.csv": table(POINTS),
    "empty.csv": "",
    "units.csv": table(POINTS, "time [s],x [m],y [m],z [m]"),
    "inches.csv": table(POINTS, "time [s],x [inch],y [m],z [m]"),
    "ragged.csv": with_row(POINTS, 1, "3,1.1,0.77,-0.7,9"),
    "two.csv": without(POINTS, 1, 2),
    "bare.csv": "\n".join(POINTS),
    "bars.csv": table([row.replace(",", "|") for row in POINTS], "time|x|y|z"),
    "sheet.xlsx": b"PK\x03\x04" + bytes(100),
    "twice.csv": table([f"{row},1.0" for row in POINTS], "time,x,y,z,x"),
    "once.csv": table([f"{row},1.0" for row in POINTS], "time,x,y,z,old x"),
    "named.csv": table(POINTS, "time,laengs,y,z"),
    "clock.csv": table(POINTS, "clock,x,y,z"),
    "flat.csv": table([row.rpartition(",")[0] for row in POINTS], "time,x,y"),
    "many.csv": table([f"{0.002 * k:g},1.0,0.77,-0.7" for k in range(2001)]),
    "recorded.csv": table(RECORDED),
    "few.csv": table(RECORDED[::4]),
    "gap.csv": without(RECORDED, 20, 40),
    "jump.csv": with_row(RECORDED, MIDDLE, "2.000,1.9,0.77,-0.7"),
    "nan.csv": with_row(RECORDED, MIDDLE, "2.000,nan,0.77,-0.7"),
    "far.csv": with_row(RECORDED, MIDDLE, "2.000,1e9,0.77,-0.7"),
    "late.csv": with_row(RECORDED, MIDDLE, "1.000,1.15,0.77,-0.7"),
    "less.csv": without(RECORDED, MIDDLE, MIDDLE + 1),
    "moving.csv": without(RECORDED, 0, 25),
    "down.csv": table([row.replace("-0.7", "0.7") for row in RECORDED]),
    "elsewhere.csv": table([row.replace("0.77", "1.0") for row in RECORDED]),
    "millis.csv": table([f"{1e3 * t:.0f},{x:.6f},0.77,-0.7" for t, x in zip(TIMES, BRIDGE, strict=True)]),
    "fast.csv": table([f"{t / 10:.4f},{x:.6f},0.77,-0.7" for t, x in zip(TIMES, BRIDGE, strict=True)]),
}
IN_SI = "units={time='s', length='m'}"
NAMED = "columns={time='time [s]', x='x [m]', y='y [m]', z='z [m]'}"
IN_INCHES = NAMED.replace("x [m]", "x [inch]")


def segment(kind: str, *settings: str) -> str:
    return f"reference.segments=[{{kind='{kind}', {', '.join(settings)}}}]"


def points(file: str = "points.csv", units: str = IN_SI, *settings: str) -> str:
    return segment("waypoints", f"file='{file}'", *filter(None, [units]), *settings)


def samples(file: str = "recorded.csv", units: str = IN_SI, *settings: str) -> str:
    return segment("samples", f"file='{file}'", units, *settings)


def through(*timing: str, route: str = "[1.0,0.77,-0.7],[1.1,0.77,-0.7],[1.3,0.77,-0.7]") -> str:
    return segment("waypoints", f"points=[{route}]", *timing)


def repeated(*timing: str) -> str:
    return through(*timing, route="[1.0,0.77,-0.7],[1.1,0.77,-0.7],[1.1,0.77,-0.7],[1.3,0.77,-0.7]")


def after_a_line(to: str, then: str) -> str:
    """Insert a line before the segments of a setting."""
    return then.replace("=[", f"=[{{kind='line', to={to}, duration='shortest'}},", 1)


STAY = segment("hold", "duration=1.0")
UNEVEN = "[1.0,0.77,-0.7],[1.1,0.77,-0.7],[1.100001,0.77,-0.7],[1.2,0.77,-0.7],[1.4,0.77,-0.7]"
EVEN = "[1.0,0.77,-0.7],[1.1,0.77,-0.7],[1.2,0.77,-0.7],[1.4,0.77,-0.7]"
QUICK, FASTER = "times=[0, 0.6, 1.2]", "velocity=[3.0, 3.0, 3.0]"
HARDER = "acceleration=[30.0, 30.0, 30.0]"
NO_FORCE = ["--drive", "velocity", "effects.limits.force=[1e9, 1e9, 1e9]"]
LIMITED = [
    *NO_FORCE,
    "effects.limits.velocity=[1.0, 1.0, 0.6]",
    "effects.limits.acceleration=[4.0, 4.0, 6.0]",
]
ENCODING = "save it as CSV in UTF-8, or as Parquet"
MAP = "map it: columns = {{} = '…'}{}"
REST = "leave out {}; to rest there, give times in place of speeds"
DEMAND = "give the motion more time, or raise {} if the drive can do more"
CASES = {
    "reference/files.py": [
        Case("name such a file", points("absent.csv"), points()),
        Case("leave out topic", points("points.csv", IN_SI, "topic='analytic/load'"), points()),
        Case("record it again", points("empty.csv"), points()),
        Case("set units = {{} = '{}', …}; cranectl does not guess units", points(units="units={time='s'}"),
             points()),
        Case("leave out units.{}, or correct the file", points("units.csv", "units={length='mm'}", NAMED),
             points("units.csv", "", NAMED), points()),
        Case("write the column in one of these units", points("inches.csv", IN_SI, IN_INCHES),
             points("units.csv", IN_SI, NAMED)),
    ],
    "support/errors.py": [
        Case("did you mean '{}'?", points("units.csv", ""), points("units.csv", "", NAMED)),
    ],
    "reference/tables.py": [
        Case(ENCODING, points("sheet.xlsx"), points()),
        Case("give the others another name", points("twice.csv"), points("once.csv")),
        Case(MAP, points("clock.csv"), points("clock.csv", IN_SI, "columns={time='clock'}")),
        Case(MAP, points("named.csv"), points("named.csv", IN_SI, "columns={x='laengs'}")),
        Case(MAP, points("flat.csv"), points("flat.csv", IN_SI, "columns={z=-0.7}")),
    ],
    "support/tables/layout.py": [
        Case("write the file with one of these between its columns", points("bars.csv"), points()),
    ],
    "support/tables/text.py": [
        Case("correct that line, or leave it out", points("ragged.csv"), points(), points("two.csv")),
        Case("write a line of names before it, such as {}", points("bare.csv"), points()),
    ],
    "reference/point_splines.py": [
        Case('for a spline near more points use kind = "samples"', points("many.csv"), samples("many.csv")),
        Case("add or remove some", through("times=[0, 3]"), through("times=[0, 3, 6]")),
        Case("raise the speed, or give times in place of speeds", through("speed=[0, 0, 0.1]"),
             through("speed=[0, 0.1, 0.1]"), through("times=[0, 3, 6]")),
        Case('to stay in place use kind = "hold"',
             through("speed=0.1", route="[1.0,0.77,-0.7],[1.0,0.77,-0.7]"), STAY),
        Case(REST, repeated("speed=0.1"), through("speed=0.1"), repeated("times=[0, 3, 4, 7]")),
        Case(REST, repeated("speed=[0.0, 0.1, 0.1, 0.0]"), through("speed=[0.0, 0.1, 0.0]")),
        Case("leave out {}; to stop there, end the segment there and begin another",
             repeated("time_law='minimum-time'"), through("time_law='minimum-time'"),
             after_a_line("[1.1, 0.77, -0.7]",
                          segment("line", "to=[1.3, 0.77, -0.7]", "duration='shortest'"))),
        Case("reference.start = [{}] if it is the first segment, or move there before, or offset = '{}'",
             samples("elsewhere.csv"),
             [samples("elsewhere.csv"), "reference.start=[1.0000, 1.0000, -0.7000]"],
             after_a_line("[1.0000, 1.0000, -0.7000]", samples("elsewhere.csv")),
             samples("elsewhere.csv", IN_SI, "offset='to-start'")),
        Case("signs = [1, 1, -1] if the file counts z downwards; or offset = '{}' if it counts from "
             "elsewhere", samples("down.csv"), samples("down.csv", IN_SI, "signs=[1, 1, -1]"),
             samples("down.csv", IN_SI, "offset='to-start'")),
        Case("leave out spans, which is chosen then, or take fewer",
             samples("recorded.csv", IN_SI, "spans=500"), samples(),
             samples("recorded.csv", IN_SI, "spans=8")),
        Case("leave out points that are close together, or add some between those far apart",
             through("times=[0, 3, 3.0000001, 5, 7]", route=UNEVEN),
             through("times=[0, 3, 5, 7]", route=EVEN)),
    ],
    "scenario/scenario.py": [
        Case("{}{}{}", [samples(), "duration=3.0"], [samples(), "duration=5.0"]),
        Case("{}{}{}", samples("millis.csv"), samples("millis.csv", "units={time='ms', length='m'}")),
    ],
    "reference/sanity.py": [
        Case("leave these rows out, or record the motion again", samples("nan.csv"), samples("less.csv")),
        Case("correct the units, or record the motion again", samples("far.csv"), samples()),
        Case("sort the rows, and keep one of each time", samples("late.csv"), samples()),
        Case('record more often, or take them as points: kind = "waypoints"', samples("few.csv"), samples(),
             points("few.csv")),
        Case("fill it in, or cut the file there into two", samples("gap.csv"), samples()),
        Case("leave such samples out, or record the motion again", samples("jump.csv"), samples("less.csv")),
        Case("record it with a rest before and after, or cut it there", samples("moving.csv"), samples()),
        Case(DEMAND, through(QUICK), through("times=[0, 3, 6]"),
             [through(QUICK), f"rig.effects.limits.{FASTER}", f"rig.effects.limits.{HARDER}"]),
        Case(DEMAND, [*LIMITED, through(QUICK)],
             [*LIMITED, through(QUICK), f"effects.limits.{FASTER}", f"effects.limits.{HARDER}"]),
        Case("give the motion more time, or fewer knots by spans", samples("fast.csv"), samples()),
    ],
}  # fmt: skip


files = written(FILES)
test_a_remedy_works_on_the_refused_input = remedy_test(CASES, RUN)

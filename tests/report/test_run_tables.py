"""Tables of runs: what they share is said once, agreement is judged row by row."""

from dataclasses import replace
from math import nan
from pathlib import Path

import pytest

from cranectl.cases.case import RunSummary
from cranectl.compare.agreement import Agreement
from cranectl.metrics.limits import LimitVerdict
from cranectl.report.run.tables import RunTables
from cranectl.report.table import Cell
from cranectl.status import RunStatus

RUN = RunSummary("fast", "lqr", "analytic", "ideal", RunStatus.COMPLETED, 2.0, Path("a.mcap"), None)
GOOD = Agreement("fast", "lqr", "analytic", "mujoco", "ideal", 1e-9, 2e-9, 1e-7, 1e-7, True, "as shipped")


def texts(cells: tuple[Cell, ...]) -> list[str]:
    return [cell.text for cell in cells]


def test_what_runs_share_stands_in_the_title() -> None:
    stopped = replace(RUN, plant="mujoco", status=RunStatus.SLACK_ROPE, end_s=1.25)
    table = RunTables.runs({"a": [RUN, stopped]})
    assert table.title == "Runs, fast, lqr, ideal drives"
    assert table.headings[:3] == ("plant", "ended", "at [s]")
    assert [texts(row)[:3] for row in table.rows] == [
        ["analytic", "completed", "2"],
        ["mujoco", "slack-rope", "1.25"],
    ]
    assert [row[1].mark for row in table.rows] == ["good", "bad"]


@pytest.mark.parametrize(
    ("heading", "other", "text"),
    [
        ("scenario", replace(RUN, scenario="slow"), "slow"),
        ("controller", replace(RUN, controller="pid"), "pid"),
        ("drives", replace(RUN, drive="velocity"), "velocity drives"),
    ],
)
def test_what_tells_runs_apart_has_a_column(heading: str, other: RunSummary, text: str) -> None:
    table = RunTables.runs({"a": [RUN], "b": [other]})
    assert table.headings[: table.labels] == ("log", heading, "plant", "ended")
    assert [row[0].text for row in table.rows] == ["a", "b"]
    assert table.rows[1][1].text == text
    assert text not in table.title
    assert {len(row) for row in table.rows} == {len(table.headings)}


def test_agreement_has_a_row_for_each_controller_below_its_scenario() -> None:
    velocity = replace(GOOD, drive="velocity", max_load_error_m=2e-7, passed=False)
    other = replace(GOOD, scenario="slow", controller="pid")
    table = RunTables.agreement([GOOD, velocity, other], ["", "limits broken", ""])
    assert [texts(row)[0] for row in table.rows] == ["fast", " lqr", "slow", " pid"]
    assert [row[0].mark for row in table.rows] == ["head", "", "head", ""]
    assert {len(row) for row in table.rows} == {len(table.headings)} == {7}
    assert table.headings[1:3] == ("ideal\nload [m]\n< 1e-07", "ideal\nangle [rad]\n< 1e-07")
    assert [(cell.text, cell.mark) for cell in table.rows[1][1:]] == [
        ("1.0e-09", ""), ("2.0e-09", ""), ("2.0e-07", "bad"), ("2.0e-09", ""), ("NO", "bad"),
        ("limits broken", "bad"),
    ]  # fmt: skip
    assert texts(table.rows[3])[1:] == ["1.0e-09", "2.0e-09", "-", "-", "yes", ""]


def test_limits_of_their_own_stand_beside_the_numbers() -> None:
    other = replace(GOOD, scenario="slow", limit_m=1e-3, limit_rad=1e-3)
    table = RunTables.agreement([GOOD, other])
    assert table.headings[1] == "ideal\nload [m]"
    assert [table.rows[k][1].text for k in (1, 3)] == ["1.0e-09 < 1.0e-07", "1.0e-09 < 1.0e-03"]


def test_a_verdict_names_the_drives_that_are_judged() -> None:
    unjudged = replace(GOOD, drive="velocity", limit_m=None, limit_rad=None, passed=None)
    assert RunTables.agreement([unjudged]).rows[1][-1] == Cell("not judged", "open")
    assert RunTables.agreement([GOOD, unjudged]).rows[1][-1] == Cell("yes (ideal)", "good")
    assert RunTables.agreement([replace(GOOD, passed=False), unjudged]).rows[1][-1] == Cell("NO", "bad")


def test_limits_are_told_once_a_case() -> None:
    kept = LimitVerdict("max_sway_rad", 0.03, 0.1, kept=True)
    broken = LimitVerdict("overshoot_m", None, 0.1, kept=False)
    judged = replace(RUN, limits=(kept, broken))
    table = RunTables.limits([[judged, RUN]])
    assert table is not None
    assert [texts(row) for row in table.rows] == [
        ["analytic", "max_sway_rad", "1.719", "≤ 5.73", "°", "yes"],
        ["analytic", "overshoot_m", "–", "≤ 0.1", "m", "NO"],
    ]
    assert table.note == "1 of 2 limits kept."
    assert RunTables.limits([[RUN]]) is None
    others = [replace(judged, plant=plant) for plant in ("elastic", "mujoco")]
    for cases, note in (([[judged, *others]], "1 of 2"), ([[judged, *others], [judged]], "2 of 4")):
        table = RunTables.limits(cases)
        assert table is not None
        assert table.note == f"{note} limits kept."
        assert [row[0].text for row in table.rows[:2]] == ["mujoco"] * 2, "that is the reference plant"


def test_of_many_broken_limits_the_worst_are_told() -> None:
    values = {"rms_sway_rad": 0.15, "max_sway_rad": 0.3, "min_rope_tension_n": 0.02, "overshoot_m": None}
    verdicts = [LimitVerdict(name, value, 0.1, kept=False) for name, value in values.items()]
    kept = LimitVerdict("max_error_m", 0.03, 0.1, kept=True)
    good = replace(RUN, controller="pid", limits=(kept,))
    table = RunTables.limits([[good], [replace(RUN, limits=(kept, *verdicts))]], worst=3)
    assert table is not None
    assert [row[0].text for row in table.rows] == ["fast, lqr, ideal"] * 3
    assert [row[2].text for row in table.rows] == ["overshoot_m", "min_rope_tension_n", "max_sway_rad"]
    assert table.note == "2 of 6 limits kept. Shown are the 3 that are broken most, of 4."


def test_of_many_scenarios_without_limits_a_few_are_named() -> None:
    unjudged = [replace(GOOD, scenario=f"s{k}", passed=None, limits="nobody knows") for k in range(30)]
    assert RunTables.limit_notes(unjudged) == [
        "s0, s1, s2 and 27 more, ideal drives: not judged: nobody knows"
    ]
    assert RunTables.limit_notes(unjudged[:3]) == ["s0, s1, s2, ideal drives: not judged: nobody knows"]


def test_a_summary_has_the_largest_differences_of_a_scenario() -> None:
    worse = replace(GOOD, controller="pid", max_load_error_m=3e-8, max_angle_error_rad=5e-10)
    velocity = replace(GOOD, drive="velocity", max_load_error_m=2e-9)
    table = RunTables.agreement_summary([GOOD, worse, velocity])
    (row,) = table.rows
    assert [cell.text for cell in row][:2] == [GOOD.scenario, "3.0e-08"]
    assert row[-1] == Cell("yes", "good")
    failed = replace(GOOD, controller="pid", max_load_error_m=1.0, passed=False)
    (row,) = RunTables.agreement_summary([GOOD, failed, velocity]).rows
    assert row[1] == Cell("1.0e+00", "bad")
    assert row[-1] == Cell("NO (1 of 3)", "bad")
    unjudged = replace(velocity, passed=None, limit_m=None, limit_rad=None)
    assert RunTables.agreement_summary([GOOD, unjudged]).rows[0][-1] == Cell("yes (ideal)", "good")
    assert RunTables.agreement_summary([unjudged, velocity]).rows[0][-1] == Cell("yes", "good")
    own = replace(unjudged, plant="mine", max_load_error_m=9e-3)
    beside = RunTables.agreement_summary([velocity, own])
    assert [row[0].text for row in beside.rows] == [velocity.scenario, f"{velocity.scenario}, mine"]
    assert [row[-1].text for row in beside.rows] == ["yes", "not judged"]
    assert beside.rows[1][1].text == "9.0e-03"
    assert beside.headings[1].endswith(RunTables.agreement_summary([velocity]).headings[1])
    slow = replace(GOOD, scenario="slow")
    broken = RunTables.agreement_summary([GOOD, GOOD, slow], ["limits broken"] * 2 + [""])
    assert [row[-1] for row in broken.rows] == [Cell("limits broken", "bad"), Cell("")]
    lost = replace(failed, max_load_error_m=nan)
    assert RunTables.agreement_summary([lost, failed]).rows[0][1].mark == "bad"

"""The page of a ladder, and the tables of a rig: every row has its columns, marks say what is so."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from cranectl.cli.main import main
from cranectl.cli.output import FILE_WIDTH, screen_table
from cranectl.planning import load_scenario
from cranectl.report.table import Table
from cranectl.status import RunStatus
from cranectl.tools.robustness.ladder import LevelResult, Size, evaluate_levels
from cranectl.tools.robustness.levels import NAMES
from cranectl.tools.robustness.report.page import deviation_dots
from cranectl.tools.robustness.report.tables import LadderTables
from tests.report.test_report import read_page

pytestmark = pytest.mark.usefixtures("in_empty_directory")

SHORT = ["--set", "duration=1.0", "--set", "disturbances.0.start=0.1", "--set", "disturbances.1.start=0.2"]


def test_the_page_of_a_ladder(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["ladder", "fixed-position", *SHORT, "--top", "delay", "--report", "a.html", "--json", "a.json"]
    assert main(command) == 0
    assert "sensing" in capsys.readouterr().out
    assert Path("logs/fixed-position/pole-placement-ladder.mcap").exists()
    page = Path("a.html").read_text()
    data = json.loads(Path("a.json").read_text())
    assert [level["level"] for level in data["levels"]] == list(NAMES[:7])
    for level in data["levels"]:
        assert f">{level['level']}<" in page
        if level["cumulative"]:
            assert f"{1e3 * level['cumulative']['max']:.3g}" in page
    assert "friction" not in page
    assert page.count("<svg") == 2
    read_page(page)
    assert main(command) == 0
    assert Path("a.html").read_text() == page


def test_deviations_are_dots_in_millimetres() -> None:
    """Nothing is at the left edge; what is not there has no dot."""
    pair = {"one": [2e-3, 0.0, np.nan], "other": [1.0, 1.0, 1.0]}
    (axes,) = deviation_dots("abc", pair).axes
    one, _ = (line.get_xdata() for line in axes.lines)
    assert np.array_equal(one, [2.0, 1e-3, np.nan], equal_nan=True)


OVERRIDES = ["duration=0.5", "disturbances.0.start=0.1", "disturbances.1.start=0.2"]
LARGE = Size(1e-3, 3e-3, 2e-3)


@pytest.fixture(scope="module")
def steps() -> list[LevelResult]:
    return list(evaluate_levels(load_scenario("fixed-position", overrides=OVERRIDES), top="limits"))


def cells(table: Table, label: str) -> dict[str, tuple[str, str]]:
    """Texts and marks of a row by its headings."""
    assert len(set(table.headings)) == len(table.headings)
    assert all(len(row) == len(table.headings) for row in table.rows)
    (row,) = (row for row in table.rows if row[0].text == label)
    headings = (heading.replace("\n", " ") for heading in table.headings)
    return {heading: (cell.text, cell.mark) for heading, cell in zip(headings, row, strict=True)}


def test_ladder(steps: list[LevelResult]) -> None:
    table = LadderTables.differences(steps)
    for step in steps:
        row = cells(table, step.level.name)
        assert row["ended"] == ("completed", "good")
        assert float(row["error [mm] max"][0]) == pytest.approx(1e3 * step.metrics.max_error_m, rel=5e-3)
        adds = "" if step.cumulative is None else f"{1e3 * step.cumulative.final:.3g}"
        assert row["adds [mm] final"] == (adds, "")
    assert any(step.cumulative for step in steps)
    last = steps[-1]
    stopped = replace(last.run, status=RunStatus.SLACK_ROPE, end_ns=250_000_000)
    row = cells(LadderTables.differences([replace(last, run=stopped, metrics=None)]), last.level.name)
    assert row["ended"] == ("slack-rope at 0.25 s", "bad")
    assert row["error [mm] max"] == ("–", "")
    row = cells(
        LadderTables.differences([replace(last, alone=LARGE, alone_status="slack-rope")]), last.level.name
    )
    assert (row["alone [mm] RMS"], row["alone [mm] max"]) == (("slack-rope", "bad"), ("", ""))


def test_a_file_takes_the_widest_table_whole(steps: list[LevelResult]) -> None:
    small = Size(1.23e-7, 1.23e-7, 1.23e-7)
    last = replace(steps[-1], cumulative=small, alone=small)
    stopped = replace(last.run, status=RunStatus.WORKSPACE_LEFT, end_ns=12_345_000_000)
    longest = replace(last.level, name=max(NAMES, key=len))
    table = screen_table(LadderTables.differences([last, replace(last, run=stopped, level=longest)]))
    screen = Console(width=1000)
    assert screen.measure(table).maximum <= FILE_WIDTH

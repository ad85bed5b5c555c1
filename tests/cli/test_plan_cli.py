"""`cranectl plan`: what is shown of a plan, that logs tell it, and that they run again to the bit."""

import json
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.planning import load_scenario, planned
from cranectl.simulate import simulate_run

pytestmark = pytest.mark.usefixtures("in_empty_directory")

SCENARIO = """
name = "across"
duration = 3.0
[reference]
start = [0.4, 0.77, -0.7]
[[reference.segments]]
kind = "line"
to = [1.0, 0.77, -0.7]
time_law = "minimum-time"
[[obstacles]]
name = "low wall"
low = [0.6, 0.0, -1.4]
high = [0.8, 1.54, -1.0]
"""


def test_a_plan_is_shown_drawn_and_told_by_the_log(capsys: pytest.CaptureFixture[str]) -> None:
    Path("across.toml").write_text(SCENARIO)
    assert main(["plan", "across.toml", "--plot", "plan.svg", "--json", "plan.json"]) == 0
    shown = capsys.readouterr().out
    assert "a given line in minimum time" in shown
    assert "bridge set-point's rate" in shown
    assert Path("plan.svg").read_text().count("<path") > 20
    (told,) = json.loads(Path("plan.json").read_text())["segments"]
    assert told["proven"]
    assert told["drives_alone_s"] < told["duration_s"] < 2.0
    assert min(told["slack"].values()) >= 0.0

    assert main(["run", "across.toml", "--plants", "analytic", "--out", "across.mcap"]) == 0
    assert main(["info", "across.mcap"]) == 0
    assert (
        f"segment 0: a given line in minimum time, {told['duration_s']:.3f} s; proven"
        in capsys.readouterr().out
    )
    assert main(["report", "across.mcap"]) == 0
    page = Path("across.html").read_text()
    assert "Limits that act" in page
    assert "limits and path" in page


def test_a_log_runs_again_without_planning(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("across.toml").write_text(SCENARIO)
    assert main(["run", "across.toml", "--plants", "analytic", "--out", "across.mcap"]) == 0
    run = read_log("across.mcap")["analytic"]
    monkeypatch.delattr("cranectl.planning.programs.solve")
    scenario = planned(run.scenario)
    assert scenario is run.scenario
    again = simulate_run(scenario, plant="analytic", design=run.design)
    every = scenario.log.every
    assert np.array_equal(again.reference[::every], run.reference)
    assert np.array_equal(again.table[::every], run.table)


def test_what_finer_knots_would_gain_is_told_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    Path("across.toml").write_text(SCENARIO)
    assert main(["plan", "across.toml", "--bound", "--json", "plan.json"]) == 0
    assert "least with any knots" in capsys.readouterr().out
    (told,) = json.loads(Path("plan.json").read_text())["segments"]
    finer = load_scenario("across.toml", overrides=["planning.refinement=2"])
    (fine,) = [segment.duration for segment in finer.reference.segments]
    assert told["drives_alone_s"] < told["least_with_any_knots_s"] < fine < told["duration_s"]
    assert told["least_with_any_knots_s"] == pytest.approx(2.0 * fine - told["duration_s"])


def test_nothing_is_planned_where_everything_has_its_time(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "fast-diagonal"]) == 0
    assert "a line, as given" in capsys.readouterr().out
    assert main(["plan", "fast-diagonal", "--plot", "plan.svg"]) == 2
    assert "nothing to draw" in capsys.readouterr().err


def test_the_shipped_twins_are_as_fast_as_the_page_says() -> None:
    lasting = {
        name: sum(segment.duration for segment in load_scenario(name).reference.segments)
        for name in ("fast-diagonal-shortest", "settled-trajectory-shortest", "ship-to-shore-shortest")
    }
    assert lasting == pytest.approx(
        {
            "fast-diagonal-shortest": 1.961,
            "settled-trajectory-shortest": 6.121,
            "ship-to-shore-shortest": 18.774,
        },
        rel=1e-3,  # starts and machines leave less
    )

"""`cranectl plan` prints and draws plans; logs contain the plan, and are simulated again bit for bit."""

import json
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.planning import load_scenario, plan_motions
from cranectl.simulate import simulate_run
from tests.cli.conftest import Command
from tests.reference.recordings import scenario_text
from tests.remedies import written

ACROSS = scenario_text(
    "kind = 'line'\nto = [1.0, 0.77, -0.7]\ntime_law = 'minimum-time'", [0.4, 0.77, -0.7], duration=3.0,
    obstacles=[{"name": "low wall", "low": [0.6, 0.0, -1.4], "high": [0.8, 1.54, -1.0]}],
)  # fmt: skip
HOIST = scenario_text(
    "kind = 'line'\nto = [1.0, 0.77, -0.5]\nduration = 4.4", [1.0, 0.77, -1.0], duration=6.0,
    effects={"limits": {"velocity": [1.0, 1.0, 0.2]}},
)  # fmt: skip
files = written({"across.toml": ACROSS, "hoist.toml": HOIST})


@pytest.mark.slow
def test_a_plan_is_printed_drawn_and_logged(output: Command) -> None:
    out = output("plan", "across.toml", "--plot", "plan.svg", "--json", "plan.json")
    assert "a given line in minimum time" in out
    assert "bridge set-point's rate" in out
    assert Path("plan.svg").read_text().count("<path") > 20
    (segment,) = json.loads(Path("plan.json").read_text())["segments"]
    assert segment["proven"]
    assert segment["drives_alone_s"] < segment["duration_s"] < 2.0
    assert min(segment["slack"].values()) >= 0.0

    assert main(["run", "across.toml", "--plants", "analytic", "--out", "across.mcap"]) == 0
    planned = f"segment 0: a given line in minimum time, {segment['duration_s']:.3f} s; proven"
    assert planned in output("info", "across.mcap")
    assert main(["report", "across.mcap"]) == 0
    page = Path("across.html").read_text()
    assert "Limits that act" in page
    assert "limits and path" in page


def test_a_log_is_simulated_again_without_planning(monkeypatch: pytest.MonkeyPatch) -> None:
    assert main(["run", "across.toml", "--plants", "analytic", "--out", "across.mcap"]) == 0
    run = read_log("across.mcap")["analytic"]
    monkeypatch.delattr("cranectl.planning.programs.solve")
    scenario = plan_motions(run.scenario)
    assert scenario is run.scenario
    repeated = simulate_run(scenario, plant="analytic", design=run.design)
    every = scenario.log.every
    assert np.array_equal(repeated.reference[::every], run.reference)
    assert np.array_equal(repeated.table[::every], run.table)


def test_the_bound_for_finer_knots_is_printed_on_request(output: Command) -> None:
    assert "least with any knots" in output("plan", "across.toml", "--bound", "--json", "plan.json")
    (segment,) = json.loads(Path("plan.json").read_text())["segments"]
    refined = load_scenario("across.toml", overrides=["planning.refinement=2"])
    (duration,) = [refined_segment.duration for refined_segment in refined.reference.segments]
    bound = segment["least_with_any_knots_s"]
    assert segment["drives_alone_s"] < bound < duration < segment["duration_s"]
    assert bound == pytest.approx(2.0 * duration - segment["duration_s"])


def test_a_scenario_with_given_times_needs_no_plan(output: Command) -> None:
    """`test_nothing_to_judge.py` asks for a picture of it."""
    assert "a line, as given" in output("plan", "fast-diagonal")


def test_shipped_minimum_time_scenarios_have_the_documented_durations() -> None:
    documented = {
        "fast-diagonal-shortest": 1.961,
        "settled-trajectory-shortest": 6.121,
        "ship-to-shore-shortest": 18.774,
    }
    for name, expected in documented.items():
        duration = sum(segment.duration for segment in load_scenario(name).reference.segments)
        assert duration == pytest.approx(expected, rel=1e-3), name  # guesses and machines change less


def test_a_motion_that_run_refuses_is_refused_by_plan_with_the_same_words(refusal: Command) -> None:
    error = refusal("plan", "hoist.toml")
    assert error == refusal("run", "--plants", "elastic", "hoist.toml")
    assert "the drive of the rope can: 0.28 m/s" in error
    assert "effects.limits.velocity = 0.2 m/s" in error
    Path("hoist.toml").write_text(HOIST.replace("6.0", "8.0").replace("4.4", "6.0"))
    assert main(["plan", "hoist.toml", "--set", "effects.limits.velocity=[1.0,1.0,0.3]"]) == 0

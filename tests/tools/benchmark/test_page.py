"""Test the benchmark's page with artificial results: separate divisions, numbers, missing results."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cranectl.campaign.summary import EFFORT
from cranectl.report.page import Section, render
from cranectl.report.table import Table
from cranectl.support.errors import InputError
from cranectl.tools.benchmark.declared import information, information_class
from cranectl.tools.benchmark.ranking import Judged, points_of
from cranectl.tools.benchmark.report.page import benchmark_page
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.table import METRICS, VARIATION, BenchmarkTable, Runs
from cranectl.tools.benchmark.trials import Division, Trial, sets_of
from tests.controllers.own_controllers import FOLLOWING, known

FACTS = {"follows": "path", "measures": "state", "commands": "velocity"}
FACTS |= {"preview": 0, "reads_path": False, "every": 1, "rig": []}
RUNS = 8
Texts = list[list[str]]


def runs(error: float, failures: int = 0, effort: float = 1.0) -> Runs:
    """Return eight runs with errors from `error` upwards; the last `failures` of them failed."""
    metrics = {**dict.fromkeys(METRICS, 0.1), EFFORT: effort, VARIATION: 1.0}
    columns = {name: np.full(RUNS, value) for name, value in metrics.items()}
    columns["rms_error_m"] = error + 1e-3 * np.arange(RUNS)
    columns["settling_time_s"] = np.full(RUNS, 10.0 * error)
    return Runs(np.arange(RUNS) >= RUNS - failures, ("completed",) * RUNS, columns)


def table(benchmark: Benchmark, controllers: Mapping[str, Runs], *divisions: Division) -> BenchmarkTable:
    """Return a table in which each controller has the same runs in every trial of `divisions`."""
    tuned = {
        "runs": 40,
        "cost": {"untuned": 3.0, "half": 2.0, "full": 1.5},
        "failed": {"untuned": 0.5, "half": 0.25, "full": 0.0},
        "chosen": "half",
        "validation": {"cost": {"untuned": 3.1, "half": 2.4, "full": 2.6}, "failed": {}},
        "numbers": {"controller.first.weight": [1.0, 2.5]},
    }
    about = {
        "rules": "abc",
        "seed": 3,
        "made_by": [{"cranectl": "1.0", "machine": "a"}, {"cranectl": "1.1", "machine": "a"}],
        "durations": {"short": 1.0, "path": 0.8},
        "laws": {controller: {**FACTS, "file": ""} for controller in controllers},
        "tuned": dict.fromkeys(controllers, tuned) if "tuned" in divisions else {},
    }
    trials = {
        Trial(division, plant, name, "short", controller): controller_runs
        for division in divisions
        for name in sets_of(benchmark)
        for plant in ("mujoco", "analytic")
        for controller, controller_runs in controllers.items()
    }
    return BenchmarkTable(about, trials)


def sections(benchmark: Benchmark, results: BenchmarkTable) -> dict[str, Section]:
    page = benchmark_page(benchmark, results, "cranectl benchmark report")
    assert len({section.anchor for section in page.sections}) == len(page.sections)
    assert render(page)
    return {section.anchor: section for section in page.sections}


def texts(shown: Table) -> Texts:
    return [[cell.text for cell in row] for row in shown.rows]


def test_divisions_share_a_page_but_no_table(benchmark: Benchmark) -> None:
    published = table(benchmark, {"first": runs(0.02), "second": runs(0.03)}, "published")
    both = BenchmarkTable.join(
        [published, table(benchmark, {"first": runs(0.01), "third": runs(0.05)}, "tuned")]
    )
    by_anchor = sections(benchmark, both)
    first = ["result", "conclusions", "caveats", "before-after", "summary", "rules", "tuning"]
    sets = ("nominal", "wide", "radius", "single", "second")
    of_divisions = [f"{division}-{name}" for division in ("tuned", "published") for name in sets]
    assert list(by_anchor) == [*first, *of_divisions, "versions"]
    for anchor, section in by_anchor.items():
        # The table of the rules has columns for all that a controller knows, so it needs no summary of it.
        has_summary = [shown.headings[:2] == ("controller", "knows") for shown in section.tables]
        assert all(has_summary) is (anchor != "rules")
        if anchor.startswith(("tuned-", "published-")):
            allowed = {"first", "third"} if anchor.startswith("tuned-") else {"first", "second"}
            for shown in section.tables:
                assert {row[0] for row in texts(shown)} <= allowed
    tuned, untuned = by_anchor["summary"].tables
    assert texts(tuned) == [
        ["first", "path, state", "all sets", "0.0", "11.1", "1.00", "0.0", "11.1", "1.00"]
    ]
    assert {tuple(cell.mark for cell in row) for row in untuned.rows} == {("best", *[""] * 8)}
    assert tuned.title == "Tuned: 1 of 2 controllers"
    assert by_anchor["versions"].paragraphs[0] == "Digest of the rules: abc. Seed of the cranes: 3."
    assert by_anchor["versions"].paragraphs[1] == "Made by cranectl 1.0, machine a; some with cranectl 1.1."
    gains, numbers = by_anchor["tuning"].tables
    row = "first|path, state|40|3.000|2.000|1.500|3.100|2.400|2.600|half"
    assert "|".join(texts(gains)[0]) == row
    assert texts(numbers) == [
        ["first", "path, state", "weight 1 → 2.5"],
        ["third", "path, state", "controller.first.weight 1 → 2.5"],
    ]


def test_single_effects_show_five_best_and_fold_others(benchmark: Benchmark) -> None:
    controllers = {
        f"controller-{k}": runs(0.01 * k, failures=(k == 2) + 5 * (k == 6)) for k in (6, 5, 4, 3, 2, 1)
    }
    results = table(benchmark, controllers, "published")
    alone = Trial("published", "mujoco", "only-load", "short", "controller-3")
    results = BenchmarkTable(results.about, {**results.trials, alone: runs(0.2, failures=1)})
    failed, errors, failed_others, errors_others = sections(benchmark, results)["published-single"].tables
    assert [head.split("\n")[-1] for head in failed.headings[2:]] == ["nominal", "load", "sensing", "all"]
    order = ["controller-1", "controller-3", "controller-4", "controller-5", "controller-2"]
    assert [row[0] for row in texts(failed)] == [row[0] for row in texts(errors)] == order
    assert [row[0] for row in texts(failed_others)] == ["controller-6"]
    assert failed_others.folded
    assert errors_others.folded
    assert not failed.folded
    assert texts(failed)[1][2:] == ["0", "12", "0", "0"]
    assert texts(errors)[1][2:] == ["33.5", "204", "33.5", "33.5"]
    assert texts(errors_others)[0][2:] == ["fails"] * 4
    assert "only-" not in "".join(sections(benchmark, results)["published-radius"].tables[0].headings), (
        "the radius uses only sets with a spread"
    )


def test_radius_outside_the_measured_spreads_is_shown(benchmark: Benchmark) -> None:
    results = table(benchmark, {"never": runs(0.01), "always": runs(0.01, failures=RUNS)}, "published")
    wide = Trial("published", "mujoco", "spread-3", "short", "between")
    results = BenchmarkTable.join([results, table(benchmark, {"between": runs(0.01)}, "published")])
    results = BenchmarkTable(results.about, {**results.trials, wide: runs(0.01, failures=1)})
    (shown,) = sections(benchmark, results)["published-radius"].tables
    assert [(row[0], row[2]) for row in texts(shown)] == [
        ("never", "above 3"),
        ("between", "1.80"),
        ("always", "below 1"),
    ]


def test_crane_that_cannot_be_simulated_is_no_failure(benchmark: Benchmark) -> None:
    """Crane 3 could not be simulated with any controller; crane 2 failed with one, which counts."""
    results = table(benchmark, {"first": runs(0.01), "second": runs(0.02)}, "published")
    for controller, failed in (("first", (2, 3)), ("second", (3,))):
        status = tuple("failed" if k in failed else "completed" for k in range(RUNS))
        trial = Trial("published", "mujoco", "spread-3", "short", controller)
        stopped = Runs(np.isin(np.arange(RUNS), failed), status, results.trials[trial].metrics)
        results = BenchmarkTable(results.about, {**results.trials, trial: stopped})
    section = sections(benchmark, results)["published-radius"]
    assert [row[-1] for row in texts(section.tables[0])] == ["0", "14"]
    assert section.paragraphs[0].endswith(
        "Left out are cranes that could not be simulated with any controller: 1 at 3."
    )


def test_failures_are_listed_by_division_with_commands(benchmark: Benchmark) -> None:
    results = table(benchmark, {"first": runs(0.01, failures=1)}, "tuned", "published")
    tuned, published = sections(benchmark, results)["failures"].tables
    for shown, division in ((tuned, "tuned"), (published, "published")):
        assert [row[2] for row in texts(shown)] == ["nominal", "wide"]
        *facts, command = texts(shown)[0]
        assert facts == ["first", "path, state", "nominal", "short", "7", "beyond a limit"]
        run, replay = command.split(" && ")
        selection = f"--division {division} --controller first --set-of-cranes nominal --scenario short"
        assert run == f"cranectl benchmark run small.toml {selection} --draws 8 --out failures"
        assert replay == f"cranectl campaign replay failures/{division}/mujoco/nominal/short/first --run 7"
    results.about["laws"]["first"]["file"] = "abc"
    for shown in sections(benchmark, results)["failures"].tables:
        assert texts(shown)[0][-1].endswith("--run 7 --controller FILE"), (
            "a controller from a file needs its file"
        )


def test_controller_without_effort_is_dominated(benchmark: Benchmark) -> None:
    """A controller that cannot run has no effort, which must not make it better than others."""
    controllers = {"first": runs(0.01), "broken": runs(0.02, failures=RUNS, effort=math.nan)}
    results = table(benchmark, controllers, "published")
    points = points_of(Judged(benchmark, results, "published").ranking("wide"))
    np.testing.assert_array_equal(points, [[0.1 / 0.9, 1.0, 0.0], [1.0, math.inf, 1.0]])
    shown = sections(benchmark, results)
    assert [row[0] for row in texts(shown["summary"].tables[0])] == ["first"]
    assert [row[:3:2] for row in texts(shown["published-wide"].tables[0])] == [
        ["broken", "first"],
        ["first", "none"],
    ], "in the order of the alphabet, with the dominating controller"


def test_failed_runs_do_not_lower_the_effort(benchmark: Benchmark) -> None:
    """The small effort of a failed run does not improve any median."""
    failing = runs(0.01, failures=5, effort=0.1)
    results = table(benchmark, {"lqr-integral": runs(0.02), "failing": failing}, "published")
    shown = sections(benchmark, results)
    ranking, _, on_scenario = (texts(shown_table) for shown_table in shown["published-wide"].tables)
    assert [row[2] for row in ranking] == ["lqr-integral", "none"]
    standing, scenario = ranking[0], on_scenario[1]
    assert standing[6] == "off goal 5"
    assert ranking[1][6] == "–"
    assert standing[-2:] == ["fails", "fails"]
    assert scenario[6:8] == ["fails", "fails"]
    assert scenario[8:] == ["", "", "", "0.70", "-0.10 to 0.70", "+0.25"]
    (second,) = (texts(shown_table)[0] for shown_table in shown["published-second"].tables[:1])
    assert second[-1] == "0"


def test_controllers_are_compared_on_common_cranes(benchmark: Benchmark) -> None:
    """One controller may have run on the first cranes only, and a set-point controller has no path error."""
    controllers = {"mine": runs(0.01).first(6), "lqr-integral": runs(0.02), "other": runs(0.03)}
    results = table(benchmark, controllers, "published")
    results.about["laws"]["mine"] = {**FACTS, "file": "", "follows": "set-point"}
    trial = Trial("published", "mujoco", "wide", "short", "other")
    results.trials[trial._replace(scenario="path")] = results.trials.pop(trial)  # type: ignore[attr-defined,index]
    shown = sections(benchmark, results)["published-wide"]
    places = [[row[0], row[2]] for row in texts(shown.tables[0])]
    assert places == [["lqr-integral", "mine"], ["mine", "none"], ["other", "ran 0 of 1 scenarios"]]
    scenario = {row[0]: row for row in texts(shown.tables[2])}["mine"]
    assert scenario[7:] == ["", "", "", "", "-0.10", "-0.10 to -0.10", "-1.00"]
    assert texts(sections(benchmark, results)["published-second"].tables[0])[0][2] == "6", "number of runs"
    for trial in [
        trial for trial in results.trials if trial.controller == "mine" and trial.plant == "mujoco"
    ]:
        results.trials[trial] = runs(0.01).first(5)  # type: ignore[index]
    shown = sections(benchmark, results)
    scenario = {row[0]: row for row in texts(shown["published-wide"].tables[2])}["mine"]
    assert scenario[7:] == [""] * 7, "five cranes are too few for an interval of 95 %"
    assert texts(shown["published-second"].tables[0])[0][2] == "5"


def test_tables_of_different_controllers_or_numbers_are_not_joined(benchmark: Benchmark) -> None:
    one, other = (table(benchmark, {"mine": runs(error)}, "published") for error in (0.01, 0.02))
    one.about["durations"].pop("path")
    both = BenchmarkTable.join([one, other])
    assert both.about["durations"] == {"short": 1.0, "path": 0.8}
    assert both.trials == one.trials
    other.about["laws"]["mine"]["file"] = "def"
    with pytest.raises(InputError, match="results whose file of mine differ: def and "):
        BenchmarkTable.join([one, other])
    one, other = (table(benchmark, {"mine": runs(0.01)}, "tuned") for _ in range(2))
    other.about["tuned"]["mine"] = {**one.about["tuned"]["mine"], "numbers": {"x": [1.0, 2.0]}}
    with pytest.raises(InputError, match="results whose numbers of mine differ"):
        BenchmarkTable.join([one, other])


def test_table_is_read_as_written_or_refused(benchmark: Benchmark) -> None:
    results = table(benchmark, {"first": runs(0.01, failures=1)}, "tuned")
    file = Path("made.parquet")
    BenchmarkTable.write(file, results)
    read = BenchmarkTable.read(file)
    assert read.about == results.about
    for trial, expected in results.trials.items():
        np.testing.assert_array_equal(read.trials[trial].failed, expected.failed)
        np.testing.assert_allclose(read.trials[trial].metrics["rms_error_m"], expected.metrics["rms_error_m"])
    results.about.pop("tuned")
    BenchmarkTable.write(file, results)
    for damaged in (file, Path("small.toml")):
        with pytest.raises(InputError, match=f"{damaged.name} holds no benchmark"):
            BenchmarkTable.read(damaged)


def test_classes_of_information() -> None:
    assert information_class({**FACTS, "rig": ["gravity", "rope_range"]}) == "path, state"
    facts = {**FACTS, "follows": "set-point", "measures": "encoders", "rig": ["gravity", "load_mass"]}
    assert information_class(facts) == "set points, encoders, masses"
    facts = {**FACTS, "preview": 20, "rig": ["time_constants"]}
    assert information_class(facts) == "path, state, preview, drives"
    assert information("lqr-offset-free")["rig"] == ["gravity", "limits", "rope_range"]
    assert information_class({**FACTS, "rig": ["limits"]}) == "path, state, limits"
    assert information("flat-velocity")["rig"] == ["gravity", "time_constants"]


def test_missing_declaration_is_shown(benchmark: Benchmark) -> None:
    """The page does not guess what it reads. For force commands the loop uses masses."""
    with known(replace(FOLLOWING, name="silent", reads=None)) as name:
        silent = information(name)
    assert (silent["rig"], silent["reads_path"]) == (None, None)
    assert information_class(silent) == "path, state, rig not declared"
    with known(replace(FOLLOWING, name="open", command="force", reads=("path", "load_mass"))) as name:
        declared = information(name)
    assert (declared["rig"], declared["reads_path"]) == (["load_mass", "masses"], True)
    results = table(benchmark, {"first": runs(0.01), "second": runs(0.02)}, "published")
    results.about["laws"] |= {"first": silent, "second": declared}
    (shown,) = sections(benchmark, results)["rules"].tables
    assert texts(shown) == [
        ["first", "path", "state", "not declared", "velocity", "not declared"],
        ["second", "path", "state", "all of the path", "force", "load mass, masses"],
    ]

"""The shipped benchmark table is complete, and belongs to the present controllers, numbers and cranes."""

import functools
import itertools
import re
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import pytest

from cranectl.campaign.table import FAILED
from cranectl.campaign.workers import batch_engine
from cranectl.cli.main import main
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.declared import controller_files
from cranectl.tools.benchmark.ranking import Judged, points_of
from cranectl.tools.benchmark.results import collect_results, run_trials
from cranectl.tools.benchmark.scores import undominated
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.table import BenchmarkTable
from cranectl.tools.benchmark.trials import DIVISIONS, Trial, campaign_of, rules_of, sets_of, trials_of
from cranectl.tools.benchmark.tuned import TunedResult
from tests.benchmark.nmpc import FOLDER
from tests.conftest import ROOT
from tests.pace import HANG

BENCHMARK = Benchmark.read("literature")
BENCHMARK_FOLDER = BENCHMARK.file.parent
JUDGED_SETS = {"tuned": tuple(sets_of(BENCHMARK)), "published": ("nominal", "lab-rig")}
COMPILED = "nmpc"  # not in the benchmark's file, because it must be compiled first


@pytest.fixture(scope="module")
def judged() -> BenchmarkTable:
    return BenchmarkTable.read(BENCHMARK_FOLDER / "literature.parquet")


@pytest.fixture
def controllers() -> tuple[str, ...]:
    return measured_controllers(BENCHMARK)


def test_table_has_every_controller_on_every_crane(
    judged: BenchmarkTable, controllers: tuple[str, ...]
) -> None:
    draws = {name: cranes.draws for name, cranes in sets_of(BENCHMARK).items()}
    expected = {}
    for division in DIVISIONS:
        for trial in trials_of(BENCHMARK, controllers, JUDGED_SETS[division], division=division):
            share = BENCHMARK.second_share if trial.plant == BENCHMARK.second_plant else 1.0
            expected[trial] = max(1, round(share * draws[trial.crane_set]))
            if trial.controller == BENCHMARK.baseline:
                expected[trial._replace(controller=COMPILED)] = expected[trial]
    assert {trial: len(runs.status) for trial, runs in judged.trials.items()} == expected
    not_simulated = defaultdict(set)
    for trial, runs in judged.trials.items():
        cranes = tuple(k for k, status in enumerate(runs.status) if status == FAILED)
        assert not (cranes and trial.crane_set in BENCHMARK.sets), trial
        not_simulated[trial[:4]].add(cranes)
    assert all(len(cranes) == 1 for cranes in not_simulated.values()), (
        "a crane cannot be simulated with one controller, but can with another"
    )


def test_table_belongs_to_present_controllers_numbers_and_rules(
    judged: BenchmarkTable, controllers: tuple[str, ...]
) -> None:
    rules = rules_of(BENCHMARK)
    assert (judged.about["rules"], judged.about["seed"]) == (rules, BENCHMARK.seed)
    for controller in controllers:
        assert judged.about["laws"][controller]["file"] == ALL_CONTROLLERS.digests([controller]).get(
            f"law {controller}", ""
        )
        assert judged.about["tuned"][controller] == TunedResult.facts(
            BENCHMARK_FOLDER / "tuned", rules, controller
        )
    facts, numbers = judged.about["tuned"][COMPILED], (FOLDER / "tuned" / f"{COMPILED}.toml").read_text()
    for key, (_, value) in facts["numbers"].items():
        assert f'"{key}" = {value:g}\n' in numbers


def test_files_of_controllers_are_found_without_running_them(controllers: tuple[str, ...]) -> None:
    named = dict(zip(controllers, BENCHMARK.laws, strict=True))
    assert controller_files(BENCHMARK) == {name: law for name, law in named.items() if ":" in law}


def test_runs_reproduce_shipped_results(
    judged: BenchmarkTable, controllers: tuple[str, ...], tmp_path: Path
) -> None:
    """Run the first crane on both plants, and compare with the table; if runs change, a new table is needed.

    Every controller runs tuned on the harbour scenario, and on one more scenario. Together these cover all
    sets of cranes in both divisions.
    """
    trials = trials_of(BENCHMARK, controllers, ("nominal",), ("harbour",), division="tuned")
    judged_sets = [(d, name) for d in DIVISIONS for name in JUDGED_SETS[d] if name in BENCHMARK.sets]
    combinations = itertools.cycle(itertools.product(BENCHMARK.scenarios, judged_sets))
    for controller, (scenario, (division, name)) in zip(controllers, combinations, strict=False):
        trials += trials_of(BENCHMARK, (controller,), (name,), (scenario,), division=division)
    assert_as_shipped(judged, trials, tmp_path)


@pytest.mark.processor
def test_runs_with_computed_gains_reproduce_shipped_results(
    judged: BenchmarkTable, controllers: tuple[str, ...], tmp_path: Path
) -> None:
    """These controllers compute gains by Riccati equations, matrix inequalities or H-infinity synthesis."""
    computed = ("lqr+hinf", "lqr-offset-free", "lqg", "lmi-regions", "multi-objective-hinf")
    assert set(computed) < set(controllers)
    trials = trials_of(BENCHMARK, computed, ("nominal",), ("harbour",), division="tuned")
    assert_as_shipped(judged, [trial for trial in trials if trial.plant == BENCHMARK.plant], tmp_path)


def assert_as_shipped(judged: BenchmarkTable, trials: Sequence[Trial], directory: Path) -> None:
    """Compare the first run of each trial with the one in the table, to 1e-3."""
    rules = rules_of(BENCHMARK)
    numbers = functools.partial(TunedResult.settings, BENCHMARK_FOLDER / "tuned", rules)
    campaign = functools.partial(campaign_of, BENCHMARK, max_cranes=1, tuned=numbers)
    with batch_engine(None, timeout=HANG) as engine:
        finished_trials = [
            finished.trial for finished in run_trials(list(trials), campaign, directory, engine, workers=2)
        ]
    table = collect_results(
        BENCHMARK,
        rules,
        directory,
        begun=finished_trials,
        tuned=BENCHMARK_FOLDER / "tuned",
        advance=lambda _: None,
    )
    assert set(table.trials) == set(trials)
    for trial, runs in table.trials.items():
        shipped = judged.trials[trial]
        assert (runs.failed[0], runs.status[0]) == (shipped.failed[0], shipped.status[0]), trial
        for name, values in runs.metrics.items():
            assert values[0] == pytest.approx(shipped.metrics[name][0], rel=1e-3, nan_ok=True), (trial, name)


def test_failure_can_be_replayed_as_in_the_how_to(
    judged: BenchmarkTable,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    how_to = (ROOT / "docs" / "how-to" / "benchmark.md").read_text(encoding="utf-8").replace("\\\n", "")
    run, replay = re.findall(
        r"^    cranectl (benchmark run .* --out failures|campaign replay failures/.*)$", how_to, re.MULTILINE
    )
    monkeypatch.chdir(tmp_path)
    assert main(run.split()) == 0
    assert main(replay.replace("validation/", f"{ROOT}/validation/").split()) == 0
    folder = re.search(r"failures/(\S+) --run 0", replay)
    assert folder is not None
    shipped = judged.trials[Trial(*folder[1].split("/"))]  # type: ignore[arg-type]
    assert shipped.failed[0]
    assert f" {shipped.status[0]}," in " ".join(capsys.readouterr().out.split())


def test_own_controller_is_undominated_on_all_judged_sets(judged: BenchmarkTable) -> None:
    """If this fails, see what docs/reference/standings.md says of it then."""
    for division, name in [(d, name) for d in DIVISIONS for name in JUDGED_SETS[d] if name in BENCHMARK.sets]:
        ranking = Judged(BENCHMARK, judged, division).ranking(name)
        index = [standing.controller for standing in ranking].index("lqr-offset-free")
        assert undominated(points_of(ranking))[index], (division, name)

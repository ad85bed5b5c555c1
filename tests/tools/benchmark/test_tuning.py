"""Test tuning: cost by hand, equal results for any number of threads, better numbers, stored points."""

import contextlib
import json
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

from cranectl import open_controller
from cranectl.campaign.definition import Batch
from cranectl.campaign.worker import PreparedCampaign, Worker
from cranectl.cli.main import main
from cranectl.planning import load_scenario
from cranectl.support.documents import TOML
from cranectl.support.errors import InputError, MachineError
from cranectl.support.resources import Shipped
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.declared import assignments, variables_of
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.trials import rules_of, trial_campaign
from cranectl.tools.benchmark.tuned import TunedResult
from cranectl.tools.benchmark.tuning import REFUSED, Point, Tuned, run_cost, tune
from tests.benchmark.conftest import close_opened_controllers
from tests.cli.suggestions import execute, suggested_commands
from tests.tools.benchmark.tiny import write_tiny

__all__ = ["close_opened_controllers"]

COMPLETED: dict[str, Any] = {
    "status": "completed", "end_s": 10.0, "rms_error_m": 0.02, "final_error_m": 0.03,
    "residual_sway_about_lean_rad": 0.01, "saturated_s": 0.5, "command_variation_m_s2_bridge": 100.0,
    "command_variation_m_s2_trolley": 60.0, "command_variation_m_s2_rope": 40.0,
}  # fmt: skip


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Benchmark:
    monkeypatch.chdir(tmp_path)
    return write_tiny(tmp_path)


def test_cost_of_a_run() -> None:
    settings = ["duration=10.0", "disturbances=[]", "metrics.settling_tolerance=0.02", "rig.gravity=10.0"]
    scenario = load_scenario("fixed-position", overrides=settings)
    cost = 0.05 / 0.1 + 0.1 + 0.05 + 0.02 * 200.0 / 100.0
    assert run_cost(COMPLETED, scenario, False, 0.02) == pytest.approx(5.0 * cost / (5.0 + cost))
    assert run_cost(COMPLETED, scenario, True, 0.02) == pytest.approx(5.0 + 5.0 * cost / (5.0 + cost))
    moving = {**COMPLETED, "residual_sway_about_lean_rad": None}
    assert run_cost(moving, scenario, False, 0.02) == pytest.approx(5.0 * (cost - 0.1) / (4.9 + cost))
    far = {**COMPLETED, "final_error_m": 1e6}
    assert run_cost(far, scenario, False, 0.02) < 5.0 < run_cost(COMPLETED, scenario, True, 0.02)
    assert run_cost(far, scenario, True, 0.02) < 10.0
    for status in ("workspace-left", "failed"):
        stopped = {**dict.fromkeys(COMPLETED), "status": status, "end_s": 2.5}
        assert run_cost(stopped, scenario, True, 0.02) == 10.75


def test_tuning_improves_controller_and_keeps_all_points(tiny: Benchmark) -> None:
    controller = open_controller("mine.py:MINE")
    runs: list[int] = []
    result = tune(tiny, controller, workers=1, advance=runs.append)
    assert result == tune(tiny, controller, workers=2)
    assert len(result.points) == 20
    assert sum(runs) == 20 * 2 + 3 * 3
    assert result.points[0].values == (1.0, -2.0)
    assert len({point.values for point in result.points}) == 20
    untuned, half, full = result.best_points.values()
    assert untuned == result.points[0]
    assert half.cost == min(point.cost for point in result.points[:10])
    assert full.cost == min(point.cost for point in result.points) < half.cost < 0.9 * untuned.cost
    assert [point.values for point in result.validated.values()] == [p.values for p in (untuned, half, full)]
    assert result.chosen == min(result.validated, key=lambda name: result.validated[name].cost)
    assert tuple(result.parameters.values()) == result.best_points[result.chosen].values
    for variable, values in zip(result.variables, np.array([p.values for p in result.points]).T, strict=True):
        assert np.all((np.abs(values) >= variable.low) & (np.abs(values) <= variable.high))


def test_a_file_that_only_a_benchmark_elsewhere_names_needs_trust(
    tiny: Benchmark, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tiny.file.parent / "elsewhere").mkdir()
    monkeypatch.chdir(tiny.file.parent / "elsewhere")
    assert main(["tune", "mine.py:MINE", "--benchmark", "../tiny.toml", "--runs", "13", "--out", "out"]) == 2
    assert "--trust" in capsys.readouterr().err


def test_written_numbers_give_the_same_cost(tiny: Benchmark, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["tune", "mine.py:MINE", "--benchmark", "tiny.toml", "--out", "out", "--runs", "13"]
    assert main([*command, "--json", "output.json"]) == 0
    assert "controller.mine.stiffness" in capsys.readouterr().out
    written, points = TOML.read(Path("out/mine.toml")), parquet.read_table("out/mine.parquet")
    output = json.loads(Path("output.json").read_text())
    assert output.pop("files") == ["out/mine.toml", "out/mine.parquet"]
    assert written == output
    assert (written["law"], written["benchmark"], written["seed"]) == ("mine", "tiny", 7)
    assert (written["rules"], written["budget_runs"], written["runs"]) == (rules_of(tiny), 12, 12)
    assert len(written["code"]) == 64
    assert points["evaluation"].to_pylist() == list(range(6))
    assert min(points["cost"].to_pylist()) == written["cost"]["full"]
    assert written["chosen"] == min(written["validation"]["cost"], key=written["validation"]["cost"].get)
    chosen = points["cost"].to_pylist().index(written["cost"][written["chosen"]])
    assert {key: points[key][chosen].as_py() for key in written["parameters"]} == written["parameters"]

    settings = assignments(variables_of("mine"), list(written["parameters"].values()))
    tuned_benchmark = tiny.model_copy(update={"set": (*tiny.set, *settings)})
    campaign = trial_campaign(tuned_benchmark, "move", "mine", plant="analytic", runs=3, seed=8, spread=1.0)
    rows = Worker(PreparedCampaign(campaign)).run_batch(Batch("analytic", "mine", 0, 3))
    failures = [float(str(row["final_error_m"])) > 0.2 for row in rows]
    costs = [
        run_cost(row, campaign.nominal, exceeds_limit, 0.02)
        for row, exceeds_limit in zip(rows, failures, strict=True)
    ]
    assert np.mean(costs) == written["validation"]["cost"][written["chosen"]]
    assert np.mean(failures) == written["validation"]["failed"][written["chosen"]]


def test_validation_keeps_published_numbers_that_are_better_on_other_cranes() -> None:
    def chosen(*costs: float) -> str:
        """Return which of three points with these costs in validation is chosen."""
        names = ("untuned", "half", "full")
        points = [Point((float(k),), 3.0 - k, 0.0) for k in range(3)]
        validated = {
            name: point._replace(cost=cost) for name, point, cost in zip(names, points, costs, strict=True)
        }
        result = Tuned("mine", variables_of("pid")[:1], 4, 2, tuple(points), validated)
        assert list(result.parameters.values()) == [float(names.index(result.chosen))]
        return result.chosen

    assert chosen(1.0, 1.1, 1.2) == "untuned"
    assert chosen(1.2, 1.1, 1.2) == "half"
    assert chosen(1.2, 1.1, 1.0) == "full"
    assert chosen(1.0, 1.0, 1.0) == "untuned"


def test_search_without_validation_takes_the_whole_budget(tiny: Benchmark) -> None:
    rules = tiny.tuning.model_copy(update={"validation": None})
    result = tune(tiny.model_copy(update={"tuning": rules}), open_controller("mine.py:MINE"), runs=8)
    assert (result.chosen, result.validated) == ("full", {})


def test_search_runs_on_every_scenario_and_spread_of_its_plant(tiny: Benchmark) -> None:
    rules = tiny.tuning.model_copy(update={"spreads": (0.0, 0.5, 1.0), "plant": "elastic"})
    result = tune(tiny.model_copy(update={"tuning": rules}), open_controller("mine.py:MINE"), runs=12)
    assert result.runs_each == 3 * 2
    campaigns = [
        trial_campaign(tiny, "move", "mine", plant="elastic", runs=2, seed=7, spread=spread)
        for spread in (0.0, 0.5, 1.0)
    ]
    costs = [
        run_cost(row, campaign.nominal, float(str(row["final_error_m"])) > 0.2, 0.02)
        for campaign in campaigns
        for row in Worker(PreparedCampaign(campaign)).run_batch(Batch("elastic", "mine", 0, 2))
    ]
    assert result.points[0].cost == np.mean(costs)


@pytest.mark.usefixtures("tiny")
def test_interrupted_search_goes_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The result has the same bytes, and no candidate of before runs again."""
    command = ["tune", "mine.py:MINE", "--benchmark", "tiny.toml", "--trust", "--workers", "1"]
    assert main([*command, "--out", "whole"]) == 0
    write, written = TunedResult.write_points, []

    def interrupted(*values: Any) -> None:
        write(*values)
        written.append(values)
        if len(written) == 3:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch, contextlib.suppress(KeyboardInterrupt):
        patch.setattr(TunedResult, "write_points", interrupted)
        assert main([*command, "--out", "out"]) != 0
    assert [path.name for path in Path("out").iterdir()] == ["mine.unfinished.parquet"]
    begun = parquet.read_table("out/mine.unfinished.parquet").num_rows
    capsys.readouterr()
    assert main([*command, "--out", "out"]) == 0
    assert f"goes on after {begun} candidates" in capsys.readouterr().out
    for name in ("mine.toml", "mine.parquet"):
        assert Path("out", name).read_bytes() == Path("whole", name).read_bytes()
    assert len(list(Path("out").iterdir())) == 2


@pytest.mark.parametrize("damage", ["another controller", "no Parquet"])
def test_points_of_another_search_are_not_used(tiny: Benchmark, damage: str) -> None:
    path, keys = Path("mine.unfinished.parquet"), ["controller.mine.stiffness"]
    digest = TunedResult.search(open_controller("mine.py:MINE"), rules_of(tiny))
    TunedResult.write_points(path, keys, [Point((1.0,), 2.0, 0.5)], {"search": digest})
    assert TunedResult.read_unfinished(path, digest) == [Point((1.0,), 2.0, 0.5)]
    if damage == "no Parquet":
        path.write_bytes(path.read_bytes()[:40])
    else:
        digest = TunedResult.search(open_controller("mine.py:STIFF"), rules_of(tiny))
    assert TunedResult.read_unfinished(path, digest) == []


@pytest.mark.parametrize("state", ["absent", "of another controller", "by other rules", "damaged"])
@pytest.mark.usefixtures("tiny")
def test_suggested_command_tunes_again(state: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The command quotes the names of the controller's file and of the benchmark."""
    Path("mine.py").rename("my controller.py")
    Path("tiny.toml").rename("the tiny.toml")
    run = "cranectl benchmark run 'the tiny.toml' --controller 'my controller.py:MINE' --division tuned"
    run += " --tuned 'my numbers' --set-of-cranes nominal --out out"
    tune = "cranectl tune 'my controller.py:MINE' --benchmark 'the tiny.toml' --runs 4 --out 'my numbers'"
    if state != "absent":
        assert execute(tune) == 0
        file = Path("my numbers/mine.toml")
        key = {"of another controller": "code", "by other rules": "rules"}.get(state)
        text = file.read_text()
        file.write_text(
            re.sub(f"^{key} = .*", f'{key} = "0"', text, flags=re.M) if key else text.replace("cost", "c")
        )
    capsys.readouterr()
    assert execute(run) == 2
    command = suggested_commands(capsys.readouterr().err)[-1]
    assert execute(f"{command} --runs 4") == 0
    assert execute(run) == 0


def test_refused_numbers_have_the_largest_cost(tiny: Benchmark) -> None:
    points = tune(tiny, open_controller("mine.py:REFUSES")).points
    refused = [point for point in points if point.values[0] > 12.0]
    assert 0 < len(refused) < 20
    assert {(point.cost, point.failed) for point in refused} == {(REFUSED, 1.0)}
    assert all(point.cost < 11.0 for point in points if point not in refused)


def test_controller_that_never_returns_has_the_cost_of_a_stop(tiny: Benchmark) -> None:
    points = tune(tiny, open_controller("mine.py:HANGS"), runs=10, timeout=0.5).points
    hanging = [point for point in points if point.values[0] > 1.0005]
    assert 0 < len(hanging) < len(points) == 5
    assert {(point.cost, point.failed) for point in hanging} == {(11.0, 1.0)}
    assert all(point.cost < 10.0 for point in points if point not in hanging)


@pytest.mark.usefixtures("tiny")
def test_controller_without_variables_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tune", "./mine.py:STIFF", "--benchmark", "tiny.toml", "--out", "out"]) == 0
    assert "stiff has nothing to tune" in capsys.readouterr().out
    written = TOML.read(Path("out/stiff.toml"))
    assert written["parameters"] == {}
    assert written["runs"] == 2
    assert written["chosen"] == "untuned"
    assert len(set(written["cost"].values())) == 1


def test_tuning_errors(tiny: Benchmark, monkeypatch: pytest.MonkeyPatch) -> None:
    controller = open_controller("mine.py:MINE")
    with pytest.raises(InputError, match="a budget of 3 runs") as too_few:
        tune(tiny, controller, runs=3)
    assert "4 runs or more" in str(too_few.value)
    with pytest.raises(InputError, match="'points' follows a set-point, and tiny tunes on no scenario"):
        tune(tiny, open_controller("mine.py:POINTS"))
    refused = tiny.model_copy(update={"set": ("controller.mine.damping=13.0",)})
    with pytest.raises(InputError, match="too much damping"):
        tune(refused, controller)
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(InputError, match="tuning needs pycma") as absent:
        tune(tiny, controller)
    assert "pip install 'cranectl[tune]'" in str(absent.value)


def test_path_that_leaves_the_package_is_not_trusted(tmp_path: Path) -> None:
    write_tiny(tmp_path)
    folder = Shipped.BENCHMARKS.folder
    file = folder / os.path.relpath(tmp_path / "tiny.toml", folder.resolve())
    with pytest.raises(InputError, match="add --trust"):
        measured_controllers(Benchmark.read(str(file)))


def test_machine_errors_are_not_refusals(tiny: Benchmark, monkeypatch: pytest.MonkeyPatch) -> None:
    def exhaust_memory(*_: object) -> None:
        raise MemoryError

    controller = tune(tiny, "pid", runs=10).controller
    monkeypatch.setattr("cranectl.simulate.plan.PlannedReference.plan", exhaust_memory)
    with pytest.raises(MachineError, match="MemoryError"):
        tune(tiny, controller, runs=10)

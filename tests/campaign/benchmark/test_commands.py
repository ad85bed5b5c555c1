"""Test `cranectl benchmark`: from a file to a page, repeated runs, results of others."""

import json
import re
import shutil
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cranectl.campaign.benchmark.table import read_table
from cranectl.cli.benchmark import _table_place
from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from cranectl.support.documents import leaves
from cranectl.support.resources import BENCHMARK_DIRECTORY
from tests.campaign.benchmark.conftest import SHORT
from tests.cli.suggestions import commands_of_page, execute
from tests.conftest import ROOT

if TYPE_CHECKING:
    from distributed import LocalCluster


def titles_of(page: Path) -> list[str]:
    return re.findall("<h2>(.*?)</h2>", page.read_text(encoding="utf-8"))


def test_commands_on_the_page_run(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every crane fails, so the page suggests to replay runs; a controller from a file needs its file."""
    small.with_name("short.toml").write_text(SHORT.replace("0.05", "0.0"))
    (tmp_path / "some where").mkdir()
    monkeypatch.chdir(tmp_path / "some where")
    selection = ["--set-of-cranes", "nominal", "--scenario", "short"]
    assert main(["benchmark", "run", "../small.toml", "--trust", "--out", "the out", *selection]) == 0
    close_controllers()
    report = ["benchmark", "report", "the out", "--benchmark", "../small.toml", "--trust"]
    assert main([*report, "--out", "the page.html"]) == 0
    *replays, report_again = commands_of_page(Path("the page.html"))
    assert len(replays) == 2
    assert "--controller ../servo.py:SERVO" in replays[1]
    for command in (*replays, report_again):
        assert execute(command) == 0, command
    assert main([*report, "--out", "the page.html", "--table", "all.parquet"]) == 0
    table = ["benchmark", "report", "all.parquet", "--benchmark", "../small.toml"]
    assert main([*table, "--out", "page of table.html"]) == 0
    *replays, report_again = commands_of_page(Path("page of table.html"))
    assert [command.count(" && ") for command in replays] == [1, 1], "without results the trial runs again"
    for command in replays:
        assert [execute(part) for part in command.split(" && ")] == [0, 0], command


def test_tuning_an_unknown_controller_touches_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The name is checked before the files, which would be outside of --out for this name."""
    monkeypatch.setattr(
        "cranectl.campaign.benchmark.tuned.check_place", lambda *_, **__: pytest.fail("files are checked")
    )
    assert main(["tune", f"{tmp_path}/", "--out", str(tmp_path)]) == 2
    assert "unknown controller" in capsys.readouterr().err


def test_benchmark_runs_from_file_to_page(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, page, table = (small.with_name(name) for name in ("out", "page.html", "all.parquet"))
    run = ["benchmark", "run", str(small), "--trust", "--out", str(out), "--workers", "2"]
    assert main(run) == 0
    parts = {path: path.read_bytes() for path in out.rglob("*.parquet")}
    assert len(parts) == 2 * 2 * 3 + 2 * 2 + 2 * 2
    missing, damaged, *_ = parts
    missing.unlink()
    damaged.write_bytes(parts[damaged][:-100])
    capsys.readouterr()
    assert main([*run, "--workers", "1"]) == 0, "the command continues with missing parts"
    output = " ".join(capsys.readouterr().err.split())
    assert f"{damaged.parent.parent.relative_to(out)}: {damaged.name} was damaged" in output
    assert {path: path.read_bytes() for path in out.rglob("*.parquet")} == parts, (
        "results do not depend on the number of workers"
    )

    written = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    assert main(run) == 0
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == written, (
        "complete results are not written again"
    )

    report = ["benchmark", "report", str(out), "--benchmark", str(small), "--trust", "--out", str(page)]
    capsys.readouterr()
    assert main([*report, "--table", str(table), "--json", "-"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert output["laws"]["servo"] == {
        "follows": "set-point",
        "measures": "state",
        "commands": "acceleration",
        "preview": 0,
        "reads_path": False,
        "every": 1,
        "rig": ["gravity"],
        "file": output["laws"]["servo"]["file"],
    }
    assert len(output["laws"]["servo"]["file"]) >= 12
    assert [row["runs"] for row in output["divisions"]["published"]["wide"]] == [6, 6]
    assert titles_of(page) == [
        "As published (defaults): failures and settling",
        "What came out",
        "Read this before the tables",
        "Undominated controllers",
        "Rules and information",
        *(
            f"As published (defaults): {name}"
            for name in ("nominal", "wide", "radius", "single effects", "on analytic")
        ),
        "Digests and versions",
    ]
    assert "set points" in page.read_text(encoding="utf-8")

    # The written table agrees with the results to four digits.
    written = read_table(table)
    assert len(written.trials) == len(parts)
    other_page = small.with_name("other.html")
    own = ["benchmark", "report", str(out), "--benchmark", str(small), "--controller", "lqr-integral"]
    assert main([*own, "--beside", str(table), "--out", str(other_page)]) == 0
    assert "servo" in other_page.read_text(encoding="utf-8")

    # The table alone gives the same page, without the code of any controller.
    close_controllers()
    capsys.readouterr()
    assert main(["benchmark", "report", str(table), "--benchmark", str(small), "--json", "-"]) == 0
    from_table = json.loads(capsys.readouterr().out)
    assert from_table["laws"] == output["laws"]
    for name, standings in output["divisions"]["published"].items():
        for row, same in zip(standings, from_table["divisions"]["published"][name], strict=True):
            assert same.pop("law") == row.pop("law")
            assert same == pytest.approx(row, rel=1e-3)
    assert titles_of(table.with_suffix(".html")) == titles_of(page)
    assert main(["benchmark", "report", str(table), "--benchmark", str(small), "--controller", "pid"]) == 2
    assert "unknown controller of the table 'pid'" in capsys.readouterr().err
    for runs in written.trials.values():
        assert np.isfinite(runs.metrics["rms_error_m"]).all()


def test_cluster_gives_the_same_results(small: Path, cluster: "LocalCluster") -> None:
    run = ["benchmark", "run", str(small), "--trust", "--set-of-cranes", "nominal", "--draws", "1"]
    here, there = small.with_name("here"), small.with_name("there")
    assert main([*run, "--scheduler", cluster.scheduler_address, "--out", str(there)]) == 0
    assert main([*run, "--out", str(here)]) == 0
    parts = {path.relative_to(here): path.read_bytes() for path in here.rglob("*.parquet")}
    assert len(parts) == 2 * 3
    assert {path.relative_to(there): path.read_bytes() for path in there.rglob("*.parquet")} == parts


def test_table_with_other_rules_is_refused(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, table = small.with_name("out"), small.with_name("all.parquet")
    controller = ["--controller", "lqr-integral"]
    run = ["benchmark", "run", str(small), *controller, "--set-of-cranes", "nominal", "--out", str(out)]
    report = ["benchmark", "report", str(out), "--benchmark", str(small), *controller]
    assert main(run) == 0
    assert main([*report, "--table", str(table)]) == 0
    small.write_text(small.read_text().replace("draws = 6", "draws = 7"))
    assert main([*report, "--beside", str(table)]) == 2
    assert "results whose rules differ" in capsys.readouterr().err
    assert main(["benchmark", "report", str(table), "--benchmark", str(small)]) == 2
    assert "results whose rules differ" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("file", "before", "after", "phrase"),
    [
        ("small.toml", "seed = 3", "seed = 4", "seed is 3, not 4"),
        ("small.toml", "high = 2.0", "high = 3.0", "rig.load_mass"),
        ("short.toml", "to = [0.6", "to = [0.7", "reference"),
        ("servo.py", 'damper on each drive",', 'damper, on each drive",', "servo has changed"),
    ],
)
def test_results_of_another_benchmark_are_refused(
    small: Path, file: str, before: str, after: str, phrase: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = small.with_name("out")
    controller = ["--controller", f"{small.with_name('servo.py')}:SERVO"]
    restricted = ["--set-of-cranes", "wide", "--scenario", "short", "--draws", "2"]
    report = ["benchmark", "report", str(out), "--benchmark", str(small), *controller]
    assert main(["benchmark", "run", str(small), *controller, *restricted, "--out", str(out)]) == 0
    assert main(report) == 0, "the first cranes of the set are enough"
    page = out.with_suffix(".html").read_text(encoding="utf-8")
    assert "no runs of lqr-integral are here" in page, "the baseline has no runs"
    text = small.with_name(file).read_text()
    assert before in text
    small.with_name(file).write_text(text.replace(before, after))
    close_controllers()
    assert main(report) == 2
    error = capsys.readouterr().err
    assert "was not run by this benchmark" in error
    assert phrase in error


def test_results_of_other_software_are_not_continued(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A changed controller is other software. Limits only judge runs, so they may change."""
    file, out = small.with_name("servo.py"), small.with_name("out")
    run = ["benchmark", "run", str(small), "--controller", f"{file}:SERVO", "--set-of-cranes", "nominal"]
    run += ["--out", str(out)]
    manifest = out / "published" / "mujoco" / "nominal" / "short" / "servo" / "campaign.json"
    assert main(run) == 0
    scenario = small.with_name("short.toml")
    scenario.write_text(scenario.read_text().replace("final_error_m = 0.05", "final_error_m = 0.06"))
    assert main(run) == 0
    assert json.loads(manifest.read_text())["campaign"]["limits"]["final_error_m"] == 0.06
    file.write_text(file.read_text().replace('damper on each drive",', 'damper, on each drive",'))
    close_controllers()
    assert main(run) == 2
    assert "was made by other software" in capsys.readouterr().err
    assert main([*run, "--despite-differences"]) == 0
    assert len(json.loads(manifest.read_text())["accepted"]) == 1


def test_code_of_a_benchmark_runs_only_with_trust(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["benchmark", "run", str(small), "--out", str(small.with_name("out"))]) == 2
    assert "no file runs code by itself" in capsys.readouterr().err
    assert main(["benchmark", "report", str(small.parent), "--benchmark", str(small), "--trust"]) == 2
    assert "holds no finished result" in capsys.readouterr().err


def test_unknown_names_and_empty_selections_are_reported(
    small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = small.with_name("out")
    selection = ["--set-of-cranes", "nominal", "--scenario", "short"]
    run = ["benchmark", "run", str(small), "--out", str(out)]
    assert main([*run, *selection, "--controller", "nobody"]) == 2
    assert "unknown controller 'nobody'" in capsys.readouterr().err
    assert main(["benchmark", "report", str(out), "--benchmark", str(small), "--controller", "nobody"]) == 2
    assert "unknown controller 'nobody'" in capsys.readouterr().err
    assert main([*run, "--set-of-cranes", "spread-3", "--scenario", "path", "--controller", "pid"]) == 2
    assert "none of the sets of cranes has a scenario" in capsys.readouterr().err


def test_other_controllers_run_if_one_refuses_the_crane(
    small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = small.with_name("servo.py")
    file.write_text(
        file.read_text().replace("def prepare(nominal):", "def prepare(nominal):\n    raise InputError('no')")
    )
    out = small.with_name("out")
    run = ["benchmark", "run", str(small), "--trust", "--set-of-cranes", "nominal", "--out", str(out)]
    assert main(run) == 3
    assert "could not be run: servo on short: no" in capsys.readouterr().out
    with_results = {path.parent.name for path in out.rglob("campaign.json")}
    assert with_results == {"lqr-integral"}, "the refused controller leaves no files"


def test_tuned_controllers_run_with_tuned_numbers(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    servo = ["--controller", f"{small.with_name('servo.py')}:SERVO"]
    tuned, out = small.with_name("tuned"), small.with_name("out")
    run = ["benchmark", "run", str(small), *servo, "--set-of-cranes", "nominal", "--out", str(out)]
    assert main([*run, "--division", "tuned"]) == 2
    assert "servo is not tuned" in capsys.readouterr().err
    assert main(["tune", servo[1], "--benchmark", str(small), "--out", str(tuned)]) == 0
    assert main([*run, "--division", "tuned"]) == 0
    tuned_numbers = tomllib.loads((tuned / "servo.toml").read_text())
    assert tuned_numbers["cost"]["full"] < tuned_numbers["cost"]["untuned"]
    assert tuned_numbers["chosen"] != "untuned"
    manifest = json.loads(
        (out / "tuned" / "mujoco" / "nominal" / "short" / "servo" / "campaign.json").read_text()
    )
    expected = {key.rpartition(".")[2]: value for key, value in leaves(tuned_numbers["parameters"])}
    assert manifest["scenario"]["controller"]["servo"] == expected

    # The page has both divisions and the results of tuning, also if it is made from the table alone.
    assert main(run) == 0
    table, page = small.with_name("all.parquet"), small.with_name("out.html")
    report = ["benchmark", "report", str(out), "--benchmark", str(small), *servo, "--json", "-"]
    capsys.readouterr()
    assert main([*report, "--table", str(table)]) == 0
    output = json.loads(capsys.readouterr().out)
    facts = output["tuned"]["servo"]
    assert (
        facts.items()
        >= {name: tuned_numbers[name] for name in ("cost", "failed", "chosen", "validation", "runs")}.items()
    )
    assert {key: number for key, (_, number) in facts["numbers"].items()} == tuned_numbers["parameters"]
    assert facts["numbers"]["controller.servo.damping"][0] == 4.0
    assert list(output["divisions"]) == ["tuned", "published"]
    titles = titles_of(page)
    expected = ["Tuning", "Tuned: nominal", "Tuned: on analytic", "As published (defaults): nominal"]
    assert [title for title in titles if title in expected] == expected
    assert main(["benchmark", "report", str(table), "--benchmark", str(small)]) == 0
    assert titles_of(table.with_suffix(".html")) == titles
    numbers = tuned / "servo.toml"
    original = numbers.read_text()
    numbers.write_text(re.sub('(damping" =) .*', r"\1 5.0", original))
    assert main(report) == 2
    assert "was run with other numbers" in capsys.readouterr().err
    numbers.write_text(re.sub(".*damping.*", "", original))
    assert main(report) == 2
    assert "another version of servo" in capsys.readouterr().err
    numbers.write_text(original.replace("[cost]", "[costs]"))
    assert main(report) == 2
    assert "servo.toml is damaged: KeyError 'cost'" in capsys.readouterr().err
    numbers.write_text(original)

    text = small.read_text()
    small.write_text(text.replace("variation_price = 0.02", "variation_price = 0.03"))
    assert main([*run, "--division", "tuned"]) == 2
    assert "found by the rules" in capsys.readouterr().err
    small.write_text(text)

    # Another controller of the same name does not run with these numbers.
    file = small.with_name("servo.py")
    file.write_text(file.read_text().replace('damper on each drive",', 'damper, on each drive",'))
    close_controllers()
    assert main([*run, "--division", "tuned"]) == 2
    assert "another version of servo" in capsys.readouterr().err


def test_judged_table_is_found_by_name_in_a_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The name works as in the how-to. A file of that name takes precedence."""
    monkeypatch.chdir(tmp_path)
    restricted = ["--set-of-cranes", "nominal", "--scenario", "pulse", "--draws", "1"]
    assert main(["benchmark", "run", "--controller", "pid", *restricted, "--out", "mine"]) == 0
    report = ["benchmark", "report", "mine", "--controller", "pid", "--beside", "literature.parquet"]
    assert main(report) == 0
    assert "super-twisting" in (tmp_path / "mine.html").read_text(encoding="utf-8")
    (tmp_path / "literature.parquet").write_text("")
    assert main(report) == 2
    assert "literature.parquet holds no benchmark" in capsys.readouterr().err


def test_error_tells_where_the_judged_table_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An installed package has no judged table. A copy from a checkout works by its path."""
    installed = tmp_path / "installed"
    installed.mkdir()
    shutil.copy(BENCHMARK_DIRECTORY / "literature.toml", installed)
    monkeypatch.setattr("cranectl.cli.benchmark.BENCHMARK_DIRECTORY", installed)
    monkeypatch.chdir(tmp_path)
    assert main(["benchmark", "report", "literature.parquet"]) == 2
    message = capsys.readouterr().err
    assert "the judged table literature.parquet is in cranectl's repository" in " ".join(message.split())
    (table,) = re.findall(r"copy (\S+) from a checkout", " ".join(message.split()))
    shutil.copy(ROOT / table, "copy.parquet")
    assert main(["benchmark", "report", "copy.parquet", "--controller", "pid", "--out", "page.html"]) == 0


@pytest.mark.parametrize("path", ["", ".", "/", ".."])
def test_path_without_a_name_is_not_the_judged_table(path: str) -> None:
    """Reading it raises the error; finding it must not raise an internal error."""
    assert _table_place(Path(path)) == Path(path)

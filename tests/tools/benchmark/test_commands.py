"""Test `cranectl benchmark`: from a file to a page, repeated runs, results of others."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from cranectl.support.documents import TOML
from cranectl.support.resources import Shipped
from cranectl.support.trees import Tree
from cranectl.tools.benchmark.commands.benchmark import _table_place
from cranectl.tools.benchmark.table import BenchmarkTable
from tests.cli.suggestions import commands_of_page, execute
from tests.conftest import ROOT
from tests.tools.benchmark.conftest import SHORT

if TYPE_CHECKING:
    from distributed import LocalCluster

RUN = "cranectl benchmark run small.toml --out out"
REPORT = "cranectl benchmark report out --benchmark small.toml"
REPORT_TABLE = "cranectl benchmark report all.parquet --benchmark small.toml"
NOMINAL = "--set-of-cranes nominal"
SERVO = "--controller servo.py:SERVO"  # the command names it, so --trust is not needed


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[[str], str]:
    """Return a function that executes a command which is refused, and returns its error on one line."""

    def refused(command: str) -> str:
        capsys.readouterr()
        assert execute(command) == 2
        return " ".join(capsys.readouterr().err.split())

    return refused


@pytest.fixture
def output(capsys: pytest.CaptureFixture[str]) -> Callable[[str], Any]:
    """Return a function that executes a command and returns its output, JSON as plain data."""

    def output(command: str) -> Any:
        capsys.readouterr()
        assert execute(command) == 0
        captured = capsys.readouterr()
        return json.loads(captured.out) if "--json -" in command else " ".join(captured.err.split())

    return output


Refused, Output = Callable[[str], str], Callable[[str], Any]


def change(file: str, before: str, after: str) -> None:
    text = Path(file).read_text()
    assert before in text
    Path(file).write_text(text.replace(before, after))


def change_controller() -> None:
    """Change the digest of the controller in a file, not its numbers."""
    change("servo.py", 'damper on each drive",', 'damper, on each drive",')


def parts_in(folder: str) -> dict[Path, bytes]:
    return {path.relative_to(folder): path.read_bytes() for path in Path(folder).rglob("*.parquet")}


def titles_of(page: str) -> list[str]:
    return re.findall("<h2>(.*?)</h2>", Path(page).read_text(encoding="utf-8"))


@pytest.mark.usefixtures("small")
def test_commands_on_the_page_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every crane fails, so the page suggests to replay runs; a controller from a file needs its file."""
    Path("short.toml").write_text(SHORT.replace("0.05", "0.0"))
    Path("some where").mkdir()
    monkeypatch.chdir("some where")
    run, report = "cranectl benchmark run ../small.toml --trust", "--benchmark ../small.toml"
    assert execute(f"{run} --out 'the out' {NOMINAL} --scenario short") == 0
    report_results = f"cranectl benchmark report 'the out' {report} --trust --out 'the page.html'"
    assert execute(report_results) == 0
    *replays, report_again = commands_of_page(Path("the page.html"))
    assert len(replays) == 2
    assert "--controller ../servo.py:SERVO" in replays[1]
    for command in (*replays, report_again):
        assert execute(command) == 0, command
    assert execute(f"{report_results} --table all.parquet") == 0
    assert execute(f"cranectl benchmark report all.parquet {report} --out 'page of table.html'") == 0
    *replays, report_again = commands_of_page(Path("page of table.html"))
    assert [command.count(" && ") for command in replays] == [1, 1], "without results the trial runs again"
    for command in replays:
        assert [execute(part) for part in command.split(" && ")] == [0, 0], command


def test_tuning_an_unknown_controller_touches_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    """The name is checked before the files, which would be outside of --out for this name."""
    monkeypatch.setattr(
        "cranectl.support.file_kinds.FileKind.check_place", lambda *_, **__: pytest.fail("files are checked")
    )
    assert "unknown controller" in refused(f"cranectl tune {tmp_path}/ --out {tmp_path}")


@pytest.mark.usefixtures("small")
def test_benchmark_runs_from_file_to_page(output: Output, refused: Refused) -> None:
    run = f"{RUN} --trust --workers 2"
    assert execute(run) == 0
    parts = parts_in("out")
    assert len(parts) == 2 * 2 * 3 + 2 * 2 + 2 * 2
    missing, damaged, *_ = parts
    Path("out", missing).unlink()
    Path("out", damaged).write_bytes(parts[damaged][:-100])
    again = output(f"{RUN} --trust --workers 1")
    assert f"{damaged.parent.parent}: {damaged.name} was damaged" in again
    assert parts_in("out") == parts, "results do not depend on the number of workers"
    written = {path: path.stat().st_mtime_ns for path in Path("out").rglob("*")}
    assert execute(run) == 0
    assert {path: path.stat().st_mtime_ns for path in Path("out").rglob("*")} == written, (
        "complete results are not written again"
    )

    found = output(f"{REPORT} --trust --out page.html --table all.parquet --json -")
    file = found["laws"]["servo"].pop("file")
    assert len(file) >= 12
    assert found["laws"]["servo"] == {
        "follows": "set-point", "measures": "state", "commands": "acceleration", "preview": 0,
        "reads_path": False, "every": 1, "rig": ["gravity"],
    }  # fmt: skip
    assert [row["runs"] for row in found["divisions"]["published"]["wide"]] == [6, 6]
    sets = ("nominal", "wide", "radius", "single effects", "on analytic")
    assert titles_of("page.html") == [
        "As published (defaults): failures and settling",
        "What came out",
        "Read this before the tables",
        "Undominated controllers",
        "Rules and information",
        *(f"As published (defaults): {name}" for name in sets),
        "Digests and versions",
    ]
    assert "set points" in Path("page.html").read_text(encoding="utf-8")

    table = BenchmarkTable.read(Path("all.parquet"))
    assert len(table.trials) == len(parts)
    assert all(np.isfinite(runs.metrics["rms_error_m"]).all() for runs in table.trials.values())
    assert execute(f"{REPORT} --controller lqr-integral --beside all.parquet --out other.html") == 0
    assert "servo" in Path("other.html").read_text(encoding="utf-8")

    # The table alone gives the same page to four digits, without the code of any controller.
    from_table = output(f"{REPORT_TABLE} --json -")
    assert from_table["laws"]["servo"].pop("file") == file
    assert from_table["laws"] == found["laws"]
    for name, standings in found["divisions"]["published"].items():
        for row, same in zip(standings, from_table["divisions"]["published"][name], strict=True):
            assert same.pop("law") == row.pop("law")
            assert same == pytest.approx(row, rel=1e-3)
    assert titles_of("all.html") == titles_of("page.html")
    assert "unknown controller of the table 'pid'" in refused(f"{REPORT_TABLE} --controller pid")


@pytest.mark.usefixtures("small")
def test_cluster_gives_the_same_results(cluster: "LocalCluster") -> None:
    run = f"cranectl benchmark run small.toml --trust {NOMINAL} --draws 1"
    assert execute(f"{run} --scheduler {cluster.scheduler_address} --out there") == 0
    assert execute(f"{run} --out here") == 0
    assert len(parts_in("here")) == 2 * 3
    assert parts_in("there") == parts_in("here")


@pytest.mark.usefixtures("small")
def test_table_with_other_rules_is_refused(refused: Refused) -> None:
    controller = "--controller lqr-integral"
    assert execute(f"{RUN} {controller} {NOMINAL}") == 0
    assert execute(f"{REPORT} {controller} --table all.parquet") == 0
    change("small.toml", "draws = 6", "draws = 7")
    for report in (f"{REPORT} {controller} --beside all.parquet", REPORT_TABLE):
        assert "results whose rules differ" in refused(report)


@pytest.mark.parametrize(
    ("file", "before", "after", "phrase"),
    [
        ("small.toml", "seed = 3", "seed = 4", "seed is 3, not 4"),
        ("small.toml", "high = 2.0", "high = 3.0", "rig.load_mass"),
        ("short.toml", "to = [0.6", "to = [0.7", "reference"),
        ("servo.py", 'damper on each drive",', 'damper, on each drive",', "servo has changed"),
    ],
)
@pytest.mark.usefixtures("small")
def test_results_of_another_benchmark_are_refused(
    file: str, before: str, after: str, phrase: str, refused: Refused
) -> None:
    assert execute(f"{RUN} {SERVO} --set-of-cranes wide --scenario short --draws 2") == 0
    assert execute(f"{REPORT} {SERVO}") == 0, "the first cranes of the set are enough"
    page = Path("out.html").read_text(encoding="utf-8")
    assert "no runs of lqr-integral are here" in page, "the baseline has no runs"
    change(file, before, after)
    error = refused(f"{REPORT} {SERVO}")
    assert "was not run by this benchmark" in error
    assert phrase in error


@pytest.mark.usefixtures("small")
def test_results_of_other_software_are_not_continued(refused: Refused) -> None:
    """A changed controller is other software. Limits only judge runs, so they may change."""
    run, manifest = f"{RUN} {SERVO} {NOMINAL}", Path("out/published/mujoco/nominal/short/servo/campaign.json")
    assert execute(run) == 0
    change("short.toml", "final_error_m=0.05", "final_error_m=0.06")
    assert execute(run) == 0
    assert json.loads(manifest.read_text())["campaign"]["limits"]["final_error_m"] == 0.06
    change_controller()
    assert "was made by other software" in refused(run)
    assert execute(f"{run} --despite-differences") == 0
    assert len(json.loads(manifest.read_text())["accepted"]) == 1


@pytest.mark.parametrize(
    ("command", "phrase"),
    [
        (RUN, "no file runs code by itself"),
        ("cranectl benchmark report . --benchmark small.toml --trust", "holds no finished result"),
        (f"{RUN} {NOMINAL} --scenario short --controller nobody", "unknown controller 'nobody'"),
        (f"{REPORT} --controller nobody", "unknown controller 'nobody'"),
        (
            f"{RUN} --set-of-cranes spread-3 --scenario path --controller pid",
            "none of the sets of cranes has a scenario",
        ),
    ],
)
@pytest.mark.usefixtures("small")
def test_untrusted_code_unknown_names_and_empty_selections_are_refused(
    command: str, phrase: str, refused: Refused
) -> None:
    assert phrase in refused(command)


@pytest.mark.usefixtures("small")
def test_other_controllers_run_if_one_refuses_the_crane(capsys: pytest.CaptureFixture[str]) -> None:
    change("servo.py", "def prepare(nominal):", "def prepare(nominal):\n    raise InputError('no')")
    assert execute(f"{RUN} --trust {NOMINAL}") == 3
    assert "could not be run: servo on short: no" in capsys.readouterr().out
    with_results = {path.parent.name for path in Path("out").rglob("campaign.json")}
    assert with_results == {"lqr-integral"}, "the refused controller leaves no files"


@pytest.mark.usefixtures("small")
def test_tuned_controllers_run_with_tuned_numbers(output: Output, refused: Refused) -> None:
    run = f"{RUN} {SERVO} {NOMINAL}"
    assert "servo is not tuned" in refused(f"{run} --division tuned")
    assert execute("cranectl tune ./servo.py:SERVO --benchmark small.toml --out tuned") == 0
    assert execute(f"{run} --division tuned") == 0
    file = Path("tuned/servo.toml")
    numbers = TOML.read(file)
    assert numbers["cost"]["full"] < numbers["cost"]["untuned"]
    assert numbers["chosen"] != "untuned"
    manifest = json.loads(Path("out/tuned/mujoco/nominal/short/servo/campaign.json").read_text())
    expected = {key.rpartition(".")[2]: value for key, value in Tree(numbers["parameters"]).leaves()}
    assert manifest["scenario"]["controller"]["servo"] == expected

    # The page has both divisions and the results of tuning, also if it is made from the table alone.
    assert execute(run) == 0
    report = f"{REPORT} {SERVO}"
    found = output(f"{report} --json - --table all.parquet")
    facts = found["tuned"]["servo"]
    assert (
        facts.items()
        >= {name: numbers[name] for name in ("cost", "failed", "chosen", "validation", "runs")}.items()
    )
    assert {key: number for key, (_, number) in facts["numbers"].items()} == numbers["parameters"]
    assert facts["numbers"]["controller.servo.damping"][0] == 4.0
    assert list(found["divisions"]) == ["tuned", "published"]
    expected_titles = ["Tuning", "Tuned: nominal", "Tuned: on analytic", "As published (defaults): nominal"]
    assert [title for title in titles_of("out.html") if title in expected_titles] == expected_titles
    assert execute(REPORT_TABLE) == 0
    assert titles_of("all.html") == titles_of("out.html")

    original = file.read_text()
    for changed, phrase in (
        (re.sub('(damping" =) .*', r"\1 5.0", original), "was run with other numbers"),
        (re.sub(".*damping.*", "", original), "another version of servo"),
        (original.replace("[cost]", "[costs]"), "servo.toml is damaged: KeyError 'cost'"),
    ):
        file.write_text(changed)
        assert phrase in refused(report)
    file.write_text(original)
    change("small.toml", "variation_price = 0.02", "variation_price = 0.03")
    assert "found by the rules" in refused(f"{run} --division tuned")
    change("small.toml", "variation_price = 0.03", "variation_price = 0.02")
    change_controller()  # another controller of the same name
    assert "another version of servo" in refused(f"{run} --division tuned")


@pytest.mark.usefixtures("in_empty_directory")
def test_judged_table_is_found_by_name_in_a_checkout(refused: Refused) -> None:
    """The name works as in the how-to. A file of that name takes precedence."""
    run = f"cranectl benchmark run --controller pid {NOMINAL} --scenario pulse --draws 1 --out mine"
    report = "cranectl benchmark report mine --controller pid --beside literature.parquet"
    assert execute(run) == 0
    assert execute(report) == 0
    assert "super-twisting" in Path("mine.html").read_text(encoding="utf-8")
    Path("literature.parquet").write_text("")
    assert "literature.parquet holds no benchmark" in refused(report)


@pytest.mark.usefixtures("in_empty_directory")
def test_error_tells_where_the_judged_table_is(monkeypatch: pytest.MonkeyPatch, refused: Refused) -> None:
    """An installed package has no judged table. A copy from a checkout works by its path."""
    installed = Path("installed").resolve()
    left_out = shutil.ignore_patterns("literature.parquet", "__pycache__")
    shutil.copytree(Shipped.BENCHMARKS.folder, installed, ignore=left_out)
    monkeypatch.setattr(Shipped, "BENCHMARKS", Shipped("benchmark", installed))
    message = refused("cranectl benchmark report literature.parquet")
    assert "the judged table literature.parquet is in cranectl's repository" in message
    (table,) = re.findall(r"copy (\S+) from a checkout", message)
    shutil.copy(ROOT / table, "copy.parquet")
    assert execute("cranectl benchmark report copy.parquet --controller pid --out page.html") == 0


@pytest.mark.parametrize("path", ["", ".", "/", ".."])
def test_path_without_a_name_is_not_the_judged_table(path: str) -> None:
    """Reading it raises the error; finding it must not raise an internal error."""
    assert _table_place(Path(path)) == Path(path)

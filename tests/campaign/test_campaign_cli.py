"""Test `cranectl campaign` as users do: run, interrupt, resume, replay, and wrong input."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from cranectl.campaign import CampaignSettings
from cranectl.campaign.results import read_results
from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.metrics import run_metrics
from cranectl.status import RunStatus
from tests.campaign.conftest import SMALL
from tests.campaign.results import parts_of
from tests.pace import HANG

Refused = Callable[..., str]
pytestmark = pytest.mark.usefixtures("in_directory_with_campaign")
ANNOUNCED = """\
import sys
from cranectl.campaign.results import Store
write = Store.write
def announced(self, batch, rows):
    write(self, batch, rows)
    print("written", flush=True)
    sys.stdin.readline()  # until it is ended
Store.write = announced
from cranectl.cli.main import main
sys.exit(main(["campaign", "run", "small.toml", "--out", "cut"]))
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_run_cut_short_is_resumed_to_the_same_table(
    finished: Path, number: signal.Signals, refused: Refused
) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", ANNOUNCED],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "written\n"
    resume = ["run", "small.toml", "--out", "cut", "--resume"]
    assert "another process is writing cut" in refused(*resume)
    process.send_signal(number)
    out, error = process.communicate(timeout=HANG)
    assert "Traceback" not in error
    assert process.returncode == (-number if number == signal.SIGKILL else 130)
    hint = "of 320 runs are kept; go on with: cranectl campaign run small.toml --out cut --resume"
    assert (hint in out) == (number != signal.SIGKILL)
    before = len(read_results("cut", unfinished=True))
    assert 0 < before < 320
    assert "is not finished" in refused("report", "cut")
    assert main(["campaign", *resume]) == 0
    assert read_results("cut").table.equals(read_results(finished).table, check_metadata=True)
    assert parts_of("cut") == parts_of(finished)


def test_neither_workers_nor_a_directory_whose_name_is_no_utf_8_change_a_byte(finished: Path) -> None:
    name = os.fsdecode(b"\xff")
    assert main(["campaign", "run", "small.toml", "--workers", "3", "--out", name]) == 0
    assert parts_of(name) == parts_of(finished)


def test_a_finished_result_is_judged_by_other_limits_without_running(
    finished: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(finished, "mine")

    def nothing_is_run(*_arguments: object, **_named: object) -> None:
        raise AssertionError

    monkeypatch.setattr("cranectl.campaign.workers.run_batches", nothing_is_run)
    limit = ["--set", "limits.max_error_m=0.5", "--resume", "--out", "mine", "--json", "-"]
    assert main(["campaign", "run", "small.toml", *limit]) == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert (summary["finished"], summary["runs"], summary["missing"]) == (True, 320, 0)
    lqr, poles = summary["groups"]
    assert (lqr["controller"], poles["controller"]) == ("lqr", "pole-placement")
    results = read_results("mine")
    beyond = int((results.column("max_error_m")[:160] > 0.5).sum())
    assert 0 < beyond == lqr["failures"] == lqr["broken"]["max_error_m"]
    assert "small on analytic" in captured.err
    assert f"{lqr['median_max_error_m']:.4f}" in captured.err


def test_replayed_runs_are_the_same_to_the_bit(finished: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["replay", str(finished), "--worst", "2", "--every", "1", "--out", "again", "--json", "-"]
    assert main(["campaign", *command]) == 0
    replays = json.loads(capsys.readouterr().out)["replays"]
    results = read_results(finished)
    errors = results.column("max_error_m")
    worst = (-errors).argsort(kind="stable")[:2]
    assert [replay["sample"] for replay in replays] == results.column("sample")[worst].tolist()
    for replay, row in zip(replays, worst.tolist(), strict=True):
        (run,) = read_log(replay["log"]).values()
        metrics = run_metrics(run)
        assert metrics is not None
        assert metrics.max_error_m == errors[row]
        values = [results.column(name)[row] for name in results.campaign.names]
        assert [run.scenario.rig.winch_time_constant, run.scenario.disturbances[0].magnitude] == values


def test_failures_of_the_crane_are_results(capsys: pytest.CaptureFixture[str]) -> None:
    """A disturbance swings the load to angles that are not defined."""
    hard = ["--set", "uncertain.disturbances.0.magnitude.low=200.0"]
    hard += ["--set", "uncertain.disturbances.0.magnitude.high=300.0", "--runs", "3", "--controllers", "lqr"]
    assert main(["campaign", "run", "small.toml", *hard, "--json", "found.json"]) == 0
    (group,) = json.loads(Path("found.json").read_text())["groups"]
    assert group["failures"] == sum(group["stopped"].values()) == 3
    reasons = set(read_results("logs/campaign-small").column("reason"))
    assert reasons <= {status.explanation for status in RunStatus if status.stopped}
    assert "failed" in capsys.readouterr().out


def test_list_and_show(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["campaign", "list", "--json", "-"]) == 0
    listed = json.loads(capsys.readouterr().out)["campaigns"]
    assert [entry["name"] for entry in listed] == CampaignSettings.shipped_names()
    assert main(["campaign", "show", "small.toml", "--runs", "50", "--json", "-"]) == 0
    captured = capsys.readouterr()
    shown = json.loads(captured.out)
    assert (shown["samples"], shown["runs"]) == (50, 100)
    assert shown["parameters"][0]["unit"] == "s"
    assert 0.01 < shown["parameters"][0]["quantiles"]["0.05"] < 0.012
    assert 0.0 < shown["estimated_s"] < 100.0
    assert "time: about" in captured.err
    assert main(["campaign", "show", "lab-rig", "--no-estimate"]) == 0
    assert "time:" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run", "small.toml", "--controller", "lqr,"], "a name is empty"),
        (["run", "small.toml", "--set", "duraton=1"], "unknown key 'duraton'"),
        (["run", "small.toml", "--workers", "0"], "--workers 0"),
        (["run", "small.toml", "--resume", "--overwrite"], "exclude each other"),
        (["run", "small.toml", "--despite-differences"], "--despite-differences without --resume"),
        (["run", "small.toml", "--out", "small.toml"], "cannot write small.toml"),
        (["run", "small.toml", "--out", "a" * 300], "File name too long"),
        (["report", "a" * 300], "holds no result"),
        (["report", "absent"], "absent holds no result"),
        (["replay", "absent", "--run", "1", "--worst", "1"], "exclude each other"),
    ],
)
def test_bad_input_is_explained(refused: Refused, arguments: list[str], expected: str) -> None:
    assert expected in refused(*arguments)
    assert [path.name for path in Path().iterdir()] == ["small.toml"]
    assert Path("small.toml").read_text() == SMALL


def test_a_page_can_show_a_command_with_a_name_that_is_no_text(tmp_path: Path) -> None:
    """File names are bytes, and Python shows those that are not UTF-8 as surrogates."""
    page = tmp_path / "page.html"
    assert main(["campaign", "run", "small.toml", "--runs", "2", "--out", "odd"]) == 0
    assert main(["campaign", "report", "odd", "--json", "\udcff.json", "--out", str(page)]) == 0
    assert "\\udcff.json" in page.read_text(encoding="utf-8")

"""Every command reads an overlay, or refuses it with an explanation and a remedy."""

import json
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.compare.runs import compare_runs
from cranectl.log.reader import read_log

pytestmark = pytest.mark.usefixtures("in_empty_directory")

SHORT = ["--set", "duration=0.5", "--set", "disturbances=[]", "--set", "initial.load_offset=[0.1,0,0]"]
NAMES = ("lqr", "pid", "pole-placement")


@pytest.fixture
def overlay(tmp_path: Path) -> Path:
    for name in NAMES:
        assert main(["run", "fixed-position", "--controller", name, *SHORT, "--out", f"{name}.mcap"]) == 0
    path = tmp_path / "all.mcap"
    assert main(["log", "overlay", *(f"{name}.mcap" for name in NAMES), "--out", str(path)]) == 0
    return path


def test_info_compare_and_report_read_an_overlay(overlay: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["info", str(overlay), "--json", "info.json"]) == 0
    assert main(["compare", str(overlay), "--json", "compare.json"]) == 0
    out = capsys.readouterr().out
    assert "overlay of   lqr, pid, pole-placement" in out
    assert "Largest difference from lqr" in out
    runs = json.loads(Path("info.json").read_text())["runs"]
    assert [(run["label"], run["plant"], run["design"]["name"]) for run in runs] == [
        (name, "mujoco", name) for name in NAMES
    ]
    first, *others = (read_log(f"{name}.mcap")["mujoco"] for name in NAMES)
    comparisons = json.loads(Path("compare.json").read_text())["comparisons"]
    pairs = [(comparison["a"], comparison["b"]) for comparison in comparisons]
    assert pairs == [("lqr", "pid"), ("lqr", "pole-placement")]
    for comparison, run in zip(comparisons, others, strict=True):
        assert comparison["max_load_error_m"] == compare_runs(first, run).max_load_error_m > 1e-4
    assert main(["report", str(overlay), "lqr.mcap", "--out", "page.html"]) == 0
    page = Path("page.html").read_text()
    assert "all: pole-placement" in page
    assert "mujoco: lqr minus all: lqr" in page


def test_runs_of_several_scenarios_are_labelled_with_their_scenarios(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in ("here", "there"):
        assert (
            main(["run", "fixed-position", *SHORT, "--set", f"name={name}", "--out", f"{name}/a.mcap"]) == 0
        )
    capsys.readouterr()
    assert main(["log", "overlay", "here/a.mcap", "there/a.mcap", "--out", "both.mcap", "--json", "-"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["labels"] == ["here", "there"]
    assert "scenarios differ: here, there" in captured.err
    assert main(["log", "overlay", "here/a.mcap", "here/a.mcap", "--out", "both.mcap"]) == 0
    assert "scenarios differ" not in capsys.readouterr().out


def test_other_commands_refuse_an_overlay(overlay: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for line in (
        ["compare", str(overlay), "lqr.mcap"],
        ["compare", str(overlay), "lqr.mcap", "--tolerances", "exact"],
        ["log", "recover", str(overlay), "--out", "new.mcap"],
        ["report", str(overlay), "lqr.mcap", "pid.mcap", "--out", "page.html"],
    ):
        assert main(line) == 2
        error = capsys.readouterr().err
        assert "overlay" in error
        assert "remedy" in error

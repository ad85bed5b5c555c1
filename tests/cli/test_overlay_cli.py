"""Every command reads an overlay, or refuses it with an explanation and a remedy."""

import json
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.compare.runs import compare_runs
from cranectl.log.reader import read_log
from tests.cli.conftest import Command, json_of
from tests.remedies import prepared

pytestmark = pytest.mark.usefixtures("in_copy_of_files")

NAMES = ("lqr", "pid", "pole-placement")
RUN = "run fixed-position --set duration=0.5 --set disturbances=[] --set initial.load_offset=[0.1,0,0]"
prepared_files = prepared(
    {},
    [
        *(f"{RUN} --controller {name} --out {name}.mcap" for name in NAMES),
        "log overlay lqr.mcap pid.mcap pole-placement.mcap --out all.mcap",
        *(f"{RUN} --set name={name} --out {name}/a.mcap" for name in ("here", "there")),
    ],
)


@pytest.mark.slow
def test_info_compare_and_report_read_an_overlay(output: Command) -> None:
    assert "overlay of   lqr, pid, pole-placement" in output("info", "all.mcap")
    assert "Largest difference from lqr" in output("compare", "all.mcap")
    runs = json_of("info", "all.mcap")["runs"]
    assert [(run["label"], run["plant"], run["design"]["name"]) for run in runs] == [
        (name, "mujoco", name) for name in NAMES
    ]
    first, *others = (read_log(f"{name}.mcap")["mujoco"] for name in NAMES)
    comparisons = json_of("compare", "all.mcap")["comparisons"]
    pairs = [(comparison["a"], comparison["b"]) for comparison in comparisons]
    assert pairs == [("lqr", "pid"), ("lqr", "pole-placement")]
    for comparison, run in zip(comparisons, others, strict=True):
        assert comparison["max_load_error_m"] == compare_runs(first, run).max_load_error_m > 1e-4
    assert main(["report", "all.mcap", "lqr.mcap", "--out", "page.html"]) == 0
    page = Path("page.html").read_text()
    assert "all: pole-placement" in page
    assert "mujoco: lqr minus all: lqr" in page


def test_runs_of_several_scenarios_are_labelled_with_their_scenarios(output: Command) -> None:
    out = output("log", "overlay", "here/a.mcap", "there/a.mcap", "--out", "both.mcap", "--json", "both.json")
    assert "scenarios differ: here, there" in out
    assert json.loads(Path("both.json").read_text())["labels"] == ["here", "there"]
    out = output("log", "overlay", "here/a.mcap", "here/a.mcap", "--out", "both.mcap")
    assert "scenarios differ" not in out


@pytest.mark.parametrize(
    "line",
    [
        "compare all.mcap lqr.mcap",
        "compare all.mcap lqr.mcap --tolerances exact",
        "log recover all.mcap --out new.mcap",
        "report all.mcap lqr.mcap pid.mcap --out page.html",
    ],
)
def test_other_commands_refuse_an_overlay(line: str, refusal: Command) -> None:
    error = refusal(*line.split())
    assert "overlay" in error
    assert "remedy" in error

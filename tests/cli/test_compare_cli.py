"""`cranectl compare`: golden runs, merged logs, and errors for invalid input."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.scenario import Scenario
from cranectl.simulate import simulate_run
from cranectl.support.provenance import Provenance
from tests.cli.arguments import SHORT, STOP
from tests.cli.conftest import Command, json_of
from tests.conftest import PAIR
from tests.remedies import prepared

pytestmark = pytest.mark.usefixtures("in_copy_of_files")


RUN = f"run fixed-position {' '.join(SHORT)} --controller lqr --out"
prepared_files = prepared(
    {}, [f"{RUN} golden.mcap", *(f"{RUN} {plant}.mcap --plant {plant}" for plant in PAIR)]
)


def run(out: str, *options: str, controller: str = "lqr", code: int = 0) -> None:
    assert main([*RUN.split(), out, *options, "--controller", controller]) == code


@pytest.fixture
def refused(refusal: Command) -> Command:
    """Return a function that compares logs, which must be refused and write nothing; it returns the error."""

    def compare(*arguments: str) -> str:
        before = {path: path.read_bytes() for path in Path().iterdir()}
        error = refusal("compare", *arguments)
        assert {path: path.read_bytes() for path in Path().iterdir()} == before
        return error

    return compare


def test_an_identical_run_passes_and_a_run_with_another_gain_fails(output: Command) -> None:
    run("again.mcap")
    run("new.mcap", "--set", "design.input_weight=0.11")
    Path("limits.toml").write_text(
        "end_s = 0.0\n[[limits]]\nsignals = 'state.alpha'\nabsolute = 0.0\n"
        "[[limits]]\nsignals = '*'\nabsolute = 1e3\n"
    )
    for name in ("exact", "rounding"):
        out = output("compare", "again.mcap", "golden.mcap", "--tolerances", name)
        assert "FAILED" not in out
        assert "again.mcap: passed" in out
        out = output("compare", "new.mcap", "golden.mcap", "--tolerances", name, code=1)
        assert "new.mcap: FAILED" in out
    limits = ["--tolerances", "limits.toml", "--json", "v.json"]
    out = output("compare", "new.mcap", "golden.mcap", *limits, code=1)
    assert "golden and new differ in design.input_weight: 0.1 and 0.11" in out
    rows = [line.split() for line in out.splitlines()]
    assert sum("FAILED" in row for row in rows) == 4, "expected alpha of three plants, and the verdict"
    (alpha, *_) = (row for row in rows if row[:2] == ["state.alpha", "rad"])
    assert alpha[-2:] == ["0.0e+00", "FAILED"]
    (tension, *_) = (row for row in rows if row[:2] == ["load.rope_tension", "N"])
    assert tension[-2:] == ["1.0e+03", "passed"]
    result = json.loads(Path("v.json").read_text())
    assert result["passed"] is False
    assert result["differing_fields"] == ["design.input_weight: 0.1 and 0.11"]
    assert [verdict["plant"] for verdict in result["verdicts"]] == ["analytic", "elastic", "mujoco"]
    for verdict in result["verdicts"]:
        assert verdict["passed"] is False
        assert {signal["signal"] for signal in verdict["signals"] if not signal["passed"]} == {"state.alpha"}
        assert {"signal", "unit", "max_abs", "at_s", "limit", "passed"} == set(verdict["signals"][0])


def test_other_settings_are_named_first_and_in_few_lines(output: Command) -> None:
    run("new.mcap", "--plants", "analytic", controller="pid")
    changes = [f"rig.{part}_mass=7" for part in ("bridge", "trolley", "load")] + ["disturbances=[]"]
    options = [word for change in changes for word in ("--set", change)]
    run("other.mcap", "--plants", "analytic", *options, controller="pid")
    rounding = ("--tolerances", "rounding")
    for arguments, who, code in (((), "the runs", 0), (rounding, "golden and new", 1)):
        pair = ("analytic.mcap", "new.mcap") if code == 0 else ("new.mcap", "analytic.mcap")
        lines = output("compare", *pair, *arguments, code=code).splitlines()
        assert lines[0] == f"{who} differ in controller: lqr and pid"
        assert sum("differ in" in line for line in lines) == 1
    out = output("compare", "other.mcap", "analytic.mcap", *rounding, "--json", "v.json", code=1)
    lines = [line for line in out.splitlines() if "golden and new differ in" in line]
    fields = json.loads(Path("v.json").read_text())["differing_fields"]
    assert len(fields) > len(lines) == 11
    assert lines[10] == f"golden and new differ in {len(fields) - 10} more"


def test_one_plant_out_of_limits_fails_the_comparison() -> None:
    run("golden.mcap", "--every", "1")
    for plant in ("analytic", "mujoco"):
        runs = read_log("golden.mcap")
        changed = runs[plant].table.copy()
        changed[7, 3] += 1e-6
        runs[plant] = replace(runs[plant], table=changed)
        write_log("new.mcap", list(runs.values()))
        verdicts = json_of("compare", "new.mcap", "golden.mcap", "--tolerances", "exact", code=1)["verdicts"]
        assert [verdict["plant"] for verdict in verdicts if not verdict["passed"]] == [plant]


def test_a_plant_that_only_the_golden_log_has_fails(output: Command) -> None:
    """A plant that is new has nothing to be compared with, and one that is gone was not compared."""
    exact = ["--tolerances", "exact", "--json", "v.json"]
    for new, golden, code, said in (
        ("mujoco.mcap", "golden.mcap", 1, "missing: analytic, only in golden.mcap"),
        ("golden.mcap", "mujoco.mcap", 0, "not compared: analytic, only in golden.mcap"),
    ):
        assert said in output("compare", new, golden, *exact, code=code)
        judged = json.loads(Path("v.json").read_text())
        assert [verdict["plant"] for verdict in judged["verdicts"]] == ["mujoco"]
        assert judged["verdicts"][0]["passed"]
        assert judged["missing"] == ["analytic", "elastic"] * code


def test_logs_of_one_plant_each_are_compared_but_not_judged(output: Command) -> None:
    out = output("info", "mujoco.mcap") + output("compare", "analytic.mcap", "mujoco.mcap")
    assert "mujoco/ideal minus" in out
    assert "verdict" not in out


def test_invalid_combinations_with_tolerances_are_refused(refused: Command) -> None:
    log, exact = "golden.mcap", ("--tolerances", "exact")
    assert "did you mean 'exact'?" in refused(log, log, "--tolerances", "exct")
    assert "NEW and GOLDEN" in refused(log, *exact)
    assert "3 logs" in refused(log, log, log, *exact)
    assert "one of the two" in refused(log, log, *exact, "--merge", "c.mcap")


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ((), 0),
        (("--drive", "velocity", "--set", "log.every=7"), 0),
        (("--every", "1", "--set", "rig.load_mass=2"), 0),
        (("--drive", "velocity", *STOP), 3),
    ],
)
def test_a_merged_log_equals_the_log_of_one_run_with_both_plants(
    options: tuple[str, ...], code: int, output: Command
) -> None:
    """In the last case, the plants stop at different times."""
    run("both.mcap", "--plants", "analytic,mujoco", *options, controller="pole-placement+hinf", code=code)
    for plant in ("analytic", "mujoco"):
        run(f"{plant}.mcap", "--plant", plant, *options, controller="pole-placement+hinf", code=code)
    for pair in (("analytic.mcap", "mujoco.mcap"), ("mujoco.mcap", "analytic.mcap")):
        out = output("compare", *pair, "--merge", "new/both.mcap", "--json", "c.json")
        assert "log: new/both.mcap" in out
        assert Path("new/both.mcap").read_bytes() == Path("both.mcap").read_bytes()
        (comparison,) = json.loads(Path("c.json").read_text())["comparisons"]
        assert [comparison[name].split("/")[2] for name in ("a", "b")] == ["analytic", "mujoco"]


def test_a_merged_log_keeps_the_rate_of_its_sources(short: Scenario) -> None:
    runs = [simulate_run(short, plant=plant) for plant in PAIR]
    write_log("both.mcap", runs, every=6)
    for single in runs:
        write_log(f"{single.plant}.mcap", [single], every=6)
    assert main(["compare", "analytic.mcap", "mujoco.mcap", "--merge", "new.mcap"]) == 0
    assert Path("new.mcap").read_bytes() == Path("both.mcap").read_bytes()


def test_different_scenarios_merge_only_on_request(refused: Command) -> None:
    changes = ("--set", "rig.bridge_mass=7", "--set", "disturbances.0.magnitude=2")
    run("mujoco.mcap", "--plant", "mujoco", *changes)
    pair = ("mujoco.mcap", "analytic.mcap")
    error = refused(*pair, "--merge", "both.mcap")
    assert "rig.bridge_mass: 6.0 and 7.0" in error
    assert "disturbances.0.magnitude: " in error
    assert "--despite-differences" in error
    assert main(["compare", *pair, "--merge", "both.mcap", "--despite-differences"]) == 0
    merged = read_log("both.mcap")
    for plant, merged_run in merged.items():
        single = read_log(f"{plant}.mcap")[plant]
        for name in ("table", "reference", "time_ns"):
            assert getattr(merged_run, name).tobytes() == getattr(single, name).tobytes()
        assert merged_run.model == single.model
    assert merged["mujoco"].scenario.rig.bridge_mass == 6.0, "as --despite-differences warns"


def test_runs_with_different_loads_are_not_merged(refused: Command) -> None:
    """A log describes one mass of the load, and readers check the rope tension against it."""
    run("mujoco.mcap", "--plant", "mujoco", "--set", "rig.load_mass=2")
    error = refused("analytic.mcap", "mujoco.mcap", "--merge", "m.mcap", "--despite-differences")
    assert "different loads [kg], 1.0 and 2.0" in error


def test_logs_of_other_versions_merge_only_on_request(
    refused: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    newer = {**Provenance.now(), "mujoco": "99.0"}
    monkeypatch.setattr(Provenance, "now", lambda: newer)
    pair = ("analytic.mcap", "mujoco.mcap")
    error = refused(*pair, "--merge", "both.mcap")
    assert "analytic.mcap and this installation differ in: mujoco 4" in error
    assert ", now 99.0" in error
    assert main(["compare", *pair, "--merge", "both.mcap", "--despite-differences"]) == 0


def test_incompatible_logs_are_not_merged(refused: Command) -> None:
    """`tests/compare/test_runs.py` has what the runs in them have to share."""
    Path("text").write_text("")
    first = "analytic.mcap"
    for second, out, expected in (
        ("golden.mcap", "new.mcap", "golden.mcap holds the runs of 3 plants"),
        ("absent.mcap", "new.mcap", "cannot read absent.mcap"),
        ("mujoco.mcap", "./mujoco.mcap", "the same command reads it"),
        ("mujoco.mcap", "text/new.mcap", "cannot write text/new.mcap"),
    ):
        assert expected in refused(first, second, "--merge", out, "--despite-differences"), expected
    assert "one of each plant" in refused(first, "--merge", "new.mcap")
    assert "without --merge" in refused(first, "mujoco.mcap", "--despite-differences")


def test_directories_are_compared_log_by_log(output: Command, refusal: Command) -> None:
    """Logs are paired by relative path. A missing or unreadable log fails; an additional one is reported."""

    def copy(log: str, *places: str) -> None:
        for place in places:
            Path(place).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(log, place)

    copy(
        "analytic.mcap", *(f"{folder}/{log}" for folder in ("new", "old") for log in ("a.mcap", "sub/b.mcap"))
    )
    command = ["compare", "new", "old", "--tolerances", "exact"]
    assert main(command) == 0
    run("new/sub/b.mcap", "--plants", "analytic", "--set", "initial.load_offset=[0.001,0,0]")
    copy("analytic.mcap", "new/extra.mcap", "old/gone.mcap")
    Path("text").write_bytes(b"no log")
    copy("text", "new/bad.mcap", "old/bad.mcap")
    assert "not compared: extra.mcap, only in" in output(*command, "--json", "v.json", code=1)
    logs = json.loads(Path("v.json").read_text())["logs"]
    assert {path: log["passed"] for path, log in logs.items()} == {
        "a.mcap": True, "bad.mcap": False, "gone.mcap": False, "sub/b.mcap": False
    }  # fmt: skip
    assert logs["gone.mcap"]["problem"] == "missing"
    for arguments in (["new", "old"], ["new", "old/a.mcap", "--tolerances", "exact"]):
        assert "is a directory" in refusal("compare", *arguments)

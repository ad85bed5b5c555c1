"""`cranectl compare` as CI and people with two machines meet it: golden runs, merged logs, no traceback."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.log import read_log, write_log
from cranectl.plants.registry import PLANTS
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.support.provenance import provenance
from tests.cli.arguments import SHORT, STOP


def run(out: str, *options: str, controller: str = "lqr", code: int = 0) -> None:
    arguments = ["fixed-position", *SHORT, "--controller", controller, *options, "--out", out]
    assert main(["run", *arguments]) == code


def bad_input(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Standard error of a call that must end with exit code 2, no traceback and nothing written."""
    capsys.readouterr()
    before = {path: path.read_bytes() for path in Path().iterdir()}
    assert main(["compare", *arguments]) == 2
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    assert captured.out == ""
    assert {path: path.read_bytes() for path in Path().iterdir()} == before
    return captured.err


def test_an_identical_run_passes_and_a_changed_gain_fails(capsys: pytest.CaptureFixture[str]) -> None:
    run("golden.mcap")
    run("again.mcap")
    run("new.mcap", "--set", "design.input_weight=0.11")
    capsys.readouterr()
    for name in ("exact", "rounding"):
        assert main(["compare", "again.mcap", "golden.mcap", "--tolerances", name]) == 0
        out = capsys.readouterr().out
        assert "FAILED" not in out
        assert "again.mcap: passed" in out
        assert main(["compare", "new.mcap", "golden.mcap", "--tolerances", name]) == 1
        out = capsys.readouterr().out
        assert "new.mcap: FAILED" in out
        assert "golden and new differ in design.input_weight: 0.1 and 0.11" in out


def test_the_table_has_limits_and_verdicts(capsys: pytest.CaptureFixture[str]) -> None:
    run("golden.mcap")
    run("new.mcap", "--set", "design.input_weight=0.11")
    capsys.readouterr()
    Path("limits.toml").write_text(
        "end_s = 0.0\n[[limits]]\nsignals = 'state.alpha'\nabsolute = 0.0\n"
        "[[limits]]\nsignals = '*'\nabsolute = 1e3\n"
    )
    arguments = ["compare", "new.mcap", "golden.mcap", "--tolerances", "limits.toml"]
    assert main(arguments) == 1
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert sum("FAILED" in row for row in rows) == 3, "alpha of both plants, and the verdict"
    (alpha, _) = (row for row in rows if row[:2] == ["state.alpha", "rad"])
    assert alpha[-2:] == ["0.0e+00", "FAILED"]
    (tension, _) = (row for row in rows if row[:2] == ["load.rope_tension", "N"])
    assert tension[-2:] == ["1.0e+03", "passed"]
    assert main([*arguments, "--json", "-"]) == 1
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert "FAILED" in captured.err
    assert result["passed"] is False
    assert result["differing_fields"] == ["design.input_weight: 0.1 and 0.11"]
    assert [verdict["plant"] for verdict in result["verdicts"]] == ["analytic", "mujoco"]
    for verdict in result["verdicts"]:
        assert verdict["passed"] is False
        assert {signal["signal"] for signal in verdict["signals"] if not signal["passed"]} == {"state.alpha"}
        assert {"signal", "unit", "max_abs", "at_s", "limit", "passed"} == set(verdict["signals"][0])


def test_one_plant_out_of_limits_is_enough() -> None:
    run("golden.mcap", "--every", "1")
    for plant in ("analytic", "mujoco"):
        runs = read_log("golden.mcap")
        changed = runs[plant].table.copy()
        changed[7, 3] += 1e-6
        runs[plant] = replace(runs[plant], table=changed)
        write_log("new.mcap", list(runs.values()))
        assert main(["compare", "new.mcap", "golden.mcap", "--tolerances", "exact", "--json", "v.json"]) == 1
        verdicts = json.loads(Path("v.json").read_text())["verdicts"]
        assert [verdict["plant"] for verdict in verdicts if not verdict["passed"]] == [plant]


def test_the_difference_is_found_in_the_golden_log_too(capsys: pytest.CaptureFixture[str]) -> None:
    """Runs that end otherwise fail whichever is the golden one, with any limits on the signals."""
    run("golden.mcap", "--drive", "velocity")
    run("new.mcap", "--drive", "velocity", *STOP, code=3)
    Path("wide.toml").write_text("end_s = 0.0\n[[limits]]\nsignals = '*'\nabsolute = 1e9\n")
    capsys.readouterr()
    for pair in (("new.mcap", "golden.mcap"), ("golden.mcap", "new.mcap")):
        assert main(["compare", *pair, "--tolerances", "wide.toml"]) == 1
        rows = [line.split() for line in capsys.readouterr().out.splitlines()]
        assert [row[0] for row in rows if "FAILED" in row[-1:]] == ["ends", row_of(pair)] * 2 + [
            f"{pair[0]}:"
        ]


def row_of(pair: tuple[str, str]) -> str:
    return "length-singular," if pair[0] == "new.mcap" else "completed,"


def test_only_shared_plants_are_judged_and_the_others_named(capsys: pytest.CaptureFixture[str]) -> None:
    run("golden.mcap")
    run("new.mcap", "--plant", "mujoco")
    capsys.readouterr()
    assert main(["compare", "new.mcap", "golden.mcap", "--tolerances", "exact", "--json", "v.json"]) == 0
    assert "not compared: analytic, only in golden.mcap" in capsys.readouterr().out
    (verdict,) = json.loads(Path("v.json").read_text())["verdicts"]
    assert verdict["plant"] == "mujoco"
    run("analytic.mcap", "--plant", "analytic")
    error = bad_input(capsys, "new.mcap", "analytic.mcap", "--tolerances", "exact")
    assert "share no plant" in error


def test_tolerances_that_cannot_judge(capsys: pytest.CaptureFixture[str]) -> None:
    run("a.mcap")
    run("b.mcap", controller="lqr+hinf")
    run("fine.mcap", "--every", "1")
    Path("typo.toml").write_text("end_s = 0.0\n[[limits]]\nsignals = 'stte.*'\nabsolute = 0.0\n")
    judged = ("--tolerances", "exact")
    assert "did you mean 'state.*'?" in bad_input(capsys, "a.mcap", "a.mcap", "--tolerances", "typo.toml")
    assert "only one of the runs" in bad_input(capsys, "a.mcap", "b.mcap", *judged)
    assert "lacks 375 of 501 samples" in bad_input(capsys, "a.mcap", "fine.mcap", *judged)
    assert "did you mean 'exact'?" in bad_input(capsys, "a.mcap", "a.mcap", "--tolerances", "exct")
    assert "NEW and GOLDEN" in bad_input(capsys, "a.mcap", *judged)
    assert "3 logs" in bad_input(capsys, "a.mcap", "a.mcap", "a.mcap", *judged)
    assert "one of the two" in bad_input(capsys, "a.mcap", "a.mcap", *judged, "--merge", "c.mcap")


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ((), 0),
        (("--drive", "velocity", "--set", "log.every=7"), 0),
        (("--every", "1", "--set", "rig.load_mass=2"), 0),
        (("--drive", "velocity", *STOP), 3),
    ],
)
def test_merged_is_what_one_run_of_both_plants_writes(options: tuple[str, ...], code: int) -> None:
    """The last one stops at other times on each plant."""
    run("both.mcap", *options, controller="pole-placement+hinf", code=code)
    for plant in ("analytic", "mujoco"):
        run(f"{plant}.mcap", "--plant", plant, *options, controller="pole-placement+hinf", code=code)
    for k, pair in enumerate((("analytic.mcap", "mujoco.mcap"), ("mujoco.mcap", "analytic.mcap"))):
        assert main(["compare", *pair, "--merge", f"new/{k}.mcap"]) == 0
        assert Path(f"new/{k}.mcap").read_bytes() == Path("both.mcap").read_bytes()


def test_the_merged_log_has_the_rate_of_its_logs_not_of_the_scenario(short: Scenario) -> None:
    runs = [simulate_run(short, plant=plant) for plant in PLANTS]
    write_log("both.mcap", runs, every=6)
    for single in runs:
        write_log(f"{single.plant}.mcap", [single], every=6)
    assert main(["compare", "analytic.mcap", "mujoco.mcap", "--merge", "new.mcap"]) == 0
    assert Path("new.mcap").read_bytes() == Path("both.mcap").read_bytes()


def test_merging_compares_and_says_where_the_log_is(capsys: pytest.CaptureFixture[str]) -> None:
    for plant in ("analytic", "mujoco"):
        run(f"{plant}.mcap", "--plant", plant)
    capsys.readouterr()
    arguments = ["compare", "mujoco.mcap", "analytic.mcap", "--merge", "both.mcap", "--json", "c.json"]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert "log: both.mcap" in out
    (comparison,) = json.loads(Path("c.json").read_text())["comparisons"]
    assert (comparison["a"], comparison["b"]) == tuple(
        f"fixed-position/lqr/{plant}/ideal" for plant in ("analytic", "mujoco")
    )


def test_different_scenarios_merge_only_when_told_to(capsys: pytest.CaptureFixture[str]) -> None:
    run("analytic.mcap", "--plant", "analytic")
    run("mujoco.mcap", "--plant", "mujoco", "--set", "rig.load_mass=2", "--set", "disturbances.0.magnitude=2")
    pair = ("mujoco.mcap", "analytic.mcap")
    error = bad_input(capsys, *pair, "--merge", "both.mcap")
    assert "rig.load_mass: 1.0 and 2.0" in error
    assert "disturbances.0.magnitude: " in error
    assert "--despite-differences" in error
    assert main(["compare", *pair, "--merge", "both.mcap", "--despite-differences"]) == 0
    merged = read_log("both.mcap")
    same_samples(merged["analytic"], read_log("analytic.mcap")["analytic"])
    same_samples(merged["mujoco"], read_log("mujoco.mcap")["mujoco"])
    assert merged["mujoco"].scenario.rig.load_mass == 1.0, "as --despite-differences warns"


def same_samples(a: Run, b: Run) -> None:
    assert a.table.tobytes() == b.table.tobytes()
    assert a.reference.tobytes() == b.reference.tobytes()
    assert a.time_ns.tobytes() == b.time_ns.tobytes()
    assert a.model == b.model


def test_logs_of_other_versions_merge_only_when_told_to(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for plant in ("analytic", "mujoco"):
        run(f"{plant}.mcap", "--plant", plant)
    newer = {**provenance(), "mujoco": "99.0"}
    monkeypatch.setattr("cranectl.support.provenance.provenance", lambda: newer)
    pair = ("analytic.mcap", "mujoco.mcap")
    error = bad_input(capsys, *pair, "--merge", "both.mcap")
    assert "analytic.mcap and this installation differ in: mujoco 4" in error
    assert ", now 99.0" in error
    assert main(["compare", *pair, "--merge", "both.mcap", "--despite-differences"]) == 0


def test_logs_that_cannot_be_merged(capsys: pytest.CaptureFixture[str]) -> None:
    run("both.mcap")
    run("analytic.mcap", "--plant", "analytic")
    run("mujoco.mcap", "--plant", "mujoco")
    run("velocity.mcap", "--plant", "mujoco", "--drive", "velocity")
    run("fine.mcap", "--plant", "mujoco", "--every", "1")
    run("poles.mcap", "--plant", "mujoco", controller="pole-placement")
    Path("text").write_text("")
    one = "analytic.mcap"
    for other, out, expected in (
        (one, "new.mcap", "both logs hold the run of analytic"),
        ("both.mcap", "new.mcap", "both.mcap holds the runs of both plants"),
        ("velocity.mcap", "new.mcap", "different drives, ideal and velocity"),
        ("fine.mcap", "new.mcap", "different times of their samples"),
        ("poles.mcap", "new.mcap", "different controllers, lqr and pole-placement"),
        ("absent.mcap", "new.mcap", "cannot read absent.mcap"),
        ("mujoco.mcap", "./mujoco.mcap", "the same command reads it"),
        ("mujoco.mcap", "text/new.mcap", "cannot write text/new.mcap"),
    ):
        assert expected in bad_input(capsys, one, other, "--merge", out, "--despite-differences"), expected
    assert "one of each plant" in bad_input(capsys, one, "--merge", "new.mcap")
    assert "without --merge" in bad_input(capsys, one, "mujoco.mcap", "--despite-differences")

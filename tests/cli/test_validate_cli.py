"""`cranectl validate`: invalid scenarios, name clashes, limits, directories, and reports for CI."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from cranectl.cases import case
from cranectl.cli.main import main
from cranectl.cli.validate_results import agreement_lines
from cranectl.compare.agreement import Agreement
from cranectl.log.reader import read_log
from cranectl.report.table import Table
from cranectl.simulate import Run
from cranectl.support.resources import Shipped
from tests.cli.conftest import Command, json_of
from tests.cli.option_cases import SHORT
from tests.remedies import written
from tests.report.test_report import read_page

GOOD = f'name = "good"\n{SHORT}'
# The loop is unstable when the robustifier is sampled with 0.1 s.
UNSTABLE = GOOD.replace("good", "unstable") + "control = { period = 0.1, physics_step = 0.001 }\n"
OPTIONS = ["--controller", "lqr+hinf", "--drive", "ideal", "--json", "result.json"]


BROKEN = "name = 'broken'\nduration ="
scenarios = written({"good.toml": GOOD, "also.toml": GOOD, "unstable.toml": UNSTABLE, "broken.toml": BROKEN})


def shipped(name: str) -> str:
    return str(Shipped.SCENARIOS.folder / f"{name}.toml")


@pytest.mark.parametrize(
    "pair", [("good.toml", "also.toml"), ("good.toml", "./good.toml"), ("slack-rope", shipped("slack-rope"))]
)
def test_scenarios_with_the_same_name_are_refused(pair: tuple[str, str], refusal: Command) -> None:
    error = refusal("validate", *pair, *OPTIONS)
    assert f"{pair[0]} and {pair[1]} would share the log logs/" in error
    assert "allowed: " in error
    assert "remedy: " in error
    assert not Path("logs").exists(), "the clash was found only after a run"


@pytest.mark.processor
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_invalid_scenarios_do_not_prevent_the_others(jobs: str, capsys: pytest.CaptureFixture[str]) -> None:
    names = ["broken.toml", "unstable.toml", "absent.toml", "good.toml"]
    assert main(["validate", *names, *OPTIONS, "--jobs", jobs]) == 2
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    assert "3 runs, logs in logs" in captured.out
    assert "validation FAILED" in captured.out
    assert "broken.toml: could not be run\nfound:   broken.toml is not valid TOML" in captured.err
    assert "unstable.toml, lqr+hinf, ideal: could not be run\nfound: " in captured.err
    assert "absent.toml: could not be run\nfound:   cannot read absent.toml" in captured.err
    result = json.loads(Path("result.json").read_text())
    assert result["passed"] is False
    assert [run["scenario"] for run in result["runs"]] == ["good"] * 3
    agreement, _ = result["agreements"]
    assert agreement["passed"] is True
    failed = {case["scenario"]: case for case in result["failed"]}
    assert failed.keys() == {"broken.toml", "unstable.toml", "absent.toml"}
    assert all(case["bad_input"] for case in failed.values())
    assert failed["absent.toml"]["controller"] is None
    assert failed["unstable.toml"]["controller"] == "lqr+hinf"
    assert "unstable when sampled" in failed["unstable.toml"]["reason"]
    assert len(read_log("logs/good/lqr+hinf-ideal.mcap")) == 3


def test_a_common_reason_is_printed_once(refusal: Command) -> None:
    text = GOOD.replace("start = [1.0, 0.77, -0.7]", "start = [1.0, 0.77, 0.7]")
    Path("above.toml").write_text(text.replace("good", "above"))
    error = refusal("validate", "above.toml", "--json", "result.json", "--jobs", "1")
    assert error.count("could not be run") == 1
    assert json.loads(Path("result.json").read_text())["failed"]


def test_an_unforeseen_error_gives_no_verdict(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    simulate = case.simulate_run

    def fail_with_velocity_drives(*arguments: object, **options: object) -> Run:
        if options["drive"] == "velocity":
            raise ZeroDivisionError("of our own making")
        return simulate(*arguments, **options)

    monkeypatch.setattr(case, "simulate_run", fail_with_velocity_drives)
    options = ["validate", "good.toml", "--controller", "lqr", "--jobs", "1"]
    result = json_of(*options, code=70)
    captured = capsys.readouterr()
    assert "good.toml, lqr, velocity: unforeseen\nZeroDivisionError: of our own making\n" in captured.err
    assert "Traceback" not in captured.err
    assert "validation FAILED" in captured.out
    assert [run["drive"] for run in result["runs"]] == ["ideal"] * 3
    assert [failure["bad_input"] for failure in result["failed"]] == [False]
    assert main([*options, "--drive", "velocity", "--traceback"]) == 70
    assert "Traceback (most recent call last)" in capsys.readouterr().err


LIMITS = "[limits]\nmax_error_m = {0}\n[limits.mujoco]\nmin_rope_tension_n = 1.0\n"
OFFSET = ["--set", "initial.load_offset=[0.001,0,0]"]


def write_variant(name: str, text: str) -> None:
    Path(f"{name}.toml").write_text(GOOD.replace("good", name) + text)


@pytest.mark.slow
@pytest.mark.processor
def test_limits_of_a_scenario_are_judged_in_addition_to_the_agreement(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Each limit counts once a case, whatever the number of plants: on screens, in JSON and on pages."""
    write_variant("strict", LIMITS.format(0.0))
    write_variant("mild", LIMITS.format(1.0))
    write_variant("wrong", LIMITS.format(1.0).replace("max_error_m", "max_eror_m"))
    options = ["--controller", "lqr"]
    for name, code in (("mild", 0), ("strict", 1)):
        log, kept = f"logs/{name}/lqr-ideal.mcap", f"{2 - code} of 2 limits kept"
        data = json_of("run", f"{name}.toml", *OFFSET, *options, code=code)
        assert (data["plants_agree"], data["limits_kept"]) == (True, code == 0)
        metrics = [[limit["metric"] for limit in run["limits"]] for run in data["runs"]]
        assert metrics == [*[["max_error_m"]] * 2, ["max_error_m", "min_rope_tension_n"]]
        assert json_of("compare", log, code=code)["limits_kept"] is (code == 0)
        assert capsys.readouterr().out.count(kept) == 2, "by run and by compare"
        assert main(["report", log, "--out", "run.html"]) == 0
        assert kept in read_page(Path("run.html").read_text()).text
    assert "1 of 2 limits are broken" in read_page(Path("run.html").read_text()).text
    capsys.readouterr()
    report = ["--report", "cases.html"]
    assert main(["validate", "strict.toml", "wrong.toml", *OFFSET, *options, *report]) == 2
    captured = capsys.readouterr()
    assert "2 of 4 limits kept" in captured.out, "with ideal and velocity drives"
    assert "did you mean 'max_error_m'?" in captured.err
    assert "2 of 4" in read_page(Path("cases.html").read_text()).text


def test_a_directory_selects_all_scenarios_in_it(
    tmp_path: Path, output: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    """`test_nothing_to_judge.py` has a directory without scenarios."""
    folder = tmp_path / "mine"
    (folder / "below").mkdir(parents=True)
    (folder / "first.toml").write_text(GOOD.replace("good", "first"))
    (folder / "below" / "second.toml").write_text(GOOD.replace("good", "second"))
    (folder / "rig.toml").write_text("load_mass = 2.0\n")
    (folder / "many.toml").write_text('name = "many"\nscenario = "good.toml"\n')
    again = str(Path("mine", "first.toml"))
    out = output("validate", "mine", "good.toml", again, *OPTIONS)
    assert f"{again} is given more than once, and judged once" in out
    runs = json.loads(Path("result.json").read_text())["runs"]
    assert [run["scenario"] for run in runs[::3]] == ["second", "first", "good"]
    (folder / "broken.toml").write_text("reference = ")
    assert main(["validate", "mine", *OPTIONS]) == 2, "an invalid scenario was ignored"
    assert "mine/broken.toml: could not be run" in capsys.readouterr().err


@pytest.mark.slow
def test_validate_writes_junit_and_a_page_and_keeps_failed_logs(capsys: pytest.CaptureFixture[str]) -> None:
    write_variant("strict", LIMITS.format(0.0))
    command = ["validate", "strict.toml", "good.toml", "broken.toml", *OFFSET, *OPTIONS]
    command += ["--keep", "failed", "--every", "20", "--junit", "cases.xml", "--report", "cases.html"]
    assert main(command) == 2
    capsys.readouterr()
    assert [str(log) for log in Path("logs").rglob("*.mcap")] == ["logs/strict/lqr+hinf-ideal.mcap"]
    log = read_log(Path("logs/strict/lqr+hinf-ideal.mcap"))
    assert {run.scenario.log.every for run in log.values()} == {20}
    root = ElementTree.parse("cases.xml").getroot()
    assert {name: root[0].get(name) for name in ("tests", "failures", "errors")} == {
        "tests": "3", "failures": "1", "errors": "1"
    }  # fmt: skip
    cases = {case.get("classname"): case for case in root.iter("testcase")}
    assert cases["good.toml"].get("name") == "lqr+hinf / ideal / analytic, elastic, mujoco"
    assert list(cases["good.toml"]) == []
    failure = cases["strict.toml"].find("failure")
    assert failure is not None
    assert failure.get("message") == "mujoco breaks the limit 0 m of max_error_m: 0.001 m"
    assert str(failure.text).count("breaks the limit") == 1, "a limit is judged once, not on each plant"
    assert "log: logs/strict/lqr+hinf-ideal.mcap" in str(failure.text)
    repeat = re.search(r"again: cranectl (.*)", str(failure.text))
    assert repeat is not None
    assert main(shlex.split(repeat[1])) == 1, "the suggested command does not reproduce the failure"
    assert cases["broken.toml"].find("error") is not None
    page = Path("cases.html").read_text(encoding="utf-8")
    assert re.search(
        r'class="badge bad">FAIL</strong>\s*2 of 3 scenarios fail\. The worst: broken\.toml', page
    )
    order = ["It could not be run: broken.toml is not valid TOML", "FAIL: strict", "PASS: good", "<h2>Plants"]
    positions = [page.rindex(text) for text in order]
    assert positions == sorted(positions), "failures must come first, the worst on top"
    assert page.count("<img ") == 1, "only the scenario with a log has a picture"
    (suggestion,) = set(re.findall(r'class="label long code">cranectl (report [^<]*)<', page))
    assert suggestion == "report logs/strict/lqr+hinf-ideal.mcap"
    assert main(suggestion.split()) == 0
    capsys.readouterr()

    def written() -> tuple[bytes, str]:
        """Return the results without the time that they took."""
        return Path("cases.html").read_bytes(), re.sub(
            r'time(stamp)?="[^"]*"', "", Path("cases.xml").read_text()
        )

    first = written()
    assert main(command) == 2
    assert written() == first


def test_the_output_has_one_line_per_scenario_without_logs_too(output: Command) -> None:
    command = ["validate", "good.toml", "strict.toml", *OPTIONS, "--keep", "none"]
    write_variant("strict", "")
    short = output(*command)
    assert re.findall(r"^ (\w+) +<.* yes *$", short, re.MULTILINE) == ["good", "strict"]
    assert "lqr+hinf" not in short
    assert "6 runs, no log kept" in short
    assert not Path("logs", "good").exists()
    assert [run["log"] for run in json.loads(Path("result.json").read_text())["runs"]] == [None] * 6
    assert output(*command, "--details").count("lqr+hinf, elastic") == 2
    out = output(*command, "--plants", "analytic")
    assert "differences" not in out, "a single plant has no differences"
    assert out.rstrip().endswith("validation passed (agreement not judged: analytic is the only plant)")


def test_a_scenario_runs_with_its_own_controller_of_another_family(output: Command) -> None:
    """The six usual controllers would say nothing about this one."""
    write_variant("mine", 'controller = "pid"\n')
    assert "2 runs" in output("validate", "mine.toml", "--drive", "ideal", "--plants", "analytic,elastic")
    assert {log.name for log in Path("logs/mine").iterdir()} == {"pid-ideal.mcap"}


def test_disagreeing_plants_have_one_line_each(monkeypatch: pytest.MonkeyPatch) -> None:
    good = Agreement("fast", "lqr", "analytic", "mujoco", "ideal", 1e-9, 2e-9, 1e-7, 1e-7, True, "as shipped")
    bad = [replace(good, controller=name, max_load_error_m=1.0, passed=False) for name in ("pid", "mine")]
    (table,) = agreement_lines([good])
    assert isinstance(table, Table)
    assert [row[0].text for row in table.rows] == ["fast"]
    monkeypatch.setattr("cranectl.cli.validate_results.SHOWN_FAILURES", 1)
    _, failed, more = agreement_lines([good, *bad])
    assert isinstance(failed, Table)
    assert [row[0].text for row in failed.rows] == ["fast", " pid"]
    assert (failed.title, more) == ("Plants that disagree: 2", "  and 1 more, with --details")
    assert list(agreement_lines([])) == []

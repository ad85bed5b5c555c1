"""A campaign is judged by the share of its runs that fail, and a job fails with it."""

import json
import math
import shlex
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest

from cranectl.campaign.failures import AllowedFailures, judge_failures, percent
from cranectl.campaign.summary import GroupSummary, failure_interval
from cranectl.cli.main import main
from cranectl.support.errors import InputError
from tests.campaign.test_campaign_cli import Refused

pytestmark = pytest.mark.usefixtures("in_directory_with_campaign")


def group(failures: int, runs: int, *, drawn: bool = True) -> GroupSummary:
    return GroupSummary(
        plant="mujoco",
        controller="lqr",
        runs=runs,
        failures=failures,
        stopped={},
        not_run={},
        broken={},
        failure_rate=failures / runs if runs else None,
        failure_rate_interval=failure_interval(failures, runs) if runs and drawn else None,
        median_max_error_m=None,
        q95_max_error_m=None,
        worst_sample=None,
        worst_max_error_m=None,
    )


def wilson(failures: int, runs: int) -> tuple[float, float]:
    """Wilson (1927): the shares p with |p̂ - p| = z √(p (1 - p) / n), the roots of a quadratic equation."""
    share, z = failures / runs, 1.959963984540054
    a, b, c = 1.0 + z * z / runs, -(2.0 * share + z * z / runs), share * share
    root = math.sqrt(max(b * b - 4.0 * a * c, 0.0))
    return (-b - root) / (2.0 * a), (-b + root) / (2.0 * a)


@pytest.mark.parametrize(
    ("failures", "runs", "said"),
    [
        (10, 24, "10 of 24 failed: 42 %, 24 to 61 % (Wilson, 95 %); at most 5 % may fail"),
        (0, 24, "0 of 24 failed: 0 %, 0 to 14 % (Wilson, 95 %); at most 5 % may fail"),
        (24, 24, "24 of 24 failed: 100 %, 86 to 100 % (Wilson, 95 %); at most 5 % may fail"),
        (7, 4000, "7 of 4000 failed: 0.2 %, 0.1 to 0.4 % (Wilson, 95 %); at most 5 % may fail"),
    ],
)
def test_the_share_is_said_with_its_interval(failures: int, runs: int, said: str) -> None:
    (verdict,) = judge_failures([group(failures, runs)], AllowedFailures.parse("5%"))
    assert verdict.text == said
    assert failure_interval(failures, runs) == pytest.approx(wilson(failures, runs), abs=1e-12)
    assert f"{percent(wilson(failures, runs)[1])} % (W" in said


def test_runs_that_are_no_random_sample_have_no_interval() -> None:
    (verdict,) = judge_failures([group(3, 49, drawn=False)], AllowedFailures.parse("3"))
    assert verdict.text == "3 of 49 failed: 6.1 %; at most 3 may fail"
    assert verdict.kept


@pytest.mark.parametrize(
    ("allowed", "runs", "most"),
    [
        ("5%", 40, 2),
        ("7%", 100, 7),
        ("0%", 40, 0),
        ("100 %", 40, 40),
        ("2.5%", 40, 1),
        ("0", 40, 0),
        ("3", 40, 3),
    ],
)
def test_as_many_runs_may_fail_as_are_allowed(allowed: str, runs: int, most: int) -> None:
    """0.07 · 100 is more than 7 in floating point numbers."""
    few, more = AllowedFailures.parse(allowed), AllowedFailures.parse(allowed)
    assert few.are_kept(most, runs)
    assert not more.are_kept(most + 1, runs)


@pytest.mark.parametrize("allowed", ["5%", "100%", "3"])
def test_no_run_is_no_pass(allowed: str) -> None:
    (verdict,) = judge_failures([group(0, 0)], AllowedFailures.parse(allowed))
    assert not verdict.kept
    assert "no run" in verdict.text


@pytest.mark.parametrize("text", ["", "-1", "0.05", "5 of 100", "101%", "-1%", "1e2%", "five", "nan", "5%%"])
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="write --max-failures 5%"):
        AllowedFailures.parse(text)


def test_the_command_line_judges(finished: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same result, judged by a limit that nearly half of its runs break, and by one that all keep."""
    shutil.copytree(finished, "result")
    again = ["campaign", "run", "small.toml", "--out", "result", "--resume"]
    errors = json_of("campaign", "report", "result")["groups"][0]["median_max_error_m"]
    limit = ["--set", f"limits.max_error_m={errors!r}"]
    assert main([*again, *limit]) == 0, "without --max-failures it ends with 0"
    assert main([*again, *limit, "--max-failures", "160", "--junit", "good.xml"]) == 0
    capsys.readouterr()
    assert main([*again, *limit, "--max-failures", "40%", "--junit", "bad.xml", "--json", "run.json"]) == 1
    said = capsys.readouterr().out
    assert (
        "lqr on analytic: 80 of 160 failed: 50 %, 42 to 58 % (Wilson, 95 %); at most 40 % may fail: FAILED"
        in said
    )
    judged = json.loads(Path("run.json").read_text())["max_failures"]
    assert (judged["allowed"], judged["passed"]) == ("40 %", False)
    assert judged["groups"][0]["failures"] == 80
    assert main(["campaign", "report", "result", "--max-failures", "40%"]) == 1
    assert main(["campaign", "report", "result", "--max-failures", "100%"]) == 0
    root = ElementTree.parse("bad.xml").getroot()
    assert root[0].get("name") == "cranectl campaign"
    case = next(root.iter("testcase"))
    assert (case.get("classname"), case.get("name")) == ("small", "lqr on analytic")
    (failure,) = case
    assert "80 of 160 failed" in failure.get("message", "")
    assert "80 beyond max_error_m" in str(failure.text)
    (replay,) = [line for line in str(failure.text).splitlines() if line.startswith("again: cranectl ")]
    assert main(shlex.split(replay.removeprefix("again: cranectl "))) == 0
    assert not list(ElementTree.parse("good.xml").getroot().iter("failure"))


def json_of(*arguments: str) -> dict:
    assert main([*arguments, "--json", "facts.json"]) == 0
    return json.loads(Path("facts.json").read_text())


def test_without_limits_it_is_said_that_only_stops_count(
    finished: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["campaign", "report", str(finished), "--out", "page.html", "--max-failures", "0"]) == 0
    assert "has no [limits]: only runs that stop early count as failed" in capsys.readouterr().out


def test_junit_without_a_verdict_is_refused(finished: Path, refused: Refused) -> None:
    error = refused("report", str(finished), "--junit", "junit.xml")
    assert "add --max-failures 5%" in error
    assert not Path("junit.xml").exists()

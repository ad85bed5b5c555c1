"""The page of a campaign: complete, deterministic, and sensible whatever went wrong in the runs."""

import json
import re
import shlex
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

from cranectl.campaign.commands.results import replay_campaign
from cranectl.campaign.evaluation import Analysis
from cranectl.campaign.failures import AllowedFailures, judge_failures
from cranectl.campaign.replay import chosen_rows
from cranectl.campaign.report.page import campaign_page
from cranectl.campaign.results import Results
from cranectl.campaign.summary import summarize
from cranectl.campaign.table import METRIC_COLUMNS
from cranectl.cli.main import main
from cranectl.report.page import render
from tests.campaign.campaigns import LAG, MASS, campaign, fixed
from tests.campaign.results import two_controllers, write_all
from tests.campaign.synthetic import BOTH, THREE, synthetic_results, three
from tests.report.test_report import read_page

pytestmark = pytest.mark.usefixtures("in_empty_directory")

STOPPED = "slack-rope"


def noisy(values: np.ndarray, plant: str, controller: str) -> dict[str, np.ndarray]:
    """Errors that rise with the mass, heavy loads that fail; the plants and the controllers differ a bit."""
    n = len(values)
    noise = np.random.default_rng(len(plant) + len(controller)).uniform(0.9, 1.1, size=n)
    return {
        "max_error_m": 0.1 * values[:, 0] * noise,
        "rms_error_m": 0.02 * values[:, 0] ** 2 * noise,
        "settling_time_s": np.where(values[:, 1] > 0.02, np.nan, noise),
        "min_rope_tension_n": 9.0 * values[:, 0],
        "rms_acceleration_m_s2_bridge": noise,
        "status": np.where(values[:, 0] > 1.4, STOPPED, "completed"),
    }


def never_fails(*arguments: Any) -> dict[str, np.ndarray]:
    return {name: values for name, values in noisy(*arguments).items() if name != "status"}


def without_lag(values: np.ndarray, *names: str) -> dict[str, np.ndarray]:
    """Of one parameter."""
    return noisy(np.column_stack([values[:, 0], np.full(len(values), 0.01)]), *names)


def always_fails(values: np.ndarray, *_: str) -> dict[str, np.ndarray]:
    return {"status": np.full(len(values), STOPPED), "max_error_m": np.full(len(values), 1.0)}


def cannot_be_run(values: np.ndarray, *_: str) -> dict[str, np.ndarray]:
    nothing = np.full(len(values), np.nan)
    return {"status": np.full(len(values), "failed"), **dict.fromkeys(METRIC_COLUMNS, nothing)}


def constant(*_: Any) -> dict[str, np.ndarray]:
    return {}


def page_of(results: Results) -> str:
    return render(campaign_page(Analysis.of(results), "cranectl campaign report x"))


def sections(page: str) -> list[str]:
    return re.findall(r'<section id="([^"]+)"', page)


ONE = {"plants": ["mujoco"], "controllers": ["lqr"]}
TWO = {"plants": ["mujoco"]}
FIXED = {"rig.load_mass": MASS, "rig.winch_time_constant": fixed(0.02)}
GRID = {"rig": {"load_mass": MASS | {"levels": 5}}}
ONE_FIXED = {"rig.load_mass": fixed(1.2)}
SOBOL = {"sampling": "saltelli"}
EVERYTHING = ["outcome", "worst", "controllers", "plants", "influence", "failures", "uncertainty"]


@pytest.fixture(scope="module")
def usual() -> tuple[Results, str]:
    results = synthetic_results(three(runs=128, limits={"max_error_m": 0.13}), noisy)
    return results, page_of(results)


@pytest.mark.parametrize(
    ("uncertain", "changes", "metrics", "without"),
    [
        (THREE, {"runs": 20, "controllers": ["lqr"]}, noisy, "controllers"),
        (THREE, ONE | {"runs": 1}, noisy, "controllers, plants, failures"),
        (THREE, ONE | {"runs": 2}, cannot_be_run, "controllers, plants, failures"),
        (THREE, ONE, never_fails, "controllers, plants, failures"),
        (THREE, TWO, always_fails, "plants, failures"),
        (THREE, TWO, constant, "plants, failures"),
        (THREE, TWO | SOBOL | {"runs": 5 * 32}, noisy, "plants"),
        (THREE, ONE | SOBOL | {"runs": 5 * 8}, always_fails, "controllers, plants, failures"),
        (THREE, TWO | {"sampling": "one-at-a-time", "runs": None}, noisy, "plants, failures"),
        (FIXED, ONE | {"sampling": "monte-carlo", "runs": 40}, without_lag, "controllers, plants"),
        (GRID, ONE | {"sampling": "grid", "runs": None}, without_lag, "controllers, plants"),
        (ONE_FIXED, ONE | {"runs": 20}, without_lag, "controllers, plants, influence, failures"),
    ],
)
def test_whatever_the_runs_were_like_there_is_a_page(
    uncertain: dict[str, Any], changes: dict[str, Any], metrics: Any, without: str
) -> None:
    """Warnings of NumPy, SciPy and Matplotlib are errors here."""
    analysis = Analysis.of(synthetic_results(campaign(uncertain, **(BOTH | changes)), metrics))
    page = render(campaign_page(analysis, "made"))
    assert sections(page) == [name for name in EVERYTHING if name not in without.split(", ")]
    assert "nan" not in re.sub(r"<[^>]*>", "", page.lower().replace("analytic", "")).split()
    assert json.dumps(Analysis.json(analysis))


def test_the_first_screen_tells_who_fails_at_which_limit() -> None:
    """Heavy loads stop; of the others those above 1.3 kg break the limit on sway, which is in degrees."""

    def swaying(values: np.ndarray, plant: str, controller: str) -> dict[str, np.ndarray]:
        sway = {"max_sway_rad": 0.1 * values[:, 0] - 0.05 * (controller != "lqr")}
        return noisy(values, plant, controller) | sway

    results = synthetic_results(three(runs=64, limits={"max_sway_rad": 0.13}, **TWO), swaying)
    analysis = Analysis.of(results)
    screen = campaign_page(analysis, "made").first_screen
    assert screen is not None
    mass, stopped = analysis.values[:, 0], analysis.values[:, 0] > 1.4
    broken = int(((mass > 1.3) & ~stopped).sum())
    failing, stops = int((mass > 1.3).sum()), int(stopped.sum())
    assert screen.verdict.text == f"{failing + stops} OF 128 FAIL"
    assert (
        screen.reason == f"{broken} runs break the limit largest sway ≤ 7.45°. {2 * stops} runs stop early."
    )
    assert [fact.value for fact in screen.facts] == [f"{failing} of 64 fail", f"{stops} of 64 fail"]
    worst = [[cell.text for cell in row] for row in screen.tables[0].rows]
    heaviest = int(np.argmax(mass))
    assert worst[0][1:] == ["lqr", str(broken), f"{np.degrees(0.1 * mass.max()):#.3g}°", str(heaviest)]
    (figure,) = screen.figures
    others = np.median(mass[mass <= 1.3])
    said = f"rig.load_mass [kg] is {np.median(mass[mass > 1.3]):.3g} where runs fail, and {others:.3g} else."
    assert said in figure.caption
    page = render(campaign_page(analysis, "made"))
    shown = [re.sub("<[^>]*>", "", row) for row in re.findall(r"<tr>.*?</tr>", page)]
    metrics = [row for row in shown if row.startswith(("largest sway [°]", "largest error [m]"))]
    assert metrics[0].startswith("largest sway [°]"), "what is limited comes first"
    why = [(example.controller, example.why) for example in analysis.worst]
    assert why[:3] == [("lqr", "beyond max_sway_rad")] * 3
    assert ("pole-placement", "largest error") in why
    allowed = judge_failures(summarize(results), AllowedFailures.parse("99%"))
    judged = campaign_page(analysis, "made", allowed).first_screen
    assert judged is not None
    assert judged.verdict.text == "PASS"


@pytest.mark.parametrize(
    ("limits", "metrics", "badge"),
    [
        ({}, never_fails, "NO LIMITS SET"),
        ({"max_error_m": 10.0}, never_fails, "ALL 32 PASS"),
        ({"max_error_m": 10.0}, always_fails, "32 OF 32 FAIL"),
        ({}, always_fails, "32 OF 32 FAIL"),
    ],
)
def test_nothing_to_judge_is_no_pass(limits: dict[str, float], metrics: Any, badge: str) -> None:
    results = synthetic_results(three(runs=32, limits=limits, **ONE), metrics)
    screen = campaign_page(Analysis.of(results), "made").first_screen
    assert screen is not None
    assert screen.verdict.text == badge


def test_too_few_base_points_for_sobol_indices_are_told() -> None:
    few, enough = (
        page_of(synthetic_results(three(sampling="saltelli", runs=5 * points, **ONE), never_fails))
        for points in (8, 16)
    )
    assert "Sobol indices need 16 base points" in few
    assert "Total Sobol indices" not in few
    assert "Sobol indices need" not in enough
    assert "Total Sobol indices" in enough


def test_an_incomplete_result_says_so(usual: tuple[Results, str]) -> None:
    for missing, told in ((1, "16 of 32"), (2, "32 of 32")):
        page = page_of(synthetic_results(three(runs=32, **ONE), noisy, missing=missing))
        assert f"INCOMPLETE: {told} runs are missing" in page
        assert "--resume" in page
    assert "INCOMPLETE" not in usual[1]
    assert "--resume" not in usual[1]


def test_the_page_is_whole_and_the_same_again(usual: tuple[Results, str]) -> None:
    page = usual[1]
    assert sections(page) == EVERYTHING
    read_page(page)
    numbers = re.findall(r'<figure id="figure-(\d+)"', page)
    assert numbers == [str(k) for k in range(1, len(numbers) + 1)]
    small = synthetic_results(three(runs=30, **ONE), noisy)
    assert page_of(small) == page_of(small)


def test_the_page_names_what_decides_and_what_does_not(usual: tuple[Results, str]) -> None:
    page = usual[1]
    verdicts = re.findall(r"These correlate with the largest error: ([^<]*)\.", page)
    assert len(verdicts) == 4
    for verdict in verdicts:
        assert verdict.startswith("rig.load_mass (ρ = +0.9")
        assert "winch_time_constant" not in verdict
    inert = page_of(synthetic_results(three(runs=128, **ONE), constant))
    assert "correlate with the largest error:" not in inert
    assert "Nothing correlates with the largest error beyond chance" in inert


def test_every_replay_command_is_one_that_works(usual: tuple[Results, str]) -> None:
    results, page = usual
    cells = re.findall(r"<td[^>]*>(cranectl campaign replay [^<]*)</td>", page)
    assert len(cells) > 20
    for cell in cells:
        words = shlex.split(cell.replace("&#39;", "'"))
        given = replay_campaign.make_context("replay", words[3:]).params
        assert given["result"] == results.directory
        chosen = {name: given[name] for name in ("samples", "metric", "plants", "controllers")}
        assert len(chosen_rows(results, worst=3, **chosen)) == (1 if given["plants"] else 2)
    with pytest.raises(click.NoSuchOption):
        replay_campaign.make_context("replay", [word.replace("--run", "--rum") for word in words[3:]])


def test_figures_in_the_page_are_those_of_the_analysis(usual: tuple[Results, str]) -> None:
    results, page = usual
    analysis = Analysis.of(results)
    for part in analysis.groups:
        assert f">{part.summary.q95_max_error_m:.3g}<" in page
    for pair in analysis.plants:
        assert f">{pair.agreement.rho:.5f}<" in page
        assert f">{pair.agreement.largest[0][1]:+.3g}<" in page
    for example in analysis.worst:
        assert f"--run {example.sample} " in page


def test_many_samples_are_drawn_as_hexagons_and_quantiles(usual: tuple[Results, str]) -> None:
    """Forty times the samples with half the groups, and no larger page."""
    many = page_of(synthetic_results(three(runs=40 * 128, controllers=["lqr"]), noisy))
    assert len(many) < len(usual[1]) < 1_000_000


def test_the_command_writes_page_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    uncertain = {"rig.load_mass": MASS, "rig.winch_time_constant": LAG}
    write_all(two_controllers(plants=["mujoco"], uncertain=uncertain), Path("kept"))
    assert main(["campaign", "report", "kept", "--json", "-"]) == 0
    captured = capsys.readouterr()
    told = json.loads(captured.out)
    assert "report: kept.html" in captured.err
    page = Path("kept.html").read_text()
    assert "cranectl campaign replay kept --run" in page
    assert "4 slack-rope" in page
    assert [each["controller"] for each in told["influence"]] == ["lqr", "pole-placement"]
    assert told["controllers"][0]["failures"]["both"] == 4
    assert len(told["influence"][0]["correlations"]["rho"]) == 2
    assert main(["campaign", "report", "kept", "--out", "again.html"]) == 0
    typed = re.compile("(?<=<code>)cranectl campaign report .*(?=</code>)")
    assert typed.sub("", Path("again.html").read_text()) == typed.sub("", page) != page

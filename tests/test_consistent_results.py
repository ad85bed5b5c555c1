"""A result whose numbers contradict each other raises an internal error."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from cranectl.campaign import statistics
from cranectl.campaign.summary import GroupSummary, _summary, summarize
from cranectl.cases.pairwise import WorstPair
from cranectl.cases.validation import Validation
from cranectl.cases.workers import CasesOutcome
from cranectl.compare.agreement import Agreement, AgreementLimits, NoLimits, judge
from cranectl.compare.runs import compare_runs
from cranectl.log.description import LogDescription, TopicDescription
from cranectl.planning.review import check_duration
from cranectl.scenario import Scenario
from cranectl.simulate import simulate_run
from cranectl.support.consistency import InconsistentError
from cranectl.tools.benchmark.ranking import checked_standing
from cranectl.tools.benchmark.tuning import Point, consistent_points
from cranectl.tools.robustness.certificate.certify import PointVerdict
from cranectl.tools.robustness.certificate.operating_points import OperatingPoint
from cranectl.tools.robustness.ladder import Size

GROUP = GroupSummary(
    plant="analytic", controller="lqr", runs=10, failures=3, stopped={"failed": 1, "rope-slack": 1},
    not_run={"no licence": 1}, broken={"max_error_m": 1}, failure_rate=0.3, failure_rate_interval=(0.1, 0.6),
    median_max_error_m=0.01, q95_max_error_m=0.02, worst_sample=4, worst_max_error_m=0.03,
)  # fmt: skip
POINT = OperatingPoint(rope_length=1.0)
VERDICT = PointVerdict(POINT, 0.4, 1.0, 0.1, 1.0, "whole-gap", 0.3, 0.9)
TOPIC = TopicDescription("/wish", "wish", 3, None)
LOG = LogDescription("a.mcap", 10, "cranectl", 1, 1.0, 3, {}, (TOPIC,), {})
AGREEMENT = Agreement("", "lqr", "analytic", "mujoco", "ideal", 0.1, 0.1, 0.1, 0.1, passed=True, limits="")
POINTS = [Point((1.0,), cost, 0.0) for cost in (3.0, 2.0, 1.0)]  # untuned, half, full


def test_consistent_results_are_accepted() -> None:
    Size(0.1, 0.1, 0.1)
    Size(np.inf, 1e160, 1e160)  # squares that overflow
    checked_standing("lqr", 10, 10, 1.0, 0.0, 1.0, 1.0)
    assert list(consistent_points(*POINTS)) == ["untuned", "half", "full"]
    check_duration(1.0, 1.0, "a move")


def changed_group(**changes: Any) -> Callable[[], Any]:
    return lambda: replace(GROUP, **changes)


def changed_agreement(**changes: Any) -> Callable[[], Any]:
    return lambda: replace(AGREEMENT, **changes)


CONTRADICTIONS: dict[str, Callable[[], Any]] = {
    "failures is 11, above runs, which is 10": changed_group(failures=11),
    "stopped runs is 4, above failures": changed_group(stopped={"rope-slack": 3, "failed": 1}),
    "could not be run is 1, and its parts add up to 2": changed_group(not_run={"no licence": 2}),
    "low end is 0.4, above the failure rate": changed_group(failure_rate_interval=(0.4, 0.6)),
    "the failure rate is 0.3, above its interval's high": changed_group(failure_rate_interval=(0.1, 0.2)),
    "median of max_error_m is 0.05, above": changed_group(median_max_error_m=0.05),
    "95 % quantile is 0.04, above its largest value": changed_group(q95_max_error_m=0.04),
    "stopped or broke one limit is 4, above failures": changed_group(broken={"max_error_m": 2}),
    "difference of a load that passed is 0.2, above its limit": changed_agreement(max_load_error_m=0.2),
    "difference of an angle that passed is 0.2, above its limit": changed_agreement(max_angle_error_rad=0.2),
    "the nu-gap is 1.5, above one": lambda: replace(VERDICT, gap=1.5),
    "left of the margin is 0.5, above the margin": lambda: replace(VERDICT, left=0.5),
    "largest pole of a certified loop is 1.1, above one": lambda: replace(VERDICT, closed_loop_radius=1.1),
    "the RMS deviation is 0.2, above the largest deviation": lambda: Size(0.2, 0.1, 0.0),
    "the final deviation is 0.2, above": lambda: Size(0.1, 0.1, 0.2),
    "failures is 11, above runs of lqr": lambda: checked_standing("lqr", 10, 11, 0.5, 0.5, 1.0, 1.0),
    "share that settled is 1.5, above one": lambda: checked_standing("lqr", 10, 1, 1.5, 0.5, 1.0, 1.0),
    "cost with the whole budget is 3, above that with half": lambda: consistent_points(*POINTS[::-1]),
    "least time .* is 2, above the planned duration of a move": lambda: check_duration(2.0, 1.0, "a move"),
    "failed or were not judged is 4, above cases, which is 3": lambda: WorstPair(
        "ideal", "analytic", "mujoco", 3, 2, 2, 0.1, 0.1, 0.1, "", ""
    ),
    "number of messages is 4, and its parts add up to 3": lambda: replace(LOG, messages=4),
    "number of cases is 0, and its parts add up to 1": lambda: Validation(
        (), CasesOutcome([None], interrupted=False), {}, ("analytic",)
    ),
}


@pytest.mark.parametrize("message", CONTRADICTIONS)
def test_a_contradictory_result_is_an_internal_error(message: str) -> None:
    with pytest.raises(InconsistentError, match=message):
        CONTRADICTIONS[message]()


def test_descending_quantiles_are_an_internal_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(np, "quantile", lambda *_: np.array([3.0, 2.0, 1.0]))
    with pytest.raises(InconsistentError, match=r"the 0\.05 quantile is 3, above the 0\.5 quantile"):
        statistics.quantiles(np.arange(5.0))


def random_number(rng: np.random.Generator) -> float:
    """Draw a number that a result may contain, sometimes zero, infinite or NaN."""
    return float(rng.choice([0.0, 1e-300, rng.exponential(), 1e300, np.inf, np.nan]))


def test_agreements_of_random_numbers_are_consistent(short: Scenario) -> None:
    a, b = (simulate_run(short, plant=plant) for plant in ("analytic", "elastic"))
    comparison, rng = compare_runs(a, b, signals=()), np.random.default_rng(3)
    passed = []
    for _ in range(300):
        changed = replace(
            comparison, max_load_error_m=random_number(rng), max_angle_error_rad=random_number(rng)
        )
        values = np.nan_to_num([random_number(rng), random_number(rng), 1.0], nan=1.0)
        limits = AgreementLimits(*values.tolist(), "")
        passed.append(judge(a, b, limits=limits, comparison=changed).passed)
    assert {*passed} == {True, False}
    assert judge(a, b, limits=NoLimits("unknown"), comparison=comparison).passed is None


def test_summaries_of_random_runs_are_consistent() -> None:
    """Groups have zero to five runs, with all kinds of end status and sizes of error."""
    rng = np.random.default_rng(4)
    for _ in range(200):
        runs = int(rng.integers(0, 6))
        table = {
            "status": rng.choice(["completed", "failed", "slack-rope"], runs),
            "reason": rng.choice(["a", "b"], runs),
            "max_error_m": rng.choice([0.0, 1e-300, 0.1, 0.3, 1e300, np.nan], runs),
            "sample": np.arange(runs),
        }
        limits = SimpleNamespace(given={"max_error_m": float(rng.choice([0.0, 1.0, 1e300]))})
        settings = SimpleNamespace(limits=limits, sampling="monte-carlo")
        results: Any = SimpleNamespace(
            campaign=SimpleNamespace(settings=settings, groups=[("analytic", "lqr")]),
            rows=lambda *_, runs=runs: np.arange(runs),
            column=table.__getitem__,
        )
        _summary(results, "analytic", "lqr")


def test_a_summary_that_omits_runs_is_an_internal_error() -> None:
    settings = SimpleNamespace(limits=SimpleNamespace(given={}), sampling="grid")
    results: Any = MagicMock(campaign=SimpleNamespace(settings=settings, groups=[("analytic", "lqr")]))
    results.__len__.return_value = 3
    results.rows.return_value = np.arange(2)
    results.column = lambda name: np.array(["completed"] * 3) if name in ("status", "reason") else np.ones(3)
    with pytest.raises(InconsistentError, match="number of runs is 3, and its parts add up to 2"):
        summarize(results)

"""Test limits of a scenario on its runs, for all plants or for one, judged by metric."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cranectl.metrics import Limits, Metric, RunMetrics, run_metrics
from cranectl.metrics.limits import LimitVerdict
from cranectl.metrics.runs import metric_course
from cranectl.scenario import Scenario
from cranectl.scenario.load import default_scenario
from cranectl.scenario.run_settings import LimitSettings
from cranectl.support.errors import InputError
from tests.conftest import closed_loop, cut

PLANTS = ("analytic", "mujoco")


def asking(**limits: Any) -> Scenario:
    return default_scenario().model_copy(update={"limits": LimitSettings(**limits)})


def test_a_plants_own_limits_stand_before_those_of_all() -> None:
    scenario = asking(max_error_m=0.1, max_sway_rad=0.2, mujoco={"max_error_m": 0.3, "overshoot_m": 0.4})
    assert Limits.by_plant(scenario, PLANTS) == {
        "analytic": {"max_sway_rad": 0.2, "max_error_m": 0.1},
        "mujoco": {"max_sway_rad": 0.2, "max_error_m": 0.3, "overshoot_m": 0.4},
    }
    assert Limits.by_plant(default_scenario(), ["mujoco"]) == {"mujoco": {}}


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"max_swy_rad": 0.1}, r"\[limits\]: unknown key 'max_swy_rad'"),
        ({"mujoco": {"final_load_m": 0.1}}, r"\[limits\.mujoco\]: unknown key 'final_load_m'"),  # has parts
        ({"mujco": {"max_error_m": 0.1}}, "unknown plant 'mujco'"),
    ],
)
def test_what_cannot_be_asked_is_refused(limits: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Limits.by_plant(asking(**limits), PLANTS)


@pytest.mark.parametrize("value", ["-1.0", "nan", "true", "{max_error_m=-1.0}"])
def test_a_limit_is_a_number_from_zero_on(value: str) -> None:
    with pytest.raises(InputError, match=r"limits\.mujoco"):
        default_scenario(overrides=[f"limits.mujoco={value}"])


def test_a_limit_is_kept_up_to_its_value_and_a_lower_one_down_to_it() -> None:
    values = {"max_error_m": 0.1, "min_rope_tension_n": 5.0, "settling_time_s": None}
    metrics = RunMetrics("completed", 1.0, values)

    def are_kept(**limits: float) -> list[bool]:
        return [verdict.kept for verdict in LimitVerdict.judge(metrics, limits)]

    assert are_kept(max_error_m=0.1, min_rope_tension_n=5.0) == [True, True]
    assert are_kept(max_error_m=0.0999, min_rope_tension_n=5.01) == [False, False]
    assert are_kept(settling_time_s=1e9) == [False], "what a run lacks it has not kept"
    barely = LimitVerdict("max_error_m", 0.1200004, 0.12, kept=False)
    assert barely.fault == "breaks the limit 0.12 m of max_error_m: 0.1200004 m"
    assert LimitVerdict.judge(None, {"max_error_m": 1.0}) == (
        LimitVerdict("max_error_m", None, 1.0, kept=False),
    )
    lost = replace(metrics, values={"max_error_m": float("nan")})
    assert not LimitVerdict.judge(lost, {"max_error_m": 1.0})[0].kept


def test_the_tolerance_of_settling_is_the_scenarios() -> None:
    run = closed_loop("off-reference", "lqr", plant="analytic")
    times = []
    for tolerance in (1e-5, 1e-4, 1e-3):
        settings = run.scenario.metrics.model_copy(update={"settling_tolerance": tolerance})
        scenario = run.scenario.model_copy(update={"metrics": settings})
        times.append(run_metrics(replace(run, scenario=scenario)).settling_time_s)
    assert times[0] > times[1] > times[2] >= 0.0


def test_the_course_of_a_metric_is_what_a_run_that_ends_sooner_has() -> None:
    run = closed_loop("fast-diagonal", "lqr", "mujoco", "velocity")
    for metric in (metric for metric in Metric.all() if metric.limited):
        course = metric_course(run, metric.name)
        for samples in (1, 500, 3100, len(run.time_ns)):
            value = run_metrics(cut(run, samples, end_ns=int(run.time_ns[samples - 1]))).values[metric.name]
            assert course[samples - 1] == value or (value is None and np.isnan(course[samples - 1])), metric


def test_a_limit_is_broken_since_it_was_kept_last() -> None:
    run = closed_loop("fast-diagonal", "lqr", "mujoco", "velocity")
    error = np.linalg.norm(run.reference[:, :3] - run.load_position, axis=1)

    def since(metric: str, limit: float) -> float | None:
        return LimitVerdict(metric, None, limit, kept=False).broken_since(run)

    assert since("max_error_m", 0.05) == run.time[np.argmax(error > 0.05)]
    kept_last = np.flatnonzero(error <= 0.9 * error[-1])[-1]
    assert since("final_error_m", 0.9 * error[-1]) == run.time[kept_last + 1]
    resting = run.time > run_metrics(run).rest_s
    assert since("residual_sway_rad", 0.0) == run.time[resting][0], "of its second sample"
    assert since("max_error_m", 10.0) is None

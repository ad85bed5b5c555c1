"""Test comparisons and verdicts, which must be able to fail, and which runs one log can hold."""

from dataclasses import replace

import numpy as np
import pytest

from cranectl.compare import Differences
from cranectl.compare.agreement import NoLimits, agreement_limits, judge
from cranectl.compare.runs import compare_runs, compared_signals, merged_pair, named_signals
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from tests.conftest import PAIR


@pytest.fixture(scope="module")
def run(short: Scenario) -> Run:
    return simulate_run(short, plant="analytic")


def shifted(run: Run, column: int, amount: float, row: int = 300) -> Run:
    table = run.table.copy()
    table[row, column] += amount
    return replace(run, table=table, plant="mujoco")


def test_a_run_agrees_with_itself(run: Run) -> None:
    comparison = compare_runs(run, run)
    assert comparison.max_load_error_m == comparison.max_angle_error_rad == 0.0
    assert comparison.samples == 501
    assert judge(run, run).passed


def test_difference_is_found_where_and_as_large_as_it_is(run: Run) -> None:
    column = 10  # load.load_x
    row = {d.signal: d for d in compare_runs(run, shifted(run, column, -3e-3)).signals}["load.load_x"]
    assert row.max_abs == pytest.approx(3e-3)
    assert row.at_s == pytest.approx(0.3)
    assert row.rms == pytest.approx(3e-3 / np.sqrt(501))
    assert row.final == 0.0
    assert row.unit == "m"
    other = shifted(shifted(run, 10, 3e-6), 11, 4e-6)
    assert compare_runs(run, other).max_load_error_m == pytest.approx(5e-6), "a distance"


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("column", [6, 8, 10, 11, 12])
def test_judge_fails_above_the_limit_and_passes_below(run: Run, column: int, sign: float) -> None:
    """Both signs of alpha, beta and load x, y, z fail: a comparison without abs would pass one."""
    assert not judge(run, shifted(run, column, sign * 1.1e-7)).passed
    assert judge(run, shifted(run, column, sign * 0.9e-7)).passed


def test_runs_that_ended_differently_do_not_agree(run: Run) -> None:
    assert not judge(run, replace(run, status=RunStatus.SLACK_ROPE)).passed
    shorter = replace(run, time_ns=run.time_ns[:-1], table=run.table[:-1], end_ns=int(run.time_ns[-2]))
    assert not judge(run, shorter).passed
    assert not compare_runs(run, shorter).same_length


def test_different_rates_compare_where_they_meet(run: Run) -> None:
    comparison = compare_runs(run.every(4), run.every(6))
    assert comparison.samples == len(set(range(0, 501, 4)) & {*range(0, 501, 6), 500})
    assert comparison.max_load_error_m == 0.0


def test_no_common_time_is_an_error(run: Run) -> None:
    with pytest.raises(InputError, match="no sample time in common"):
        compare_runs(run, replace(run, time_ns=run.time_ns + 1))


def test_ends_may_differ_up_to_the_limit(run: Run) -> None:
    limits = replace(agreement_limits("velocity"), end_s=0.002)
    earlier = replace(run, plant="mujoco", end_ns=run.end_ns - round(limits.end_s * 1e9))
    assert judge(run, earlier, limits=limits).passed
    assert not judge(run, replace(earlier, end_ns=earlier.end_ns - 1), limits=limits).passed


def test_without_limits_there_is_no_verdict(run: Run) -> None:
    """This holds for any difference and any end of the runs."""
    for other in (shifted(run, 10, 5.0), replace(run, plant="mujoco", status=RunStatus.SLACK_ROPE)):
        agreement = judge(run, other, limits=NoLimits("nobody knows"))
        assert (agreement.passed, agreement.limit_m, agreement.limit_rad) == (None, None, None)
        assert (agreement.verdict, agreement.limits) == ("not judged", "nobody knows")
        assert not judge(run, other).passed


def test_signals_are_listed_by_choice_and_by_group(run: Run) -> None:
    names = [difference.signal for difference in compare_runs(run, run).signals]
    assert names == compared_signals(run)
    assert {name.partition(".")[0] for name in names} == {"state", "load", "input"}
    assert len(names) == 10 + 7 + 6
    chosen = compare_runs(run, shifted(run, 6, 2.0), signals=["controller.zeta", "state.alpha"]).signals
    assert [(row.signal, row.unit, row.max_abs) for row in chosen] == [
        ("controller.zeta", "m/s²", 0.0),
        ("state.alpha", "rad", pytest.approx(2.0)),
    ]
    for name, column in zip(named_signals(run), run.table.T, strict=True):
        assert np.shares_memory(run.signal(name), column), name


def test_a_run_that_is_not_a_number_equals_itself(run: Run) -> None:
    broken = shifted(shifted(run, 10, np.nan), 11, np.inf)
    rows = {row.signal: row for row in compare_runs(broken, broken).signals}
    assert rows["load.load_x"].max_abs == rows["load.load_y"].max_abs == 0.0
    one = {row.signal: row for row in compare_runs(run, broken).signals}
    assert np.isnan(one["load.load_x"].max_abs)
    assert one["load.load_y"].max_abs == np.inf
    assert not judge(broken, broken).passed, "not a number keeps no limit of the plants"


def test_what_differs_in_scenarios_and_designs_is_named(short: Scenario) -> None:
    def changed(**update: object) -> Run:
        return replace(run, scenario=short.model_copy(update=update))

    run = simulate_run(short, plant="analytic")
    assert Differences.of(run, run) == ()
    other = replace(run, design=ALL_CONTROLLERS.design("lqr+hinf", short), drive="velocity")
    assert Differences.of(run, other) == (
        "controller: pole-placement and lqr+hinf",
        "drive: ideal and velocity",
    ), "designs of different controllers have nothing in common"
    assert Differences.of(run, changed(duration=1.0)) == ("duration: 0.5 and 1.0",)
    heavier = short.rig.model_copy(update={"load_mass": 2.0})
    assert Differences.of(run, changed(rig=heavier)) == ("rig.load_mass: 1.0 and 2.0",)
    fewer = Differences.of(run, changed(disturbances=short.disturbances[:1]))
    assert "disturbances.1.joint: beta and nothing" in fewer
    assert all(field.startswith("disturbances.1.") for field in fewer)
    gain = run.design.gain * np.array([1.0, 1.0, 1.0, 2.0])
    retuned = replace(run, design=replace(run.design, gain=gain))
    assert Differences.of(run, retuned) == (f"controller.gain.3: {gain[3] / 2} and {gain[3]}",)
    third = replace(run, design=replace(run.design, gain=gain / 3.0))
    assert f"controller.gain.3: {gain[3] / 2} and {gain[3] / 3:.6g}" in Differences.of(run, third)
    nearly = changed(duration=np.nextafter(0.5, 1.0))
    assert Differences.of(run, nearly) == ("duration: 0.5 and 0.5000000000000001",)


@pytest.fixture(scope="module")
def pair(short: Scenario) -> tuple[Run, Run]:
    analytic, mujoco = (simulate_run(short, plant=plant, controller="lqr").every(4) for plant in PAIR)
    return analytic, mujoco


def test_analytic_comes_first_and_nothing_is_left_out(pair: tuple[Run, Run]) -> None:
    for a, b in (pair, pair[::-1]):
        merged = merged_pair(a, b)
        assert all(run is before for run, before in zip(merged, pair, strict=True))


def test_ends_may_differ(pair: tuple[Run, Run]) -> None:
    a, b = pair
    shorter = replace(b, time_ns=b.time_ns[:9].copy(), table=b.table[:9], reference=b.reference[:9])
    shorter.time_ns[-1] -= 1_000_000  # the last sample of a run that stops lies anywhere
    assert len(merged_pair(a, shorter)[1].time_ns) == 9


def test_what_one_log_cannot_hold(short: Scenario, pair: tuple[Run, Run]) -> None:
    a, b = pair

    def refused(other: Run, expected: str) -> None:
        with pytest.raises(InputError, match=expected):
            merged_pair(a, other)

    refused(a, "both logs hold the run of analytic")
    refused(replace(b, drive="velocity"), "different drives, ideal and velocity")
    other = simulate_run(short, plant="mujoco", controller="lqr+hinf").every(4)
    refused(other, r"different controllers, lqr and lqr\+hinf")
    refused(replace(other, design=replace(other.design, name="lqr")), "different numbers of recorded signals")
    refused(simulate_run(short, plant="mujoco", controller="lqr"), "different times of their samples")
    unstarted = replace(b, time_ns=b.time_ns[:0], table=b.table[:0], reference=b.reference[:0])
    refused(unstarted, "no samples in common")
    overrides = ["duration=0.5", "disturbances=[]", "reference.start=[1.0,0.7,-0.7]"]
    moved = load_scenario("fixed-position", overrides=overrides)
    refused(simulate_run(moved, plant="mujoco", controller="lqr").every(4), "different references")


def test_differences_are_named_up_to_ten() -> None:
    Differences().refuse("nothing", described="analytic")
    with pytest.raises(InputError) as caught:
        Differences(f"field{k}: 1 and 2" for k in range(12)).refuse(
            "the runs differ in", described="analytic"
        )
    assert "field0: 1 and 2; " in caught.value.found
    assert caught.value.found.endswith("field9: 1 and 2; 2 more")
    assert "--despite-differences" in caught.value.remedy

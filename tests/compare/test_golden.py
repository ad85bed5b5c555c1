"""Judge a run against a golden one: pass within limits, fail beyond them, and refuse incomplete limits."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.compare.golden import RegressionVerdict, SignalVerdict, Tolerances
from cranectl.compare.runs import COMPARED_GROUPS, named_signals
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from cranectl.support.resources import Shipped
from tests.conftest import ALL_CONTROLLERS, cut

ALPHA_RATE, LOAD_X = 7, 10  # columns of the table


@pytest.fixture(scope="module")
def run(short: Scenario) -> Run:
    return simulate_run(short, plant="analytic", controller="lqr+hinf").every(4)


def shifted(run: Run, column: int, amount: float, row: int = 50) -> Run:
    table = run.table.copy()
    table[row, column] += amount
    return replace(run, table=table)


def tolerances(*limits: Sequence[Any], end_s: float = 0.0) -> Tolerances:
    """Return tolerances from tuples (pattern, absolute, relative), where relative is optional."""
    tables = [dict(zip(("signals", "absolute", "relative"), limit, strict=False)) for limit in limits]
    return Tolerances.from_table({"end_s": end_s, "limits": tables}, "limits.toml")


EXACT = tolerances(("*", 0.0))


def failed(verdict: RegressionVerdict) -> list[str]:
    return [row.signal for row in verdict.signals if not row.passed]


def test_the_worst_is_the_most_times_its_limit() -> None:
    sizes = [(1e-3, 1e-3), (3.0, 2.0), (1e-9, 0.0), (np.nan, 1.0), (1e-8, 0.0), (0.0, 0.0)]
    verdicts = [
        SignalVerdict(name, "m", size, 0.0, limit, passed=False)
        for name, (size, limit) in zip("abcdef", sizes, strict=True)
    ]
    verdict = RegressionVerdict(
        "mujoco", 1, "completed", "completed", 0.0, 0.0, tuple(verdicts), same_status=True, ends_passed=True
    )
    assert [signal.signal for signal in verdict.worst_first] == ["d", "e", "c", "b", "a", "f"]


def test_an_identical_run_passes_with_all_tolerances_zero(run: Run) -> None:
    verdict = EXACT.judge(run, run)
    assert verdict.passed
    assert verdict.samples == 126
    assert [row.signal for row in verdict.signals] == list(named_signals(run))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_every_signal_is_judged(run: Run, sign: float) -> None:
    for column, name in enumerate(named_signals(run)):
        verdict = EXACT.judge(shifted(run, column, sign * 1e-6), run)
        assert failed(verdict) == [name]
        assert not verdict.passed


def test_the_limit_itself_is_kept_and_the_place_of_the_worst_is_told(run: Run) -> None:
    zero = replace(run, table=np.zeros_like(run.table))
    limits = tolerances(("load.load_x", 2.0**-10), ("*", 0.0))
    assert limits.judge(shifted(zero, LOAD_X, -(2.0**-10)), zero).passed
    verdict = limits.judge(shifted(zero, LOAD_X, np.nextafter(2.0**-10, 1.0)), zero)
    (row,) = (row for row in verdict.signals if not row.passed)
    assert (row.signal, row.unit, row.at_s, row.limit) == ("load.load_x", "m", 0.2, 2.0**-10)
    assert row.max_abs == np.nextafter(2.0**-10, 1.0)


def test_relative_limits_are_of_the_golden_runs_largest_magnitude(run: Run) -> None:
    golden = replace(run, table=np.zeros_like(run.table))
    golden = shifted(golden, LOAD_X, -8.0, row=3)
    limits = tolerances(("load.load_x", 0.5, 0.25), ("*", 0.0))
    assert limits.judge(shifted(golden, LOAD_X, 2.0), golden).passed
    assert not limits.judge(shifted(golden, LOAD_X, 2.01), golden).passed
    wider = tolerances(("load.load_x", 3.0, 0.25), ("*", 0.0))
    larger = wider.judge(shifted(golden, LOAD_X, 3.0), golden)
    assert larger.passed, "the larger of the two counts"
    huge = shifted(golden, LOAD_X, 100.0)
    assert not limits.judge(huge, golden).passed, "the new run's own magnitude widens nothing"


def test_the_first_match_counts(run: Run) -> None:
    new = shifted(run, ALPHA_RATE, 1e-3)
    assert tolerances(("*.alpha_rate", 2e-3), ("state.*", 0.0), ("*", 0.0)).judge(new, run).passed
    strict = tolerances(("*.alpha_rate", 0.0), ("state.*", 2e-3), ("*", 0.0))
    assert failed(strict.judge(new, run)) == ["state.alpha_rate"]


def test_not_a_number_keeps_no_limit_but_is_itself(run: Run) -> None:
    wide = tolerances(("*", 1e300, 1e300))
    broken = shifted(run, LOAD_X, np.nan)
    assert failed(wide.judge(broken, run)) == ["load.load_x"]
    assert failed(wide.judge(run, broken)) == ["load.load_x"]
    assert EXACT.judge(broken, broken).passed
    infinite = shifted(run, LOAD_X, np.inf)
    assert EXACT.judge(infinite, infinite).passed
    narrow = tolerances(("*", 0.0, 1e-3))
    assert not narrow.judge(shifted(infinite, LOAD_X, 1.0, row=9), infinite).passed


def test_runs_must_end_alike(run: Run) -> None:
    stopped = replace(run, status=RunStatus.SLACK_ROPE)
    verdict = EXACT.judge(stopped, run)
    assert (verdict.status, verdict.golden_status, verdict.passed) == ("slack-rope", "completed", False)
    assert failed(verdict) == []
    for sign in (1, -1):
        later = replace(run, end_ns=run.end_ns + sign * 20_000_000)
        assert tolerances(("*", 0.0), end_s=0.02).judge(later, run).passed
        verdict = tolerances(("*", 0.0), end_s=0.0199).judge(later, run)
        assert not verdict.passed
        assert verdict.end_difference_s == 0.02
        assert verdict.to_json()["passed"] is False


def test_other_groups_are_judged_if_a_pattern_matches_them(run: Run) -> None:
    compared = tolerances(*((f"{group}.*", 0.0) for group in COMPARED_GROUPS))
    names = [row.signal for row in compared.judge(run, run).signals]
    assert names == [name for name in named_signals(run) if name.partition(".")[0] in COMPARED_GROUPS]
    more = tolerances(*((f"{group}.*", 0.0) for group in (*COMPARED_GROUPS, "error")), ("*.zeta", 0.0))
    added = [row.signal for row in more.judge(run, run).signals if row.signal not in names]
    assert len(added) == 13
    assert added[-1] == "controller.zeta"


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ([("stat.*", 0.0), ("*", 0.0)], r"no signal matches 'stat.\*'"),
        ([("analytic.state.*", 0.0), ("*", 0.0)], r"did you mean 'state.\*'"),
        (
            [("*", 0.0), ("state.alpha", 1.0)],
            r"'state.alpha' never counts: '\*' before it has all its signals",
        ),
        ([("state.a*", 0.0), ("*.beta*", 0.0), ("state.*a", 0.0)], "'state.a*', '*.beta*' before it"),
        ([("state.*", 0.0), ("load.load_*", 0.0), ("input.*", 0.0)], "no limit for load.rope_tension"),
        ([], "no limit for state.bridge_position"),
    ],
)
def test_limits_that_would_not_judge_what_they_say(run: Run, limits: list[Any], expected: str) -> None:
    with pytest.raises(InputError) as caught:
        tolerances(*limits).judge(run, run)
    assert expected.replace("\\", "") in str(caught.value)


def test_signals_that_only_one_run_has(short: Scenario, run: Run) -> None:
    plain = simulate_run(short, plant="analytic", controller="lqr").every(4)
    for pair in ((run, plain), (plain, run)):
        with pytest.raises(
            InputError, match=r"only one of the runs has controller.robustifier_x_1"
        ) as caught:
            EXACT.judge(*pair)
        names = [run.design.name for run in pair[::-1]]
        assert f"the controllers are {' and '.join(names)}: " in caught.value.found
        assert len(caught.value.found) < 400
    both = [("controller.zeta*", 9.0), *((f"{group}.*", 9e9) for group in COMPARED_GROUPS)]
    assert tolerances(*both).judge(run, plain).passed


def test_a_new_run_must_have_the_golden_samples(short: Scenario, run: Run) -> None:
    full = simulate_run(short, plant="analytic", controller="lqr+hinf")
    assert EXACT.judge(full, run).samples == 126
    with pytest.raises(InputError, match="lacks 375 of 501 samples of the golden one"):
        EXACT.judge(run, full)
    # A golden run that stopped has its last sample between those of a new one that ran on.
    stopped = cut(full, 204, end_ns=int(full.time_ns[203])).every(4)
    assert tolerances(("*", 0.0), end_s=1.0).judge(run, stopped).passed


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("limits = []", "'end_s' is missing"),
        ("end_s = nan\nlimits = []", "finite"),
        ("end_s = 0\n[[limits]]\nsignals = '*'\nabsolut = 0.0\nabsolute = 0.0", "did you mean 'absolute'?"),
        ("end_s = 0\n[[limits]]\nsignals = '*'\nabsolute = 0\nrelative = -1e-3", "or equal to 0"),
        ("end_s", "not valid TOML"),
    ],
)
def test_files_are_read_strictly(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "limits.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        Tolerances.load(str(path))
    assert expected in str(caught.value)
    assert "limits.toml" in str(caught.value)
    with pytest.raises(InputError, match=r"cannot read absent\.toml"):
        Tolerances.load("absent.toml")


@pytest.mark.parametrize("controller", ALL_CONTROLLERS)
def test_shipped_tolerances_fit_every_controller(short: Scenario, controller: str) -> None:
    assert Shipped.REGRESSIONS.names() == ["exact", "rounding"]
    run = simulate_run(short, plant="analytic", controller=controller).every(4)
    for name in Shipped.REGRESSIONS.names():
        assert Tolerances.load(name).judge(run, run).passed


def test_rounding_passes_and_more_than_rounding_fails(run: Run) -> None:
    rounding = Tolerances.load("rounding")
    rounded = replace(run, table=run.table * (1.0 + 1e-9))
    assert not Tolerances.load("exact").judge(rounded, run).passed
    assert rounding.judge(rounded, run).passed
    compared = [name for name in named_signals(run) if name.partition(".")[0] in COMPARED_GROUPS]
    for column, name in enumerate(named_signals(run)):
        largest = np.abs(run.table[:, column]).max()
        verdict = rounding.judge(shifted(run, column, max(1e-3, 1e-3 * largest)), run)
        assert failed(verdict) == ([name] if name in compared else [])

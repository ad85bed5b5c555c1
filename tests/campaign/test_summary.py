"""Compare failures, limits and quantiles of a result with numbers computed in another way."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from cranectl.campaign.replay import chosen_rows, differences
from cranectl.campaign.report.tables import CampaignTables
from cranectl.campaign.results import Results, read_results
from cranectl.campaign.summary import failed, failure_interval, summarize, worst_first
from cranectl.campaign.table import METRIC_COLUMNS
from cranectl.cli.output import screen_table
from cranectl.design import CONTROLLERS
from cranectl.metrics.limits import Limits
from cranectl.support.errors import InputError
from tests.campaign.campaigns import MASS
from tests.campaign.results import two_controllers, write_all


def results_of(tmp_path: Path, **changes: Any) -> Results:
    write_all(two_controllers(**changes), tmp_path)
    return read_results(tmp_path)


def test_failures_quantiles_and_the_worst(tmp_path: Path) -> None:
    results = results_of(tmp_path)
    lqr, pole_placement = summarize(results)
    assert (lqr.controller, pole_placement.controller) == ("lqr", "pole-placement")
    assert lqr.runs == pole_placement.runs == 40
    assert (lqr.failures, lqr.failure_rate) == (4, 0.1)  # samples 7, 17, 27, 37
    assert (lqr.stopped, lqr.broken) == ({"slack-rope": 4}, {})
    assert CampaignTables.failure_notes([lqr]) == ["lqr: 4 slack-rope"]
    table = results.table.to_pylist()[:40]
    completed = sorted(row["max_error_m"] for row in table if row["status"] == "completed")
    assert lqr.median_max_error_m == 0.5 * (completed[17] + completed[18])
    assert lqr.q95_max_error_m == pytest.approx(completed[33] + 0.25 * (completed[34] - completed[33]))
    worst = max(table, key=lambda row: row["max_error_m"])  # of all that have one
    assert (lqr.worst_sample, lqr.worst_max_error_m) == (worst["sample"], worst["max_error_m"])


def test_limits_make_completed_runs_fail(tmp_path: Path) -> None:
    limits = {"max_error_m": 0.9, "settling_time_s": 0.8, "min_rope_tension_n": 0.05}
    results = results_of(tmp_path, limits=limits)
    bad = failed(results.column, limits)
    for row, is_bad in zip(results.table.to_pylist(), bad.tolist(), strict=True):
        good = (
            row["status"] == "completed" and row["max_error_m"] <= 0.9 and row["min_rope_tension_n"] >= 0.05
        )
        assert is_bad != (good and row["settling_time_s"] <= 0.8)
    (group, _) = summarize(results)
    assert group.failures == bad[:40].sum() > 4
    assert set(group.broken) <= set(limits)
    assert sum(group.broken.values()) >= group.failures - 4


def test_a_metric_that_is_absent_breaks_its_limit() -> None:
    assert set(Limits.model_fields) <= set(METRIC_COLUMNS)
    rows = {"status": ["completed"] * 3, "overshoot_m": [None, np.nan, 0.0]}
    assert failed(rows.__getitem__, {"overshoot_m": 10.0}).tolist() == [True, True, False]
    assert not failed(rows.__getitem__, {}).any()


def test_wilsons_interval() -> None:
    """The formula of Newcombe (1998) gives 0.0179 and 0.4042 for 1 failure in 10."""
    assert failure_interval(1, 10) == pytest.approx((0.0178762, 0.4041500), abs=1e-6)
    z = 1.959963984540054
    for k, n in ((0, 50), (7, 1000), (30, 30)):
        p = k / n
        centre = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        assert failure_interval(k, n) == pytest.approx((centre - half, centre + half), abs=1e-12)


def test_without_a_random_sample_or_any_run_there_are_no_figures(tmp_path: Path) -> None:
    grid = {"rig": {"load_mass": {**MASS, "levels": 5}}}
    (group, _) = summarize(results_of(tmp_path / "grid", uncertain=grid, sampling="grid", runs=None))
    assert (group.runs, group.failure_rate_interval) == (5, None)
    write_all(two_controllers(), tmp_path / "empty", leave=6)
    (group, _) = summarize(read_results(tmp_path / "empty", unfinished=True))
    assert (group.runs, group.failures, group.failure_rate, group.worst_sample) == (0, 0, None, None)


def test_the_worst_come_first(tmp_path: Path) -> None:
    results = results_of(tmp_path)
    errors = results.column("max_error_m")
    rows = worst_first(results, "max_error_m")
    assert np.all(np.diff(errors[rows]) <= 0.0)
    assert rows[:2].tolist() == sorted(rows[:2].tolist()), "equals keep their order"
    tension = results.column("min_rope_tension_n")[worst_first(results, "min_rope_tension_n")]
    assert np.all(np.diff(tension) >= 0.0)
    assert len(worst_first(results, "settling_time_s")) == 80 - 8


def test_rows_are_chosen_by_what_is_asked(tmp_path: Path) -> None:
    results = results_of(tmp_path)

    def chosen(*samples: int, worst: int = 3, metric: str = "max_error_m", **names: Any) -> list[int]:
        return chosen_rows(results, samples=samples, worst=worst, metric=metric, **names)

    assert chosen() == worst_first(results, "max_error_m")[:3].tolist()
    assert chosen(5, 7) == [5, 7, 45, 47]
    assert chosen(5, controllers=["pole-placement"]) == [45]
    assert all(row >= 40 for row in chosen(worst=9, controllers=["pole-placement"]))
    for wrong in (
        lambda: chosen(40),
        lambda: chosen(-1),
        lambda: chosen(metric="max_eror_m"),
        lambda: chosen(plants=["analytic"]),
        lambda: chosen(controllers=["lqr+hinf"]),
    ):
        with pytest.raises(InputError) as caught:
            wrong()
        assert caught.value.allowed


def test_one_bit_is_a_difference() -> None:
    recorded = {"a": 0.1, "b": 0.0, "c": None, "d": float("nan"), "status": "completed"}
    assert differences(recorded, dict(recorded)) == []
    for name, value in (("a", np.nextafter(0.1, 1.0)), ("b", -0.0), ("c", 0.0), ("d", 0.0), ("a", None)):
        assert len(differences(recorded, recorded | {name: value})) == 1
    assert differences(recorded, {"status": "slack-rope"}) == ["status is 'slack-rope', was 'completed'"]


def test_the_table_fits_a_terminal_of_80_columns(tmp_path: Path) -> None:
    results = results_of(tmp_path, controllers=list(CONTROLLERS), runs=2)
    screen = Console(width=80, record=True, quiet=True)
    with screen.capture() as capture:
        screen.print(screen_table(CampaignTables.summary(summarize(results), "title")))
    text = capture.get()
    assert "…" not in text
    assert all(len(line.rstrip()) <= 80 for line in text.splitlines())

"""The judged table gets new digests only if its repeated rows equal the stored ones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cranectl.campaign.table import FAILED
from cranectl.support.documents import TOML
from cranectl.support.provenance import Provenance
from cranectl.tools.benchmark.table import BenchmarkTable
from cranectl.tools.benchmark.trials import Trial
from validation.proofs import restamp

ROWS = 2
CHOSEN = ("nominal", "pulse")


@pytest.fixture
def table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> BenchmarkTable:
    """Return the shipped table, restricted to two controllers, and redirect `restamp` to a copy."""
    table = BenchmarkTable.read(restamp.TABLE)
    controllers = ["lqr", "lqr-integral"]
    monkeypatch.setattr(restamp, "measured_controllers", lambda *_args, **_settings: controllers)
    for controller in controllers:
        restamp.stamp_numbers(controller, "old", restamp.NUMBERS[0], tmp_path)
    monkeypatch.setattr(restamp, "NUMBERS", (tmp_path,))
    monkeypatch.setattr(restamp, "TABLE", tmp_path / "table.parquet")
    return replace(table, about={**table.about, "rules": "old"})


def write(table: BenchmarkTable) -> bytes:
    """Write the table to the redirected file, and return its bytes."""
    BenchmarkTable.write(restamp.TABLE, table)
    return restamp.TABLE.read_bytes()


def test_equal_rows_get_new_digests(table: BenchmarkTable) -> None:
    write(table)
    assert restamp.restamp(ROWS, []) == 0
    stamped, rules = BenchmarkTable.read(restamp.TABLE), restamp.rules_of(restamp.BENCHMARK)
    assert stamped.about == {**table.about, "rules": rules}
    assert stamped.trials.keys() == table.trials.keys()
    for numbers in restamp.NUMBERS[0].glob("*.toml"):
        assert TOML.read(numbers)["rules"] == rules


def test_nothing_is_written_if_one_digit_differs(
    table: BenchmarkTable, capsys: pytest.CaptureFixture[str]
) -> None:
    trial, sample = next(restamp.sampled_rows(table, ["lqr", "lqr-integral"], ROWS))
    metrics = {name: values.copy() for name, values in table.trials[trial].metrics.items()}
    metrics["rms_error_m"][sample] *= 1.001
    changed = replace(table, trials={**table.trials, trial: replace(table.trials[trial], metrics=metrics)})
    before = write(changed)
    assert restamp.restamp(ROWS, []) == 1
    assert "rms_error_m" in capsys.readouterr().out
    assert restamp.TABLE.read_bytes() == before
    assert all(TOML.read(numbers)["rules"] == "old" for numbers in restamp.NUMBERS[0].glob("*.toml"))


def test_all_rows_of_named_controllers_are_judged_again(table: BenchmarkTable) -> None:
    """Their rows are replaced, with the software that made them; no other row may differ."""
    few = {
        trial: runs
        for trial, runs in table.trials.items()
        if trial.controller in ("lqr", "lqr-integral") and (trial.crane_set, trial.scenario) == CHOSEN
    }
    table = replace(table, trials=few)
    wrong = {
        trial: replace(runs, metrics={**runs.metrics, "effort_m_s2": 2.0 * runs.metrics["effort_m_s2"]})
        for trial, runs in few.items()
        if trial.controller == "lqr"
    }
    write(replace(table, trials={**few, **wrong}))
    before = restamp.TABLE.read_bytes()
    assert restamp.restamp(ROWS, [], ["lqr-integral"]) == 1
    assert restamp.TABLE.read_bytes() == before
    assert restamp.restamp(ROWS, [], ["lqr"]) == 0
    judged = BenchmarkTable.read(restamp.TABLE)
    for trial, runs in few.items():
        assert judged.trials[trial].status == runs.status
        for name, values in runs.metrics.items():
            assert np.array_equal(judged.trials[trial].metrics[name], values, equal_nan=True), (trial, name)
    *old, new = judged.about["made_by"]
    assert old == table.about["made_by"]
    assert new["sources"] == Provenance.fingerprints()["sources"]


def test_a_crane_that_cannot_be_simulated_runs_again_like_others() -> None:
    """It has no metrics, and its neighbour has some."""
    table, rules = BenchmarkTable.read(restamp.TABLE), restamp.rules_of(restamp.BENCHMARK)
    trial = Trial("published", "mujoco", "spread-4", "hoist-and-go", "lqr")
    judged = table.trials[trial._replace(division="tuned")]
    sample = max(judged.status.index(FAILED) - 1, 0)
    samples = range(sample, sample + 2)
    again = restamp.run_again(trial, samples, rules, restamp.NUMBERS[0])
    assert again.status.count(FAILED) == judged.status[sample : sample + 2].count(FAILED) == 1
    assert np.isnan(again.metrics["effort_m_s2"]).tolist() == [s == FAILED for s in again.status]

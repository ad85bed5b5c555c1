"""What a case does once for all of its plants."""

from pathlib import Path

import pytest

from cranectl.cases.case import make_case, run_case
from cranectl.plants.registry import PLANTS
from cranectl.scenario import Scenario
from cranectl.simulate import runner


def test_a_law_is_prepared_once_for_all_plants(
    short: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepared, prepare = [], runner.addressed_law

    def counted(*arguments):
        prepared.append(prepare(*arguments))
        return prepared[-1]

    monkeypatch.setattr(runner, "addressed_law", counted)
    result = run_case(make_case(short, controller="lqr-integral", log=tmp_path / "a.mcap"))
    assert [run.plant for run in result.runs] == list(PLANTS)
    assert result.passed
    assert len(prepared) == 1

"""What a case does once for all of its plants."""

from pathlib import Path

import pytest

from cranectl.cases.case import make_case, run_case
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import runner
from tests.conftest import PLANTS


@pytest.mark.parametrize("controller", ["lqr", "lqr-integral"])
def test_a_law_is_prepared_once_for_all_plants(
    controller: str, short: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepared, prepare = [], runner.compile_controller

    def counted(*arguments):
        prepared.append(prepare(*arguments))
        return prepared[-1]

    monkeypatch.setattr(runner, "compile_controller", counted)
    result = run_case(make_case(short, controller=controller, log=tmp_path / "a.mcap"))
    assert [run.plant for run in result.runs] == list(PLANTS)
    assert result.passed
    assert len(prepared) == 1


def test_what_drives_could_not_do_is_said_where_nothing_limits_them(tmp_path: Path) -> None:
    """A quick pick on ideal drives; with limits, or at leisure, nothing is said."""
    line = "reference.segments=[{{kind='line', to=[1.5,0.77,-0.7], duration={}}}]"

    def said(duration: float, *overrides: str, drive: str = "ideal") -> str:
        scenario = load_scenario("fixed-position", overrides=[
            "disturbances=[]", "duration=4.0", line.format(duration), *overrides])  # fmt: skip
        case = make_case(scenario, controller="lqr", drive=drive, plants=["mujoco"], log=tmp_path / "a.mcap")
        return run_case(case).runs[0].beyond_drives

    quick = said(0.9)
    assert "m/s² of the bridge" in quick
    asked, ratio = (float(quick.split(word)[1].split()[0]) for word in ("asks ", "bridge, "))
    assert asked / RigParameters().effects.limits.acceleration[0] == pytest.approx(ratio, rel=0.01)
    assert ratio > 1.5
    assert said(4.0) == said(1.4, "effects.limits={}", drive="velocity") == ""

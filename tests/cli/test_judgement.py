"""One judgement in every command: of other rigs none without --predict, of a log that of its run."""

import json
from pathlib import Path

import pytest

from cranectl.analysis.budget.predicted_limits import predicted_limits
from cranectl.cli.main import main
from cranectl.compare.agreement import Limits
from cranectl.design import design_controller
from cranectl.reference import load_scenario
from tests.cli.arguments import STOP
from tests.log.test_log import messages_of

pytestmark = pytest.mark.usefixtures("in_empty_directory")

OVERRIDES = ["duration=1.0", "disturbances=[]", "reference.segments=[]", "rig.load_mass=2.0"]
OVERRIDES += ["initial.load_offset=[0.02,0,0]"]
OWN = ["fast-diagonal", *(part for override in OVERRIDES for part in ("--set", override))]
OWN += ["--controller", "lqr", "--plants", "analytic,mujoco", "--drive", "velocity"]
LOG = "logs/fast-diagonal/lqr-velocity.mcap"


def judged(*arguments: str, code: int = 0) -> dict[str, object]:
    """The agreement that a command gives as JSON."""
    assert main([*arguments, "--json", "result.json"]) == code
    result = json.loads(Path("result.json").read_text())
    agreement = result["agreement"] if "agreement" in result else result["agreements"][0]
    assert isinstance(agreement, dict)
    return agreement


def test_a_rig_of_ones_own_is_not_judged_by_the_limits_of_another(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["run", *OWN], ["compare", LOG], ["info", LOG]):
        result = judged(*arguments)
        assert (result["passed"], result["limit_m"], result["limit_rad"]) == (None, None, None), arguments
        out = capsys.readouterr().out
        assert "not judged" in out
        assert "--predict" in out
        assert "FAILED" not in out
    assert main(["validate", *OWN, "--drive", "both", "--jobs", "1", "--json", "result.json"]) == 0
    out = capsys.readouterr().out
    assert "yes (ideal)" in out
    assert "validation passed (1 of 2 pairs not judged)" in out
    data = json.loads(Path("result.json").read_text())
    assert data["passed"] is True
    assert [agreement["passed"] for agreement in data["agreements"]] == [True, None]
    ((_, verdict),) = messages_of(Path(LOG), "/diff/verdict")
    assert verdict.verdict == "not judged"
    assert "no limit: how far the analytic plant" in verdict.load


def test_with_predict_it_is_judged_by_its_own_bound() -> None:
    scenario = load_scenario("fast-diagonal", overrides=OVERRIDES)
    limits = predicted_limits(scenario, design_controller("lqr", scenario.design))
    assert isinstance(limits, Limits)
    for arguments in (["run", *OWN], ["validate", *OWN, "--jobs", "1"], ["compare", LOG], ["info", LOG]):
        result = judged(*arguments, "--predict")
        assert result["passed"] is True, arguments
        assert (result["limit_m"], result["limit_rad"]) == (limits.load_m, limits.angle_rad)
        assert result["limits"] == limits.source
    ((_, verdict),) = messages_of(Path(LOG), "/diff/verdict")
    assert verdict.verdict == "passed"
    assert verdict.load.endswith(f"limit {limits.load_m:g} m, {limits.source}")


def test_a_predicted_bound_can_be_exceeded(monkeypatch: pytest.MonkeyPatch) -> None:
    narrow = Limits(1e-12, 1e-12, 0.0, "", "mine")
    monkeypatch.setattr("cranectl.analysis.budget.predicted_limits.predicted_limits", lambda *_: narrow)
    for command in (["run", *OWN], ["validate", *OWN, "--jobs", "1"], ["compare", LOG]):
        assert judged(*command, "--predict", code=1)["passed"] is False


def test_compare_ends_with_the_code_of_the_run_that_wrote_the_log(monkeypatch: pytest.MonkeyPatch) -> None:
    """A limit exceeded, an end that was not expected, one that was."""
    ideal = [*OWN[:-1], "ideal", "--out", "a.mcap"]
    assert main(["run", *ideal]) == main(["compare", "a.mcap"]) == 0
    with monkeypatch.context() as patched:
        patched.setattr(
            "cranectl.compare.agreement.agreement_limits", lambda *_, **__: Limits(1e-16, 1e-16, 0.0, "")
        )
        assert main(["run", *ideal]) == main(["compare", "a.mcap"]) == 1
    assert main(["run", *ideal, *STOP]) == 3
    assert judged("compare", "a.mcap", code=1)["passed"] is True, "they stop alike, but should not stop"
    assert main(["run", "slack-rope", "--drive", "velocity", "--out", "b.mcap"]) == 3
    assert judged("compare", "b.mcap")["passed"] is True, "they stop as they should"


def test_predict_is_refused_where_nothing_is_judged(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "a.mcap", "b.mcap", "--predict"]) == 2
    assert "one log of both plants" in capsys.readouterr().err

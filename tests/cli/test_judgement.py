"""All commands judge the agreement of plants with the same limits, for every rig, for runs and for logs."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.compare.agreement import EARLIER_DRIVES, LAGGING_MODEL, AgreementLimits, agreement_limits
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from tests.cli.arguments import STOP
from tests.log.viewer import messages_of

pytestmark = pytest.mark.usefixtures("in_empty_directory")

OVERRIDES = ["duration=1.0", "disturbances=[]", "reference.segments=[]", "rig.load_mass=2.0"]
OVERRIDES += ["initial.load_offset=[0.02,0,0]"]
OWN = ["fast-diagonal", *(part for override in OVERRIDES for part in ("--set", override))]
OWN += ["--controller", "lqr", "--plants", "analytic,mujoco", "--drive", "velocity"]
LOG = "logs/fast-diagonal/lqr-velocity.mcap"


def judged(*arguments: str, code: int = 0) -> dict[str, object]:
    """Return the agreement that a command writes as JSON."""
    assert main([*arguments, "--json", "result.json"]) == code
    result = json.loads(Path("result.json").read_text())
    agreement = result["agreement"] if "agreement" in result else result["agreements"][0]
    assert isinstance(agreement, dict)
    return agreement


def test_an_own_rig_is_judged_with_the_same_limits() -> None:
    limits = agreement_limits("velocity")
    for arguments in (["run", *OWN], ["validate", *OWN, "--jobs", "1"], ["compare", LOG], ["info", LOG]):
        result = judged(*arguments)
        assert result["passed"] is True, arguments
        assert (result["limit_m"], result["limit_rad"]) == (limits.load_m, limits.angle_rad)
    ((_, verdict),) = messages_of(Path(LOG), "/diff/verdict")
    assert verdict.verdict == "passed"
    assert verdict.load.endswith(f"limit {limits.load_m:g} m")


def test_a_log_of_lags_without_load_is_read_but_not_judged(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Earlier versions wrote such logs, in which the drives of the analytic plant ignore the load."""
    scenario = load_scenario("fast-diagonal", overrides=OVERRIDES)
    analytic, mujoco = (simulate_run(scenario, plant=p, drive="velocity") for p in ("analytic", "mujoco"))
    write_log(Path("old.mcap"), [replace(analytic, model=LAGGING_MODEL), mujoco])
    for command in ("compare", "info"):
        result = judged(command, "old.mcap")
        assert (result["passed"], result["limits"]) == (None, EARLIER_DRIVES.reason)
        out = " ".join(capsys.readouterr().out.split())
        assert "not judged" in out
        assert "lags that do not feel the load" in out


@pytest.mark.parametrize("command", ["run", "validate", "compare", "info", "report"])
def test_the_removed_option_predict_names_its_replacement(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, "fast-diagonal", "--predict"]) == 2
    error = capsys.readouterr().err
    assert "judged by the same limits with every scenario and rig" in " ".join(error.split())
    assert "leave it out" in error


def test_compare_has_the_exit_code_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cases: all right, a limit is exceeded, the run stops unexpectedly, the run stops as expected."""
    ideal = [*OWN[:-1], "ideal", "--out", "a.mcap"]
    assert main(["run", *ideal]) == main(["compare", "a.mcap"]) == 0
    with monkeypatch.context() as patched:
        patched.setattr(
            "cranectl.compare.agreement.agreement_limits",
            lambda *_, **__: AgreementLimits(1e-16, 1e-16, 0.0, ""),
        )
        assert main(["run", *ideal]) == main(["compare", "a.mcap"]) == 1
        assert main(["validate", *OWN, "--jobs", "1", "--json", "v.json"]) == 1
        assert json.loads(Path("v.json").read_text())["passed"] is False
    assert main(["run", *ideal, *STOP]) == 3
    assert judged("compare", "a.mcap", code=1)["passed"] is True, (
        "the plants agree although both stop unexpectedly"
    )
    assert main(["run", "slack-rope", "--drive", "velocity", "--out", "b.mcap"]) == 3
    assert judged("compare", "b.mcap")["passed"] is True, "the plants agree and stop as expected"

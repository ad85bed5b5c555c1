"""All commands judge the agreement of plants with the same limits, for every rig, for runs and for logs."""

from pathlib import Path
from typing import Any

import pytest

from cranectl.cli.main import main
from cranectl.compare.agreement import AgreementLimits, agreement_limits
from tests.cli.arguments import STOP
from tests.cli.conftest import json_of
from tests.log.viewer import messages_of

pytestmark = pytest.mark.usefixtures("in_empty_directory")

OVERRIDES = ["duration=1.0", "disturbances=[]", "reference.segments=[]", "rig.load_mass=2.0"]
OVERRIDES += ["initial.load_offset=[0.02,0,0]"]
OWN = ["fast-diagonal", *(part for override in OVERRIDES for part in ("--set", override))]
OWN += ["--controller", "lqr", "--plants", "analytic,mujoco", "--drive", "velocity"]
LOG = "logs/fast-diagonal/lqr-velocity.mcap"


def judged(*arguments: str, code: int = 0) -> dict[str, Any]:
    """Return the agreement that a command writes as JSON."""
    result = json_of(*arguments, code=code)
    return result["agreement"] if "agreement" in result else result["agreements"][0]


def test_an_own_rig_is_judged_with_the_same_limits() -> None:
    limits = agreement_limits("velocity")
    for arguments in (["run", *OWN], ["validate", *OWN, "--jobs", "1"], ["compare", LOG], ["info", LOG]):
        result = judged(*arguments)
        assert result["passed"] is True, arguments
        assert (result["limit_m"], result["limit_rad"]) == (limits.load_m, limits.angle_rad)
    ((_, verdict),) = messages_of(Path(LOG), "/diff/verdict")
    assert verdict.verdict == "passed"
    assert verdict.load.endswith(f"limit {limits.load_m:g} m")


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
        assert json_of("validate", *OWN, "--jobs", "1", code=1)["passed"] is False
    assert main(["run", *ideal, *STOP]) == 3
    assert judged("compare", "a.mcap", code=1)["passed"] is True, (
        "the plants agree although both stop unexpectedly"
    )
    assert main(["run", "slack-rope", "--drive", "velocity", "--out", "b.mcap"]) == 3
    assert judged("compare", "b.mcap")["passed"] is True, "the plants agree and stop as expected"

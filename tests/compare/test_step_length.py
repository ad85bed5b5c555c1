"""Plants that differ because of their steps, and plants that differ otherwise."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.compare import step_length
from cranectl.compare.limits import NoLimits, agreement_limits
from cranectl.compare.runs import judge
from cranectl.compare.step_length import judge_steps
from cranectl.plants.registry import PLANTS
from cranectl.scenario import Scenario, load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus

LIMITS = agreement_limits("ideal")
LONG = ["duration=4.0", "control.period=0.02", "control.physics_step=0.02"]


def pair(scenario: Scenario) -> list[Run]:
    return [simulate_run(scenario, plant=plant, controller="lqr") for plant in PLANTS]


@pytest.fixture(scope="module")
def long() -> list[Run]:
    """Steps of 20 ms for a load that crosses the rig in 3 s."""
    return pair(load_scenario("fast-diagonal", overrides=LONG))


def test_half_the_step_brings_them_together(long: list[Run]) -> None:
    found = judge_steps(long, LIMITS)
    assert not found.passed
    assert found.curing_step_s == 0.01
    assert replace(found, curing_step_s=None) == judge(*long, limits=LIMITS)


def test_the_order_says_how_much_shorter(long: list[Run]) -> None:
    """Limits 50 times as narrow take two halvings, each of which leaves a sixteenth."""
    found = judge(*long)
    apart = max(found.max_load_error_m, found.max_angle_error_rad) / 50.0
    assert judge_steps(long, replace(LIMITS, load_m=apart, angle_rad=apart)).curing_step_s == 0.005


def test_other_differences_are_not_cured(long: list[Run]) -> None:
    """Where a shorter step leaves them apart, where they agree, and where something else is to blame."""
    narrow = replace(LIMITS, load_m=1e-16, angle_rad=1e-16)
    interrupted = [long[0], replace(long[1], status=RunStatus.INTERRUPTED)]
    others = [replace(run, drive="velocity") for run in long]
    assert judge_steps(long, narrow).curing_step_s is None
    for runs in ([long[0], long[0]], interrupted, others):
        assert judge_steps(runs, LIMITS).curing_step_s is None
    assert judge_steps(long, NoLimits("nobody knows")).curing_step_s is None


def test_steps_stay_on_the_grid_of_nanoseconds() -> None:
    odd = load_scenario("fast-diagonal", overrides=["control.physics_step=0.000015625"])
    assert step_length._stepping(odd, 2) is None


def test_the_verdict_of_a_run_says_so(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    overrides = [part for override in LONG for part in ("--set", override)]
    assert main(["run", "fast-diagonal", "--controller", "lqr", *overrides, "--json", "run.json"]) == 1
    assert "with control.physics_step = 0.01 they do" in " ".join(capsys.readouterr().out.split())
    (agreement,) = json.loads(Path("run.json").read_text())["agreements"]
    assert agreement["curing_step_s"] == 0.01
    assert not agreement["passed"]

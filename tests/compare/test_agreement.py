"""Of which scenarios and plants limits are known; plants that differ because of their steps, or otherwise."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from cranectl.analysis.budget.predicted_limits import predicted_limits
from cranectl.cli.main import main
from cranectl.compare.agreement import (
    ENCODERS,
    NOT_SHIPPED,
    OTHER_PAIR,
    SMOOTHED,
    Limits,
    NoLimits,
    agreement_limits,
    judge,
    judge_steps,
    limits_for,
    pair_limits,
    shipped_name,
    with_finer_steps,
)
from cranectl.design import design_controller
from cranectl.plants import registry
from cranectl.reference import load_scenario
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.documents import read_toml
from cranectl.support.resources import TOLERANCE_FILE
from tests.conftest import ALL_SCENARIOS

LIMITS = agreement_limits("ideal")
BLIND, FEELING = ("analytic", "mujoco"), ("elastic", "mujoco")
LONG = ["duration=4.0", "control.period=0.02", "control.physics_step=0.02"]


def test_limits_come_with_reasons() -> None:
    known = read_toml(TOLERANCE_FILE)["closed-loop"]
    for table in (*known.pop("effects").values(), *known.values()):
        assert len(table["reason"]) > 50


@pytest.mark.parametrize("name", ALL_SCENARIOS)
def test_shipped_scenarios_are_known_by_what_moves_the_plants(name: str) -> None:
    scenario = load_scenario(name)
    renamed = scenario.model_copy(update={"name": "mine", "title": "my own", "controller": "lqr"})
    for shipped in (scenario, renamed, load_scenario(name, overrides=["log.every=1"])):
        assert shipped_name(shipped) == name
        found = limits_for(shipped, design_controller("lqr"), "velocity", ("analytic", *FEELING))
        assert found == {BLIND: agreement_limits("velocity", name), FEELING: LIMITS}


@pytest.mark.parametrize(
    "override",
    [
        "rig.load_mass=1.001", "rig.winch_time_constant=0.021", "rig.gravity=9.82", "duration=24.0",
        "control.lag_compensation=false", "control.physics_step=0.0005", "design.input_weight=0.11",
        "disturbances.0.magnitude=0.9", "initial.load_offset=[0.01,0,0]",
        "reference.start=[1.0,0.77,-0.71]", "effects.delay.seconds=0.01", "workspace.on_exit='stop'",
    ],
)  # fmt: skip
def test_whatever_may_move_a_plant_makes_another_scenario(override: str) -> None:
    scenario = load_scenario("fixed-position", overrides=[override])
    design = design_controller("lqr", scenario.design)
    assert shipped_name(scenario) is None
    for drive, pair in (("ideal", BLIND), ("velocity", FEELING)):
        assert pair_limits(scenario, design, drive, pair) == LIMITS, "numerics are the same for any"
    assert pair_limits(scenario, design, "velocity", BLIND) is NOT_SHIPPED
    own = Limits(1.0, 2.0, 3.0, "", "mine")
    assert pair_limits(scenario, design, "velocity", BLIND, predict=lambda *_: own) is own


def test_plants_of_which_nothing_is_known_are_not_judged_with_velocity_drives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Beside others, which are; ideal drives are the same everywhere."""
    monkeypatch.setitem(registry.PLANTS, "heavy", replace(registry.PLANTS["analytic"], name="heavy"))
    scenario = load_scenario("slack-rope")
    design = design_controller("lqr", scenario.design)
    assert pair_limits(scenario, design, "ideal", ("heavy", "mujoco")) == LIMITS
    found = limits_for(
        scenario, design, "velocity", ("analytic", "heavy", "mujoco"), predict=predicted_limits
    )
    assert found == {BLIND: agreement_limits("velocity"), ("heavy", "mujoco"): OTHER_PAIR}
    runs = [simulate_run(scenario, plant=plant, drive="velocity", design=design) for plant in BLIND]
    heavy = replace(runs[0], plant="heavy")
    for agreement in (judge(heavy, runs[1], limits=OTHER_PAIR), judge(heavy, runs[1])):
        assert (agreement.passed, agreement.limit_m, agreement.limits) == (None, None, OTHER_PAIR.reason)
    assert judge(*runs, limits=found[BLIND]).passed


def test_effects_leave_what_their_schemes_do() -> None:
    """The largest of them, longer on a longer rig; not a limit of its own for what leaves nothing."""
    mixed = load_scenario("ship-to-shore", overrides=["effects.rope={}", "effects.friction={}"])
    design = design_controller("lqr", mixed.design)
    found = pair_limits(mixed, design, "velocity", FEELING)
    assert isinstance(found, Limits)
    assert found.load_m == pytest.approx(6e-5 * mixed.rig.rope_range[1] / 1.4)
    assert found.angle_rad == 1.2e-4
    for effects, why in (("{sensing={}, rope={}}", ENCODERS), ("{friction={}}", SMOOTHED)):
        scenario = load_scenario("fixed-position", overrides=[f"effects={effects}"])
        assert pair_limits(scenario, design, "force", BLIND) is why
    framed = load_scenario("fixed-position", overrides=["effects.frame={}", "effects.delay={}"])
    assert pair_limits(framed, design, "force", FEELING) == agreement_limits("force")


def short(name: str, *overrides: str) -> Scenario:
    return load_scenario(name, overrides=["disturbances=[]", *overrides])


@pytest.mark.parametrize(
    ("scenario", "why"),
    [
        (short("fast-diagonal", "effects.delay.seconds=0.01"), "other effects"),
        (short("slack-rope"), "slack-rope"),
        (short("off-reference", "rig.trolley_range=[0.0,0.9]", "initial.load_offset=[0,0.3,0]"), "workspace"),
        (
            short(
                "fast-diagonal",
                "duration=4.0",
                "rig.load_mass=10.0",
                "rig.bridge_mass=0.5",
                "rig.trolley_mass=0.1",
            ),
            "too large",
        ),
    ],
)
def test_where_no_bound_is_known_there_is_none(scenario: Scenario, why: str) -> None:
    found = predicted_limits(scenario, design_controller("lqr", scenario.design))
    assert isinstance(found, NoLimits)
    assert why in found.reason


def pair(scenario: Scenario) -> list[Run]:
    return [simulate_run(scenario, plant=plant, controller="lqr") for plant in BLIND]


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
    assert with_finer_steps(odd, 2) is None


def test_the_verdict_of_a_run_says_so(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    overrides = [part for override in LONG for part in ("--set", override)]
    assert main(["run", "fast-diagonal", "--controller", "lqr", *overrides, "--json", "run.json"]) == 1
    assert "with control.physics_step = 0.01 they do" in " ".join(capsys.readouterr().out.split())
    for agreement in json.loads(Path("run.json").read_text())["agreements"]:
        assert agreement["curing_step_s"] == 0.01
        assert not agreement["passed"]

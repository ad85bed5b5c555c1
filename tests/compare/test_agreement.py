"""Test limits of the difference between plants, and plants that differ because of steps or otherwise."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.compare import Agreement
from cranectl.compare.agreement import (
    ENCODER_STEPS,
    SMOOTHED_FRICTION,
    AgreementLimits,
    NoLimits,
    agreement_limits,
    judge,
    pair_limits,
)
from cranectl.planning import load_scenario
from cranectl.plants import PhysicsStep, registry
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.documents import TOML
from cranectl.support.resources import Shipped
from tests.conftest import PAIR, closed_loop

LIMITS = agreement_limits("ideal")
RIGHT = ("elastic", "mujoco")
LONG = ["duration=4.0", "control.period=0.02", "control.physics_step=0.02"]


def test_limits_come_with_reasons() -> None:
    known = TOML.read(Shipped.TOLERANCE_FILE)["closed-loop"]
    for table in (*known.pop("effects").values(), *known.values()):
        assert len(table["reason"]) > 50


@pytest.mark.parametrize("drive", ["ideal", "velocity", "force"])
@pytest.mark.parametrize(
    "override",
    ["duration=23.0", "rig.load_mass=1.5", "rig.winch_time_constant=0.03", "control.physics_step=0.0005"],
)
def test_limits_are_the_same_for_every_scenario_rig_and_pair(override: str, drive: str) -> None:
    scenario = load_scenario("fixed-position", overrides=[override])
    for pair in (PAIR, RIGHT):
        limits = pair_limits(scenario, drive, pair)
        assert isinstance(limits, AgreementLimits)
        assert (limits.load_m, limits.angle_rad, limits.end_s) == (1e-7, 1e-7, 0.0)


def test_a_plant_with_drives_that_do_not_feel_the_load_is_not_judged_with_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Other plants in the same runs are judged, and so is this one with ideal drives."""
    blind = replace(registry.PLANTS["analytic"], name="blind", label="blind", servos=False)
    monkeypatch.setitem(registry.PLANTS, "blind", blind)
    scenario = load_scenario("slack-rope")
    assert pair_limits(scenario, "ideal", ("blind", "mujoco")) == LIMITS
    limits = AgreementLimits.between(scenario, "velocity", ("analytic", "blind", "mujoco"))
    assert limits[PAIR] == agreement_limits("velocity")
    unknown = limits["blind", "mujoco"]
    assert isinstance(unknown, NoLimits)
    assert unknown.reason == "velocity drives of the blind plant do not feel the load, unlike those of others"
    runs = [simulate_run(scenario, plant=plant, drive="velocity", controller="lqr") for plant in PAIR]
    blind_run = replace(runs[0], plant="blind")
    for agreement in (judge(blind_run, runs[1], limits=unknown), judge(blind_run, runs[1])):
        assert (agreement.passed, agreement.limit_m, agreement.limits) == (None, None, unknown.reason)
    assert judge(*runs).passed


def test_effects_leave_what_their_schemes_do() -> None:
    """The largest limit of all effects counts, and grows with the rig; some effects need no limit."""
    mixed = load_scenario("ship-to-shore", overrides=["effects.rope={}", "effects.friction={}"])
    limits = pair_limits(mixed, "velocity", RIGHT)
    assert isinstance(limits, AgreementLimits)
    assert limits.load_m == pytest.approx(6e-5 * mixed.rig.rope_range[1] / 1.4)
    assert limits.angle_rad == 1.2e-4
    assert (limits.order, LIMITS.order) == (1, 4)
    for effects, why in (("{sensing={}, rope={}}", ENCODER_STEPS), ("{friction={}}", SMOOTHED_FRICTION)):
        scenario = load_scenario("fixed-position", overrides=[f"effects={effects}"])
        assert pair_limits(scenario, "force", PAIR) is why
    framed = load_scenario("fixed-position", overrides=["effects.frame={}", "effects.delay={}"])
    assert pair_limits(framed, "force", RIGHT) == agreement_limits("force")


@pytest.fixture(scope="module")
def long() -> list[Run]:
    """Return runs with steps of 20 ms, of a load that crosses the rig in 3 s."""
    return [closed_loop("fast-diagonal", "lqr", plant, "ideal", *LONG) for plant in PAIR]


def test_the_order_says_how_much_shorter(long: list[Run]) -> None:
    """Limits 50 times as narrow need two halvings, each of which divides the error by 16."""
    agreement = judge(*long)
    narrow = max(agreement.max_load_error_m, agreement.max_angle_error_rad) / 50.0
    limits = replace(LIMITS, load_m=narrow, angle_rad=narrow)
    assert Agreement.judge_steps(long, limits).curing_step_s == 0.005


def test_friction_needs_more_halvings_than_the_smooth_parts() -> None:
    """The engine's friction is of the first order: a third of the difference needs a quarter of the step."""
    overrides = ["duration=4.0", "control.period=0.004", "control.physics_step=0.004", "effects.friction={}"]
    scenario = load_scenario("fast-diagonal", overrides=overrides)
    runs = [simulate_run(scenario, plant=plant, drive="velocity", controller="lqr") for plant in RIGHT]
    limits, agreement = pair_limits(scenario, "velocity", RIGHT), judge(*runs)
    assert isinstance(limits, AgreementLimits)
    assert agreement.passed
    third = agreement.excess / 3.0
    narrow = replace(limits, load_m=third * limits.load_m, angle_rad=third * limits.angle_rad)
    assert Agreement.judge_steps(runs, narrow).curing_step_s == 0.001
    assert Agreement.judge_steps(runs, replace(narrow, order=4)).curing_step_s is None


def test_other_differences_are_not_cured(long: list[Run]) -> None:
    """No step is found if a shorter one does not help, if plants agree, or if there is another reason."""
    narrow = replace(LIMITS, load_m=1e-16, angle_rad=1e-16)
    interrupted = [long[0], replace(long[1], status=RunStatus.INTERRUPTED)]
    other_drives = [replace(run, drive="velocity") for run in long]
    assert Agreement.judge_steps(long, narrow).curing_step_s is None
    for runs in ([long[0], long[0]], interrupted, other_drives):
        assert Agreement.judge_steps(runs, LIMITS).curing_step_s is None
    assert Agreement.judge_steps(long, NoLimits("nobody knows")).curing_step_s is None


def test_steps_stay_on_the_grid_of_nanoseconds() -> None:
    scenario = load_scenario("fast-diagonal", overrides=["control.physics_step=0.000015625"])
    assert PhysicsStep(scenario, "ideal").refined(2) is None


def test_the_verdict_of_a_run_names_the_step_that_brings_plants_together(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    overrides = [part for override in LONG for part in ("--set", override)]
    assert main(["run", "fast-diagonal", "--controller", "lqr", *overrides, "--json", "run.json"]) == 1
    assert "with control.physics_step = 0.01 they do" in " ".join(capsys.readouterr().out.split())
    for agreement in json.loads(Path("run.json").read_text())["agreements"]:
        assert agreement["curing_step_s"] == 0.01
        assert not agreement["passed"]

"""Predictions against what the levels do: estimates, bounds, and that both can fail."""

import functools
import json
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from cranectl.analysis.budget.equivalent import friction_port, hold_error, integrator_error
from cranectl.analysis.budget.error_budget import Budget, BudgetLevel, error_budget
from cranectl.analysis.budget.prediction import LEVELS, predict_levels
from cranectl.analysis.budget.propagation import no_errors, plant_errors, propagate, second_order
from cranectl.analysis.budget.trajectory_loop import LinearisedRun, nominal_run
from cranectl.analysis.ladder import Size, size_of
from cranectl.cli.main import main
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run

FREE = ("velocity", "acceleration", "force")
SHORT = {
    "fast-diagonal": ["duration=5.0"],
    "off-reference": ["duration=6.5", *(f"effects.limits.{what}=[1e3,1e3,1e3]" for what in FREE)],
    "settled-trajectory": [
        "duration=6.0", "reference.segments.0.duration=4.0", "reference.segments.1.duration=2.0",
        "reference.segments.0.to=[0.4,0.3,-0.4]", "reference.segments.1.angle=-0.3",
        "disturbances.0.start=2.0", "disturbances.1.start=3.0",
    ],
}  # fmt: skip


@functools.cache
def budget(scenario: str, controller: str) -> Budget:
    return error_budget(load_scenario(scenario, overrides=SHORT[scenario]), controller)


CASES = [
    ("fast-diagonal", "lqr"),
    ("settled-trajectory", "pole-placement+loop-shaping"),
    ("off-reference", "lqr+hinf"),
]


@pytest.mark.parametrize(("scenario", "controller"), CASES)
def test_bounds_hold_and_estimates_are_near(scenario: str, controller: str) -> None:
    entries = {entry.level: entry for entry in budget(scenario, controller).entries}
    assert tuple(entries) == LEVELS
    assert budget(scenario, controller).holds
    for level in ("sampled", "servos", "delay", "rope", "wind", "friction"):
        assert entries[level].ratio == pytest.approx(1.0, abs=0.2)
        assert entries[level].estimate.max == pytest.approx(entries[level].measured.max, rel=0.2)
    for entry in entries.values():
        assert np.isfinite(entry.bound)
        assert entry.remark or entry.looseness <= 5.0 or not entry.measured.max


def test_steps_of_encoders_are_largest_at_the_end_of_a_short_motion() -> None:
    """The three sizes are of one kind: the final deviation can equal the largest, and not exceed it."""
    short = ["duration=0.1", "disturbances.0.start=0.02", "disturbances.1.start=0.05"]
    result = error_budget(load_scenario("fixed-position", overrides=short), "lqr+hinf")
    (entry,) = (entry for entry in result.entries if entry.level == "quantisation")
    assert entry.estimate.final == pytest.approx(entry.estimate.max, rel=1e-12)


def test_above_a_level_without_a_bound_no_estimate_looks_like_the_others() -> None:
    """A start far aside asks the limits for tens of m/s²: what comes after them is rough, and says why."""
    where = nominal_run(
        load_scenario("off-reference", overrides=["duration=2.0", "reference.segments=[]"]), "lqr+hinf"
    )
    found = {each.level: each for each in islice(predict_levels(where), LEVELS.index("delay") + 1)}
    for level in ("sampled", "engine", "servos"):
        assert np.isfinite(found[level].bound)
        assert not found[level].above
    assert found["limits"].bound == np.inf
    assert not found["limits"].above
    for level in ("observer", "noise", "quantisation", "delay"):
        assert (found[level].bound, found[level].above) == (np.inf, "limits")


def test_the_first_level_without_a_bound_leaves_the_others_theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    """They start from the sampled run itself, whatever is known of its distance from continuous time."""
    known = list(islice(predict_levels(nominal()), 3))
    lost = replace(known[0], bound=np.inf)
    monkeypatch.setattr("cranectl.analysis.budget.prediction._predict_hold", lambda _: lost)
    first, *others = islice(predict_levels(nominal()), 3)
    assert first.bound == np.inf
    for other, before in zip(others, known[1:], strict=True):
        assert (other.bound, other.estimate, other.above) == (before.bound, before.estimate, "")


def test_a_bound_can_be_broken_and_an_estimate_without_one_is_marked() -> None:
    size = Size(1.0, 2.0, 0.5)
    entry = BudgetLevel("delay", size, 2.5, size, "completed")
    assert (entry.holds, entry.rough, entry.remark) == (True, False, "")
    broken = replace(entry, measured=Size(1.0, 2.6, 0.5))
    assert not broken.holds
    assert Budget("any", "lqr", (entry, entry), size, size).holds
    assert not Budget("any", "lqr", (entry, broken), size, size).holds
    assert replace(entry, bound=50.0).remark
    own, above = replace(entry, bound=np.inf), replace(entry, bound=np.inf, above="limits")
    assert own.remark == "rough estimate, no bound: this is too large for a first-order prediction"
    assert (
        above.remark
        == "rough estimate, no bound: above limits, which is too large for a first-order prediction"
    )
    assert (above.to_json()["rough"], above.to_json()["above"]) == (True, "limits")


@functools.cache
def nominal(*overrides: str) -> LinearisedRun:
    return nominal_run(load_scenario("fast-diagonal", overrides=["duration=4.0", *overrides]), "lqr")


def test_a_servo_of_another_kind_is_noticed() -> None:
    """Without the lead, or at twice the lag, the prediction is off by far more than a fifth."""

    def predicted(where: LinearisedRun) -> float:
        return size_of(propagate(where.with_servos(), plant_errors(where.with_servos())).load).rms

    right = nominal()
    ideal = simulate_run(right.run.scenario, plant="mujoco", controller="lqr", drive="ideal")
    real = simulate_run(right.run.scenario, plant="mujoco", controller="lqr", drive="velocity")
    measured = size_of(real.load_position - ideal.load_position).rms
    assert predicted(right) == pytest.approx(measured, rel=0.05)
    for wrong in ("control.lag_compensation=false", "rig.bridge_time_constant=0.04"):
        assert predicted(nominal(wrong)) > 1.2 * measured


def test_engine_and_hold_change_with_their_orders() -> None:
    """Half the step: a sixteenth of the integrator's error, half of the hold's."""
    sizes = []
    for period in (2e-3, 1e-3):
        where = nominal(f"control.period={period}", f"control.physics_step={period}", "disturbances=[]")
        engine = integrator_error(where.run, where.loop)
        engine.drive[:] = 0.0  # the reaction of the ideal drives does not depend on the step
        effects = (engine, hold_error(where.run, where.loop))
        sizes.append([size_of(propagate(where.loop, effect).load).rms for effect in effects])
    assert sizes[0][0] / sizes[1][0] == pytest.approx(16.0, rel=0.1)
    assert sizes[0][1] / sizes[1][1] == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("rig", ["rig.bridge_mass=1000", "rig.trolley_mass=1e5", "rig.load_mass=0.001"])
def test_the_bound_of_the_engine_holds_for_any_rig(rig: str) -> None:
    """What stands on an ideal drive is no error of it."""
    overrides = ["duration=4.0", "disturbances=[]", rig]
    found = error_budget(load_scenario("fast-diagonal", overrides=overrides), "lqr", top="engine")
    assert found.entries[-1].level == "engine"
    assert found.holds


def test_the_second_order_grows_as_the_square() -> None:
    where, sizes = nominal(), []
    for scale in (1.0, 2.0):
        ports = no_errors(where.loop)
        ports.drive[:] = scale * np.sin(np.arange(len(ports.drive)) / 300.0)[:, None] * [0.05, 0.03, 0.02]
        deviation = propagate(where.loop, ports)
        second = second_order(where.run, where.loop, ports, deviation)
        sizes.append(size_of(second.load).max)
    assert sizes[1] / sizes[0] == pytest.approx(4.0, rel=0.1)


def test_friction_holds_what_it_can_hold() -> None:
    """Far more friction than any drive has force: the axes stay where they start, and so does the joint."""
    where = nominal("effects.friction={coulomb=[1e5, 1e5, 1e5], pivot_coulomb=1e3}")
    loop, run = where.with_servos(), where.run
    stuck = propagate(loop, plant_errors(loop), friction=friction_port(run, where.effects.friction))
    rates = run.block("state")[:, 1::2] + stuck.state[:, 1:10:2]
    assert np.abs(run.block("state")[:, 1::2]).max(axis=0).min() > 0.03
    assert np.abs(rates[1:]).max() < 1e-4


def test_sliding_friction_is_against_the_motion() -> None:
    where = nominal("effects.friction={coulomb=[0.1, 0.1, 0.1], viscous=[1.0, 2.0, 3.0]}")
    loop, run, friction = where.with_servos(), where.run, where.effects.friction
    found = propagate(loop, plant_errors(loop), friction=friction_port(run, friction))
    without = propagate(loop, plant_errors(loop))._replace(state=found.state)
    rates = run.block("state")[:-1, 1:6:2] + found.state[:-1, 1:6:2]
    w_and_lead = loop.integral * without.state[:-1, 10:13] + loop.lead * found.commanded
    force = (found.drive - w_and_lead) * run.scenario.rig.velocity_gains
    expected = -np.array(friction.viscous) * rates - 0.1 * np.sign(rates)
    sliding = np.abs(rates) > 0.01
    assert sliding.sum() > 1000
    assert force[sliding] == pytest.approx(expected[sliding], abs=1e-9)


def test_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["ladder", "off-reference", "--predict", "--controller", "lqr+hinf"]
    assert main([*command, "--top", "servos", "--json", "-", "--set", "duration=6.0"]) == 0
    out = capsys.readouterr()
    data = json.loads(out.out)
    assert [level["level"] for level in data["levels"]] == list(LEVELS[:3])
    assert data["levels"][2]["holds"] is True
    assert "unexplained" in out.err
    assert main([*command, "--top", "moon"]) == 2
    assert "servos" in capsys.readouterr().err
    assert main([*command, "--top", "sampled", "--report", "page.html"]) == 2
    assert "leave out --report, or --predict" in capsys.readouterr().err
    former = ["budget", "off-reference", "--top", "sampled", "--set", "duration=6.0"]
    assert main(former) == 0
    assert "cranectl budget is now cranectl ladder --predict" in capsys.readouterr().err

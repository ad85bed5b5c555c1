"""Advice: grades mean what they say, each improvement changes one thing, the best comes first."""

from dataclasses import replace

import numpy as np
import pytest

from cranectl.analysis.advice import (
    DRIVE_AND_SENSOR_EFFECTS,
    IMPROVEMENTS,
    Advice,
    advise,
    assess,
    improved,
    visited_points,
)
from cranectl.analysis.certificate.certify import REQUIRED_MARGIN
from cranectl.analysis.levels import with_effects
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.status import RunStatus

PAIR = ("pole-placement", "lqr+loop-shaping")
SHORT = ["duration=1.5", "disturbances.0.start=0.1", "disturbances.1.start=0.2"]


@pytest.fixture(scope="module")
def found() -> Advice:
    return advise(load_scenario("fixed-position", overrides=SHORT), PAIR)


def test_the_best_comes_first_and_is_the_guaranteed_one(found: Advice) -> None:
    assert [row.controller for row in found.assessments] == ["lqr+loop-shaping", "pole-placement"]
    best, other = found.assessments
    assert found.best is best
    assert (best.grade, other.grade) == ("guaranteed", "survived")
    assert best.guaranteed == all(point.certified for point in best.certificate.points)
    assert not other.guaranteed


def test_what_is_guaranteed_has_a_margin_left_and_says_by_what(found: Advice) -> None:
    """`lqr` holds frequency by frequency where its gap exceeds its margin."""
    rows = [*found.assessments, assess(found.scenario, "lqr", found.points)]
    for row in rows:
        assert row.guaranteed == (row.least_margin > REQUIRED_MARGIN) == (row.judged_by != "refused")
        assert row.least_margin >= row.certificate.least_margin
    assert [row.judged_by for row in rows] == ["gap", "refused", "frequency"]
    assert rows[-1].certificate.least_margin < 0.0 < rows[-1].least_margin


def test_a_run_that_ends_early_has_failed(found: Advice) -> None:
    assert replace(found.best, status=RunStatus.SLACK_ROPE).grade == "failed"
    fast = load_scenario("slack-rope", overrides=["effects.limits.velocity=[1.0,1.0,5.0]"])
    fallen = advise(fast, ["lqr"])
    assert fallen.best is None
    assert fallen.assessments[0].grade == "failed"
    assert fallen.improvements == ()


def test_costs_are_those_of_the_run(found: Advice) -> None:
    run = simulate_run(found.scenario, plant="mujoco", drive="velocity", controller="lqr+loop-shaping")
    error = np.linalg.norm(run.reference[:, :3] - run.load_position, axis=1)
    assert found.best.metrics.max_error_m == pytest.approx(error.max())
    assert 0.0 < found.best.cost.max < error.max()


def test_improvements_are_ordered_by_what_they_save(found: Advice) -> None:
    gains = [row.gain for row in found.improvements]
    assert gains == sorted(gains, reverse=True)
    assert len(gains) == IMPROVEMENTS
    servos = next(row for row in found.improvements if row.name == "servos")
    assert servos.gain == pytest.approx(1.0 - servos.assessment.cost.rms / found.best.cost.rms)
    assert servos.gain > 0.1


def test_each_improvement_changes_one_thing() -> None:
    rig = with_effects(load_scenario("fixed-position"), list(DRIVE_AND_SENSOR_EFFECTS))
    before = rig.model_dump(mode="json")
    changed = {
        name: {key for key, value in better.model_dump(mode="json").items() if value != before[key]}
        for name, _, better in improved(rig)
    }
    effects = {"delay", "encoders", "observer"}
    assert changed == {"servos": {"rig"}, "sampling": {"control"}, **{name: {"effects"} for name in effects}}
    better = {name: scenario for name, _, scenario in improved(rig)}
    assert better["servos"].rig.time_constants.tolist() == (0.5 * rig.rig.time_constants).tolist()
    assert better["sampling"].period_ns == rig.period_ns // 2
    assert better["delay"].effects.delay.seconds == 0.5 * rig.effects.delay.seconds
    assert better["encoders"].effects.sensing.angle_noise == 0.5 * rig.effects.sensing.angle_noise
    assert better["observer"].effects.sensing.observer_bandwidth == 2 * rig.effects.sensing.observer_bandwidth


def test_points_are_what_the_scenario_visits() -> None:
    points = visited_points(load_scenario("settled-trajectory"))
    assert {point.rope_length for point in points} == {0.15, 0.703}
    assert {point.tilt for point in points} == {(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)}
    assert 0.0 in {point.hoisting_speed for point in points}
    assert max(point.hoisting_speed for point in points) > 0.05

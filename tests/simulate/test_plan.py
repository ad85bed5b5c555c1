"""Scenarios that their rig cannot run are refused before anything runs."""

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.simulate import Plan
from cranectl.support.errors import InputError
from tests.conftest import ALL_SCENARIOS

LINE = "reference.segments=[{{kind='line', to={to}, duration={duration}}}]"


def scenario(to: list[float], duration: float, *more: str) -> Scenario:
    line = LINE.format(to=to, duration=duration)
    return load_scenario("fixed-position", overrides=[line, *more])


def refused(*arguments: object) -> InputError:
    with pytest.raises(InputError) as caught:
        Plan.of(scenario(*arguments))
    return caught.value


@pytest.mark.parametrize("name", ALL_SCENARIOS)
def test_every_scenario_can_be_planned(name: str) -> None:
    loaded = load_scenario(name)
    plan = Plan.of(loaded)
    assert len(plan.time_ns) == len(plan.reference) == len(plan.disturbance) == loaded.steps + 1
    assert plan.time_ns[-1] == loaded.duration * 1e9
    assert np.isfinite(plan.reference).all()


def test_a_start_off_the_reference() -> None:
    """The offsets move and swing the load; all other states are those of the reference."""
    offsets = "initial={load_offset=[0.1,-0.2,0.3], alpha_offset=0.1, beta_offset=-0.2}"
    loaded = load_scenario("fixed-position", overrides=[offsets])
    state = Plan.of(loaded).initial_state
    assert state == pytest.approx([1.1, 0, 0.57, 0, 0.4, 0, 0.1, 0, -0.2, 0])
    swung = load_scenario("fixed-position", overrides=["initial={load_offset=[0,0,0], alpha_offset=1.4}"])
    assert Plan.of(swung).initial_state[6] == 1.4
    on_reference = Plan.of(load_scenario("settled-trajectory"))
    assert np.array_equal(on_reference.initial_state, on_reference.reference_state[0])


@pytest.mark.parametrize(
    ("offset", "found"),
    [
        ("initial.load_offset=[1.5,0,0]", "bridge_position"),
        ("initial.load_offset=[0,-1,0]", "trolley_position"),
        ("initial.load_offset=[0,0,0.69]", "rope_length"),
    ],
)
def test_a_start_outside_the_workspace_is_refused(offset: str, found: str) -> None:
    loaded = load_scenario("fixed-position", overrides=[offset])
    with pytest.raises(InputError, match=f"start outside the workspace: {found}"):
        Plan.of(loaded)


def test_reference_that_leaves_the_workspace_is_refused_with_place_and_time() -> None:
    error = refused([2.3, 0.77, -0.7], 5.0)
    assert "bridge_position = 2.3 m at" in error.found
    assert error.allowed == "rig.bridge_range, from 0 to 2 m"
    assert "trolley_position" in refused([1.0, -0.2, -0.7], 5.0).found
    assert "rope_length = 1.5 m" in refused([1.0, 0.77, -1.5], 5.0).found


def test_load_may_leave_the_workspace_where_the_crane_does_not() -> None:
    """Limits apply to bridge, trolley and rope: a swung-out load may be outside, a rope too long not."""
    inside = scenario([1.9, 0.77, -0.7], 1.6, "rig.bridge_range=[0.7, 2.1]")
    plan = Plan.of(inside)
    assert not np.array_equal(plan.reference[:, 0], plan.reference_state[:, 0])


def test_reference_that_needs_a_slack_rope_is_refused() -> None:
    error = refused([1.0, 0.77, -1.3], 0.5, "rig.gravity=5.0")
    assert "slack rope" in error.found
    assert "below g = 5" in error.allowed


def test_reference_beyond_the_drives_speed_is_refused_where_they_have_limits() -> None:
    """The bridge exceeds the speed, since it moves ahead of the load."""
    fast = ([0.2, 0.77, -0.7], 1.5)
    Plan.of(scenario(*fast))
    error = refused(*fast, "effects.limits={}")
    assert "the bridge can: 1.05 m/s at 0.307 s" in error.found
    assert error.allowed == "up to effects.limits.velocity = 1 m/s"
    Plan.of(scenario(*fast, "effects.limits.velocity=[1.1,1.0,0.6]"))


def test_reference_above_the_trolley_is_refused() -> None:
    assert "lifts the load" in refused([1.0, 0.77, 0.1], 5.0).found

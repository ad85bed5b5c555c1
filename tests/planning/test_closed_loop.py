"""Plans with the default share in closed loop: feedback has enough reserve on every plant.

Each plan is needed by one test only, so it is made once.
"""

import pytest

from cranectl.scenario import Scenario
from validation.proofs.minimum_times import CASES, ROUGH_EFFECTS, scenario, simulate_plan

LIMITS = "effects.limits={}"
# [m] by the letter of a case: 3 mm are measured for a to c, 8 mm for the path of the thesis, which turns.
MAX_ERROR = {"a": 5e-3, "b": 5e-3, "c": 5e-3, "d": 1e-2}
ERROR_TOLERANCE = 1e-3  # between plants, relative; they agree much better than that
MAX_SATURATION = 0.05  # [s]


def without_force_limits(plan: Scenario) -> Scenario:
    """Return the same motion for the analytic plant, which does not support force limits."""
    assert plan.effects.limits
    limits = plan.effects.limits.model_copy(update={"force": (1e9,) * 3})
    return plan.model_copy(update={"effects": plan.effects.model_copy(update={"limits": limits})})


@pytest.mark.parametrize("case", CASES)
def test_all_plants_have_the_same_small_error_and_no_drive_saturates(case: str) -> None:
    plan = scenario(case, LIMITS)
    analytic = simulate_plan(without_force_limits(plan), "analytic")
    others = [simulate_plan(plan, plant) for plant in ("elastic", "mujoco")]
    for metrics in (analytic, *others):
        assert metrics.saturated_s == 0.0
        assert metrics.max_error_m <= MAX_ERROR[case[0]]
    for metrics in others:
        assert metrics.max_error_m == pytest.approx(analytic.max_error_m, rel=ERROR_TOLERANCE)


@pytest.mark.parametrize("case", CASES)
def test_feedback_from_encoders_seldom_saturates_despite_delay_and_friction(case: str) -> None:
    plan = scenario(case, LIMITS, *ROUGH_EFFECTS)
    for plant in ("elastic", "mujoco"):  # the analytic one has no friction of its axes
        assert simulate_plan(plan, plant).saturated_s < MAX_SATURATION


def test_a_plan_without_the_drives_lag_saturates() -> None:
    """This shows that the tests above can fail."""
    case = next(iter(CASES))
    plan = scenario(case, LIMITS, "control.lag_compensation=false")
    compensated = plan.control.model_copy(update={"lag_compensation": True})
    metrics = simulate_plan(plan.model_copy(update={"control": compensated}), "mujoco")
    assert metrics.saturated_s > 2 * MAX_SATURATION
    assert metrics.max_error_m > MAX_ERROR[case[0]]

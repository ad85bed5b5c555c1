"""Plans with the default share in closed loop: what is left for feedback is enough, on every plant.

Each plan is needed by one test only, so that it is made once.
"""

import numpy as np
import pytest

from cranectl.analysis.budget.prediction import predict_levels
from cranectl.analysis.budget.trajectory_loop import nominal_run
from cranectl.scenario import Scenario
from validation.proofs.minimum_times import CASES, ROUGH_EFFECTS, scenario, simulate_plan

LIMITS = "effects.limits={}"
AT_MOST = {"a": 5e-3, "b": 5e-3}  # [m], free motions in the open
AS_PREDICTED = 0.2
SELDOM = 0.05  # [s]


def predicted(plan: Scenario) -> float:
    """Largest error of the load with velocity drives that `cranectl budget` foretells [m].

    That of the sampled ideal run and, to first order, what is added up to the drives' limits.
    """
    nominal = nominal_run(plan, "lqr")
    error = nominal.run.block("load")[:, :3] - nominal.run.reference[:, :3]
    for prediction in predict_levels(nominal):
        if prediction.level != "sampled":  # which the ideal run has already
            error = error + prediction.load
        if prediction.level == "limits":
            break
    return float(np.linalg.norm(error, axis=1).max())


def without_force_limits(plan: Scenario) -> Scenario:
    """The same motion for the analytic plant, which does not know such limits."""
    assert plan.effects.limits
    limits = plan.effects.limits.model_copy(update={"force": (1e9,) * 3})
    return plan.model_copy(update={"effects": plan.effects.model_copy(update={"limits": limits})})


@pytest.mark.parametrize("case", CASES)
def test_the_load_errs_as_predicted_and_no_drive_saturates(case: str) -> None:
    plan = scenario(case, LIMITS)
    most = predicted(plan)
    analytic = simulate_plan(without_force_limits(plan), "analytic")
    for found in (analytic, *(simulate_plan(plan, plant) for plant in ("elastic", "mujoco"))):
        assert found.saturated_s == 0.0
        assert found.max_error_m <= AT_MOST.get(case[0], np.inf)
        assert found.max_error_m == pytest.approx(most, rel=AS_PREDICTED)


@pytest.mark.parametrize("case", CASES)
def test_feedback_from_encoders_has_enough_left_despite_delay_and_friction(case: str) -> None:
    plan = scenario(case, LIMITS, *ROUGH_EFFECTS)
    for plant in ("elastic", "mujoco"):  # the analytic one has no friction of its axes
        assert simulate_plan(plan, plant).saturated_s < SELDOM


def test_a_plan_that_forgets_the_drives_lag_saturates() -> None:
    """So that the tests above can fail."""
    case = next(iter(CASES))
    plan = scenario(case, LIMITS, "control.lag_compensation=false")
    asked = plan.control.model_copy(update={"lag_compensation": True})
    found = simulate_plan(plan.model_copy(update={"control": asked}), "mujoco")
    assert found.saturated_s > 2 * SELDOM
    assert found.max_error_m > AT_MOST[case[0]]

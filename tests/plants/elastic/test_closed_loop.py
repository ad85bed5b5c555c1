"""Level 3: the elastic plant and the engine in closed loop, with the same effects."""

import numpy as np
import pytest

from cranectl.compare.agreement import agreement_limits, judge
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.scenario.effects import NO_EFFECTS
from cranectl.simulate import Run, simulate_run

PLANTS = ("elastic", "mujoco")
EFFECTS = ("frame", "rope", "body", "wind", "friction")


def with_effects(name: str, *effects: str) -> Scenario:
    loaded = load_scenario(name)
    return loaded.model_copy(update={"effects": loaded.rig.effects.only(*effects)})


def both(scenario: Scenario, drive: str) -> tuple[Run, Run]:
    design = ALL_CONTROLLERS.design("lqr", scenario)
    a, b = (simulate_run(scenario, plant=plant, drive=drive, design=design) for plant in PLANTS)
    return a, b


@pytest.mark.parametrize("drive", ["velocity", "force"])
@pytest.mark.parametrize("effect", EFFECTS)
@pytest.mark.parametrize("scenario", ["fast-diagonal", "near-slack", "ship-to-shore"])
def test_effects_leave_what_the_engines_schemes_do(scenario: str, effect: str, drive: str) -> None:
    """Differences are within the limit of each effect, and not far below it, also with frame and wind."""
    assert load_scenario(scenario).effects == NO_EFFECTS
    elastic, engine = both(with_effects(scenario, effect), drive)
    agreement = judge(elastic, engine)
    assert agreement.passed, (agreement.max_load_error_m, agreement.max_angle_error_rad)
    if effect in ("frame", "wind"):
        assert (agreement.limit_m, agreement.limit_rad) == (1e-7, 1e-7)
    else:
        assert agreement.limit_m > agreement_limits("ideal").load_m


@pytest.mark.parametrize(("effect", "order"), [("rope", 4), ("friction", 1)])
def test_half_the_step_leaves_what_the_order_of_the_engines_scheme_says(effect: str, order: int) -> None:
    scenario = with_effects("near-slack", effect)
    coarse = judge(*both(scenario, "velocity")).max_load_error_m
    control = scenario.control.model_copy(update={"physics_step": 0.00025})
    fine = judge(*both(scenario.model_copy(update={"control": control}), "velocity")).max_load_error_m
    assert fine < 1.5 * coarse / 4**order


def test_a_rope_starts_taut_on_a_winch_that_sticks() -> None:
    """The swing makes tension and holding force differ by less than the winch's friction."""
    scenario = with_effects("fast-diagonal", "rope", "friction")
    swung = scenario.model_copy(
        update={"initial": scenario.initial.model_copy(update={"alpha_offset": 0.2, "beta_offset": -0.1})}
    )
    first, second = (run.signal("load.rope_tension") for run in both(swung, "velocity"))
    assert abs(first[0] - scenario.rig.weight) > 0.1
    assert np.abs(first[:20] - second[:20]).max() < 2e-3


def test_all_effects_at_once() -> None:
    scenario = with_effects("fast-diagonal", "limits", "delay", *EFFECTS)
    assert judge(*both(scenario, "velocity")).passed

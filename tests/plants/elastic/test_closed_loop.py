"""Level 3: the elastic plant and the engine in closed loop, with the same effects."""

from collections.abc import Sequence

import numpy as np
import pytest

from cranectl.compare.agreement import agreement_limits, judge
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run

PLANTS = ("elastic", "mujoco")
EFFECTS = ("frame", "rope", "body", "wind", "friction")


def both(scenario: str, effects: Sequence[str], *overrides: str, drive: str = "velocity") -> tuple[Run, Run]:
    """Return the runs of both plants, with the numbers that the rig has for `effects`."""
    shown = [f"effects.{effect}={{}}" for effect in effects]
    loaded = load_scenario(scenario, overrides=[*shown, *overrides])
    a, b = (simulate_run(loaded, plant=plant, drive=drive, controller="lqr") for plant in PLANTS)
    return a, b


@pytest.mark.parametrize("drive", ["velocity", "force"])
@pytest.mark.parametrize("effect", EFFECTS)
@pytest.mark.parametrize("scenario", ["fast-diagonal", "near-slack", "ship-to-shore"])
def test_effects_leave_what_the_engines_schemes_do(scenario: str, effect: str, drive: str) -> None:
    """Differences are within the limit of each effect, and not far below it, also with frame and wind."""
    agreement = judge(*both(scenario, [effect], drive=drive))
    assert agreement.passed, (agreement.max_load_error_m, agreement.max_angle_error_rad)
    if effect in ("frame", "wind"):
        assert (agreement.limit_m, agreement.limit_rad) == (1e-7, 1e-7)
    else:
        assert agreement.limit_m > agreement_limits("ideal").load_m


@pytest.mark.parametrize(("effect", "order"), [("rope", 4), ("friction", 1)])
def test_half_the_step_leaves_what_the_order_of_the_engines_scheme_says(effect: str, order: int) -> None:
    coarse = judge(*both("near-slack", [effect])).max_load_error_m
    fine = judge(*both("near-slack", [effect], "control.physics_step=0.00025")).max_load_error_m
    assert fine < 1.5 * coarse / 4**order


def test_a_rope_starts_taut_on_a_winch_that_sticks() -> None:
    """The swing makes tension and holding force differ by less than the winch's friction."""
    swung = "initial.alpha_offset=0.2", "initial.beta_offset=-0.1"
    first, second = both("fast-diagonal", ["rope", "friction"], *swung)
    assert abs(first.tension[0] - first.scenario.rig.weight) > 0.1
    assert np.abs(first.tension[:20] - second.tension[:20]).max() < 2e-3


def test_all_effects_at_once() -> None:
    assert judge(*both("fast-diagonal", ["limits", "delay", *EFFECTS])).passed

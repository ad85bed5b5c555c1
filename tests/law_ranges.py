"""Settings of controllers at the ends of what they allow: cases, and what holds for each."""

import math
from collections.abc import Iterable

import numpy as np

from cranectl.controllers.controller import Controller
from cranectl.controllers.registry import controller_design, load_controller
from cranectl.planning import load_scenario
from cranectl.simulate import linearised_controller, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from tests.ranges import result_or_refusal, tells_what_to_do

SHORT = ["duration=0.2", "disturbances.0.start=0.02", "disturbances.1.start=0.05"]
SMALL = (math.nextafter(0.0, 1.0), 1e-12)  # where 0 is allowed: the smallest number, and a small one
Case = tuple[str, str, str, float | str]  # what it is called, controller, setting, value


def cases(controllers: Iterable[Controller]) -> list[Case]:
    """Each setting of each controller at both ends, at the smallest sizes, and each of its choices."""
    found: list[Case] = []
    for law in controllers:
        for each in law.parameters:
            small = SMALL if each.lowest == 0.0 else ()
            values: tuple[float | str, ...] = each.choices or (each.lowest, *small, each.highest)
            found += [(f"{law.name}: {each.name}={value!r}", law.name, each.name, value) for value in values]
    return found


def check(case: Case) -> None:
    """Assert that a setting gives a stable loop and a run of finite numbers, or is refused with what to do.

    Every controller that says what it is near rest is stable there. A strong one may ask for a slack rope,
    and one that overturns its load ends at an angle of a quarter turn; the run says so.
    """
    _, name, setting, value = case
    changed = f"controller.{name}.{setting}={value}"
    scenario = load_scenario("fixed-position", overrides=[*SHORT, changed])
    ran = result_or_refusal(
        lambda: (
            design := controller_design(name, scenario),
            linearised_controller(scenario, design),
            simulate_run(scenario, plant="analytic", drive="velocity", controller=name),
        )
    )
    if isinstance(ran, InputError):
        assert tells_what_to_do(str(ran)), ran
        return
    design, linear, run = ran
    assert design.parameters[setting] == value
    for law in linear:
        assert np.isfinite(law.gain).all()
        assert np.linalg.eigvals(law.a - law.b @ law.gain[np.newaxis]).real.max() < 0.0
    assert load_controller(name).linearise is None or len(linear) == 3
    assert run.status in (RunStatus.COMPLETED, RunStatus.SLACK_ROPE, RunStatus.ANGLE_SINGULAR)
    assert np.isfinite(run.table).all()

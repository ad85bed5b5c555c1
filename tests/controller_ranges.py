"""Settings of controllers at the limits of their allowed ranges: the cases, and the check of each case."""

import math
from collections.abc import Iterable

import numpy as np

from cranectl.controllers.controller import Controller
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.simulate import PreparedController, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from tests.ranges import has_found_allowed_and_remedy, result_or_refusal

SHORT = ["duration=0.2", "disturbances.0.start=0.02", "disturbances.1.start=0.05"]
TINY = (math.nextafter(0.0, 1.0), 1e-12)  # also tested where 0 is allowed
Case = tuple[str, str, str, float | str]  # name of the case, controller, setting, value


def cases(controllers: Iterable[Controller]) -> list[Case]:
    """Return cases for each setting of each controller: both limits, tiny values, and all choices."""
    result: list[Case] = []
    for controller in controllers:
        for parameter in controller.parameters:
            tiny = TINY if parameter.lowest == 0.0 else ()
            values: tuple[float | str, ...] = parameter.choices or (
                parameter.lowest,
                *tiny,
                parameter.highest,
            )
            result += [
                (f"{controller.name}: {parameter.name}={value!r}", controller.name, parameter.name, value)
                for value in values
            ]
    return result


def check(case: Case) -> None:
    """Assert that a setting gives a stable loop and a run of finite numbers, or is refused with a remedy.

    Every controller with a linearisation at rest is stable there. A run may still end early: aggressive
    gains may cause a slack rope, or a swing angle of a quarter turn.
    """
    _, name, setting, value = case
    changed = f"controller.{name}.{setting}={value}"
    scenario = load_scenario("fixed-position", overrides=[*SHORT, changed])
    result = result_or_refusal(
        lambda: (
            design := ALL_CONTROLLERS.design(name, scenario),
            PreparedController.near_rest(scenario, design),
            simulate_run(scenario, plant="analytic", drive="velocity", controller=name),
        )
    )
    if isinstance(result, InputError):
        assert has_found_allowed_and_remedy(str(result)), result
        return
    design, linear, run = result
    assert design.parameters[setting] == value
    for axis in linear:
        assert np.isfinite(axis.gain).all()
        assert np.linalg.eigvals(axis.a - axis.b @ axis.gain[np.newaxis]).real.max() < 0.0
    assert ALL_CONTROLLERS[name].linearise is None or len(linear) == 3
    assert run.status in (RunStatus.COMPLETED, RunStatus.SLACK_ROPE, RunStatus.ANGLE_SINGULAR)
    assert np.isfinite(run.table).all()

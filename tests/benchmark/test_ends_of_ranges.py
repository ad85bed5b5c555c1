"""At both ends of every setting, the benchmark's controllers give finite numbers or an error with a remedy.

The tests of each controller check its gains. Here a short run on the nonlinear crane must end with finite
numbers. If a controller declares its linear behaviour near rest, its poles must be stable.
"""

import importlib

import pytest

from cranectl import open_controller
from cranectl.controllers.controller import Controller
from tests.conftest import ROOT
from tests.controller_ranges import Case, cases, check
from tests.ranges import share_of

SHARE = 16  # one in 16 cases runs by default
FILES = [path for path in sorted((ROOT / "validation" / "benchmark").glob("*.py")) if path.stem != "__init__"]
CONTROLLERS = {  # by name: the argument that opens the controller, and the controller
    controller.name: (f"{path}:{symbol}", controller)
    for path in FILES
    for symbol, controller in vars(importlib.import_module(f"validation.benchmark.{path.stem}")).items()
    if isinstance(controller, Controller)
}
CASES = cases(controller for _, controller in CONTROLLERS.values())


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", share_of(CASES, SHARE), ids=lambda case: case[0])
def test_setting_gives_finite_numbers_or_an_error_with_remedy(case: Case) -> None:
    open_controller(CONTROLLERS[case[1]][0])
    check(case)


def test_all_settings_have_cases() -> None:
    assert len(CONTROLLERS) >= len(FILES)
    assert len(CASES) > 200

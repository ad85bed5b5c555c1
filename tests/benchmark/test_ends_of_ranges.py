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

SHARE = 16
FILES = [path for path in sorted((ROOT / "validation" / "benchmark").glob("*.py")) if path.stem != "__init__"]
LAWS = {  # by name: the reference that opens the controller, and the controller
    law.name: (f"{path}:{symbol}", law)
    for path in FILES
    for symbol, law in vars(importlib.import_module(f"validation.benchmark.{path.stem}")).items()
    if isinstance(law, Controller)
}
CASES = cases(law for _, law in LAWS.values())


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", share_of(CASES, SHARE), ids=lambda case: case[0])
def test_a_setting_gives_finite_numbers_or_says_what_to_do(case: Case) -> None:
    open_controller(LAWS[case[1]][0])
    check(case)


def test_every_setting_is_tried() -> None:
    assert len(LAWS) >= len(FILES)
    assert len(CASES) > 200

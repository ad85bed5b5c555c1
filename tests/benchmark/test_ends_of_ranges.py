"""Both ends of every setting of the benchmark's controllers: a run of finite numbers, or what to do.

What their gains must be is checked by a test of each controller. Here a short run on the nonlinear crane must
end with finite numbers, and where a controller says what it is near rest, its poles must be stable.
"""

import importlib

import pytest

from cranectl import open_controller
from cranectl.controllers.controller import Controller
from tests.conftest import ROOT
from tests.law_ranges import Case, cases, check
from tests.ranges import share_of

SHARE = 16
FILES = [path for path in sorted((ROOT / "validation" / "benchmark").glob("*.py")) if path.stem != "__init__"]
LAWS = {  # by name, how it is opened and what it is
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
